#include "guide/guide_search.hpp"

#include <exception>
#include <memory>
#include <span>
#include <utility>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

GuideRequest::GuideRequest(Index dof, Index points_max)
    : q(VectorXd::Zero(dof)), way_start(q), kept(Eigen::MatrixXd::Zero(dof, points_max)) {}

GuideSearch::GuideSearch(const model::Model& model, const World& world, const WorldView& view,
                         std::unique_ptr<MotionSearch> search, Index points_max, bool threaded)
    : search_(std::move(search)),
      query_(model, world, view),
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

search::Problem GuideSearch::problem() const {
  search::Problem out;
  out.start = request_.q;
  out.number = request_.search;
  out.known = request_.kept.leftCols(request_.kept_count);
  const scene::Goal& goal = (*request_.goals)[request_.goal];
  const std::span<const scene::Goal> options = scene::options_of(goal);
  out.goals.assign(options.begin(), options.end());
  if (request_.target) {
    out.goals.front().type = goal.position_only ? scene::GoalType::position : scene::GoalType::pose;
    out.goals.front().pose = *request_.target;
  }
  return out;
}

void GuideSearch::find(GuideAnswer& out) {
  const scene::Goal& goal = (*request_.goals)[request_.goal];
  const auto search = [&] {
    if (!request_.lead) return search_->find(problem(), goal, request_.way_start, query_);
    if (!request_.passes) return search_->find_on(*request_.lead, problem(), goal, query_);
    const scene::Goal& passed = (*request_.goals)[request_.goal - 1];
    return search_->find_past(*request_.lead, passed, problem(), goal, query_);
  };
  MotionSearch::Found found = search();
  if (request_.passes) request_.lead->time_s = found.lead_s;
  out.passed_by_s = found.passed_by_s;
  out.lead = request_.lead;
  out.checks += found.checks;
  out.path = std::move(found.path);
  out.motion = std::move(found.motion);
  out.motion_cause = std::move(found.cause);
  if (!out.motion) return;
  out.path.points = std::move(found.way_points);
  out.path.length = search::path_length(out.path.points);
}

void GuideSearch::answer() {
  auto out = std::make_unique<GuideAnswer>();
  const long before = query_.checks();
  out->number = request_.number;
  out->snapshot = query_.refresh(request_.time_s, request_.allowance);
  out->kept = still_clear();
  out->checks = query_.checks() - before;
  try {
    if (!out->kept) find(*out);
  } catch (const std::exception& e) {  // on a thread of its own nobody could catch it
    out->path.cause = e.what();
  }
  request_.goals.reset();
  answers_.publish(std::move(out));
}

}  // namespace hamelin::control
