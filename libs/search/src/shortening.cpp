#include "shortening.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr int cuts_max = 100;        // attempts to replace a random stretch
constexpr double least_gain = 1e-3;  // by which a line must shorten the path, as a share of it
constexpr double same = 1e-9;        // distance of points that count as one [rad or m]
constexpr double via_spread = 0.2;   // deviation of a via, as a share of the stretch it replaces
constexpr Index points_max = 256, points_more = 4;  // and those that a replacement adds

}  // namespace

Shortening::Shortening(Index dof)
    : path_(dof, points_max + points_more),
      kept_(path_),
      a_{0, VectorXd::Zero(dof)},
      b_(a_),
      via_(a_.q),
      p_(a_.q),
      r_(a_.q) {}

void Shortening::begin(const Eigen::Ref<const Eigen::MatrixXd>& points) {
  kept_count_ = points.cols();
  if (kept_count_ + points_more > kept_.cols()) {
    kept_.resize(points.rows(), 2 * kept_count_ + points_more);
    path_.resize(points.rows(), kept_.cols());
  }
  kept_.leftCols(kept_count_) = points;
  take_kept();
  cuts_ = 0;
  phase_ = Phase::skip;
  begin_skip();
}

void Shortening::take_kept() {
  path_.swap(kept_);
  count_ = kept_count_;
  length_ = 0.0;
  for (Index i = 0; i + 1 < count_; ++i) length_ += (path_.col(i + 1) - path_.col(i)).norm();
}

bool Shortening::propose(Rng& rng) {
  if (count_ <= 2) return false;
  if (phase_ == Phase::improve) return propose_improvement(rng);
  return phase_ == Phase::cut ? propose_cut(rng) : propose_skip();
}

bool Shortening::answer(bool clear) {
  if (phase_ == Phase::improve) return answer_improvement(clear);
  if (phase_ == Phase::cut) {
    if (clear) replace(nullptr);
    end_cut();
  } else if (clear) {
    keep_skip();
  } else {
    to_ = (from_ + to_) / 2;
  }
  return false;
}

void Shortening::begin_skip() {
  kept_.col(0) = path_.col(0);
  kept_count_ = 1;
  from_ = 0;
  to_ = count_ - 1;
}

// The line from the way-point that was kept last to another one.
bool Shortening::propose_skip() {
  p_ = path_.col(from_);
  r_ = path_.col(to_);
  if (to_ > from_ + 1) return true;
  keep_skip();
  return false;
}

void Shortening::keep_skip() {
  from_ = std::max(to_, from_ + 1);
  to_ = count_ - 1;
  kept_.col(kept_count_++) = path_.col(from_);
  if (from_ + 1 < count_) return;
  take_kept();
  phase_ = phase_ == Phase::skip ? Phase::cut : Phase::improve;
}

bool Shortening::propose_cut(Rng& rng) {
  draw_places(rng);
  p_ = a_.q;
  r_ = b_.q;
  if (a_.after != b_.after && gains((r_ - p_).norm())) return true;
  end_cut();
  return false;
}

void Shortening::end_cut() {
  if (++cuts_ < cuts_max) return;
  phase_ = Phase::skip_again;
  begin_skip();
}

bool Shortening::propose_improvement(Rng& rng) {
  draw_places(rng);
  if (a_.after == b_.after) return false;
  const double deviation = via_spread * along_ / std::sqrt(static_cast<double>(via_.size()));
  for (Index j = 0; j < via_.size(); ++j)
    via_[j] = 0.5 * (a_.q[j] + b_.q[j]) + deviation * rng.normal();
  line_ = Line::direct;
  p_ = a_.q;
  r_ = b_.q;
  return gains((r_ - p_).norm()) || propose_via();
}

bool Shortening::propose_via() {
  line_ = Line::to_via;
  p_ = a_.q;
  r_ = via_;
  return gains((via_ - a_.q).norm() + (b_.q - via_).norm());
}

bool Shortening::answer_improvement(bool clear) {
  switch (line_) {
    case Line::direct:
      if (!clear) return propose_via();
      replace(nullptr);
      return false;
    case Line::to_via:
      line_ = Line::from_via;
      p_ = via_;
      r_ = b_.q;
      return clear;
    case Line::from_via:
      if (clear) replace(&via_);
  }
  return false;
}

bool Shortening::gains(double length) const {
  return along_ - length >= least_gain * length_;
}

void Shortening::draw_places(Rng& rng) {
  double s = rng.uniform(0.0, length_), t = rng.uniform(0.0, length_);
  if (s > t) std::swap(s, t);
  place_at(s, a_);
  place_at(t, b_);
  along_ = t - s;
}

void Shortening::place_at(double s, Place& out) const {
  for (Index i = 0; i + 1 < count_; ++i) {
    const double line = (path_.col(i + 1) - path_.col(i)).norm();
    if (s <= line) {
      out.after = i;
      out.q = path_.col(i) + (line > 0.0 ? s / line : 0.0) * (path_.col(i + 1) - path_.col(i));
      return;
    }
    s -= line;
  }
  out.after = count_ - 2;
  out.q = path_.col(count_ - 1);
}

void Shortening::keep(const VectorXd& q) {
  if ((kept_.col(kept_count_ - 1) - q).norm() > same) kept_.col(kept_count_++) = q;
}

void Shortening::replace(const VectorXd* via) {
  const Index before = a_.after + 1, behind = count_ - 1 - b_.after;
  if (before + 3 + behind > kept_.cols()) return;
  kept_.leftCols(before) = path_.leftCols(before);
  kept_count_ = before;
  keep(a_.q);
  if (via != nullptr) keep(*via);
  keep(b_.q);
  for (Index i = b_.after + 1; i < count_; ++i) {
    p_ = path_.col(i);
    keep(p_);
  }
  kept_.col(kept_count_ - 1) = path_.col(count_ - 1);
  take_kept();
}

}  // namespace hamelin::search
