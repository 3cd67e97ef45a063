#include "guide/guide_search.hpp"

#include <exception>
#include <memory>
#include <utility>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

GuideRequest::GuideRequest(Index dof, Index points_max)
    : q(VectorXd::Zero(dof)), kept(Eigen::MatrixXd::Zero(dof, points_max)) {
  goal.q = q;
}

GuideSearch::GuideSearch(const model::Model& model, const World& world, const WorldView& view,
                         search::Settings settings, std::unique_ptr<PathTiming> timing,
                         long other_checks, Index points_max, bool threaded)
    : search_(model, std::move(settings)),
      query_(model, world, view),
      timing_(std::move(timing)),
      other_checks_(other_checks),
      request_(model.dof(), points_max),
      answers_(std::make_unique<GuideAnswer>()) {
  if (threaded) thread_ = std::thread([this] { work(); });
}

GuideSearch::~GuideSearch() {
  if (!thread_.joinable()) return;
  state_ = State::ended;
  state_.notify_one();
  thread_.join();
}

void GuideSearch::ask() noexcept {
  state_ = State::asked;
  state_.notify_one();
}

void GuideSearch::run() {
  if (thread_.joinable() || state_ != State::asked) return;
  answer();
  state_ = State::idle;
}

void GuideSearch::work() {
  for (;;) {
    state_.wait(State::idle);
    if (state_ == State::ended) return;
    answer();
    State asked = State::asked;  // or ended in the meantime
    state_.compare_exchange_strong(asked, State::idle);
  }
}

bool GuideSearch::still_clear() {
  query_.set_margins(search::Margins(0.0));
  for (Index i = 0; i + 1 < request_.kept_count; ++i)
    if (!query_.motion_clear(request_.kept.col(i), request_.kept.col(i + 1))) return false;
  return request_.kept_count > 0;
}

void GuideSearch::find(GuideAnswer& out) {
  search::Problem problem{
      request_.q, {request_.goal}, request_.search, request_.kept.leftCols(request_.kept_count)};
  out.path = search_.search(problem, query_);
  out.checks += out.path.checks;
  if (!out.path.found() || !timing_) return;
  const long before = query_.checks() + timing_->checks();
  timing_->begin(request_.search);
  timing_->consider(out.path.points, search_.margins(), query_);
  find_others(problem, out);
  out.motion = timing_->make(query_);
  if (out.motion) {
    out.motion->standing = query_.standing();
    out.path.points = timing_->points();
    out.path.length = search::path_length(out.path.points);
  }
  out.checks += query_.checks() + timing_->checks() - before;
}

// Other random numbers may lead around the other side of an obstacle.
void GuideSearch::find_others(search::Problem& problem, const GuideAnswer& out) {
  if (out.path.points.cols() == 2) return;
  const long until = query_.checks() + other_checks_;
  for (std::uint64_t k = 1; query_.checks() < until; ++k) {
    problem.number = request_.search + (k << 32);
    search_.begin(problem, query_);
    if (!search_.advance(until - query_.checks())) return;
    if (search_.path().found() && search_.path().margin_m >= out.path.margin_m)
      timing_->consider(search_.path().points, search_.margins(), query_);
  }
}

void GuideSearch::answer() {
  auto out = std::make_unique<GuideAnswer>();
  const long before = query_.checks();
  out->number = request_.number;
  out->snapshot = query_.refresh(request_.time_s);
  out->kept = still_clear();
  out->checks = query_.checks() - before;
  try {
    if (!out->kept) find(*out);
  } catch (const std::exception& e) {  // on a thread of its own nobody could catch it
    out->path.cause = e.what();
  }
  answers_.publish(std::move(out));
}

}  // namespace hamelin::control
