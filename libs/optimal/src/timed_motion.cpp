#include "hamelin/optimal/timed_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "refuse.hpp"

namespace hamelin::optimal {

using Eigen::Index;

std::array<double, 4> spline_weights(double s) noexcept {
  const double r = 1.0 - s;
  return {r * r * r / 6.0, (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
          (4.0 - 6.0 * r * r + 3.0 * r * r * r) / 6.0, s * s * s / 6.0};
}

bool TimedMotion::well_formed() const {
  return step_s > 0.0 && std::isfinite(step_s) && control.rows() > 0 && intervals() > 0 &&
         control.allFinite();
}

// docs/theory.md (18.2)
void TimedMotion::at(double time_s, VectorXd& q, VectorXd& v, VectorXd& a) const {
  if (!(step_s > 0.0) || intervals() < 1 || std::isnan(time_s))
    refuse(
        fmt::format("motion: {} intervals of {} s at the time {} s, expected at least one "
                    "positive interval and a time that is a number",
                    intervals(), step_s, time_s));
  const double place = std::clamp(time_s / step_s, 0.0, static_cast<double>(intervals()));
  const Index k = std::min(static_cast<Index>(place), intervals() - 1);
  const double s = place - static_cast<double>(k), r = 1.0 - s, h = step_s;
  const auto points = control.middleCols(k, 4);
  const std::array<double, 4> weights = spline_weights(s);
  q = weights[0] * points.col(0);
  for (Index i = 1; i < 4; ++i) q += weights[static_cast<std::size_t>(i)] * points.col(i);
  const double first = 0.5 * r * r, last = 0.5 * s * s;
  v = (first * (points.col(1) - points.col(0)) +
       (1.0 - first - last) * (points.col(2) - points.col(1)) +
       last * (points.col(3) - points.col(2))) /
      h;
  a = (r * (points.col(0) - 2.0 * points.col(1) + points.col(2)) +
       s * (points.col(1) - 2.0 * points.col(2) + points.col(3))) /
      (h * h);
}

void torque_at(const model::Model& model, dynamics::Workspace& ws, const TimedMotion& motion,
               double time_s, VectorXd& torque) {
  VectorXd q, v, a;
  motion.at(time_s, q, v, a);
  torque.resize(q.size());
  dynamics::inverse_dynamics(model, ws, q, v, a, torque);
}

namespace {

constexpr int bisections_max = 8;            // of a piece
constexpr double bound_resolution_m = 1e-5;  // of bounds below the margin

// Proves the pieces of a motion in the order of time, docs/theory.md (18.18). Places are times in
// intervals.
class Prover {
 public:
  Prover(const TimedMotion& motion, control::WorldView& view, const ProofOptions& options)
      : motion_(motion),
        view_(view),
        options_(options),
        rest_(VectorXd::Zero(motion.control.rows())) {}

  MotionProof run() {
    const auto pieces = static_cast<Index>(std::ceil(motion_.step_s / options_.piece_s - 1e-9));
    const Index per_interval = std::max<Index>(1, pieces);
    out_.piece_s = motion_.step_s / static_cast<double>(per_interval);
    out_.margin_m = infinity;
    Node from = look(0.0);
    view_.depart(from.q, rest_);
    for (Index k = 0; k < motion_.intervals(); ++k)
      for (Index i = 1; i <= per_interval; ++i)
        from = prove_piece(
            from,
            static_cast<double>(k) + static_cast<double>(i) / static_cast<double>(per_interval),
            bisections_max);
    out_.certified = out_.margin_m > 0.0 && out_.margin_m >= options_.margin_m;
    return out_;
  }

 private:
  struct Node {
    double place;
    VectorXd q, a;
    double clearance;
  };

  Node look(double place) {
    Node node{place, {}, {}, infinity};
    const double time = place * motion_.step_s;
    motion_.at(time, node.q, v_, node.a);
    view_.glance(node.q, options_.begin_s + time);
    if (view_.has_obstacles()) node.clearance = view_.clearance_m();
    if (view_.has_self()) node.clearance = std::min(node.clearance, view_.self_clearance_m());
    return node;
  }

  // From a node from which the view departed. Returns the end, from which it departed then.
  Node prove_piece(const Node& from, double to, int bisections) {
    Node end = look(to);
    // a velocity that grows from zero to this one strays as much as an acceleration of this size
    v_ = 0.5 * motion_.step_s * (to - from.place) * from.a.cwiseAbs().cwiseMax(end.a.cwiseAbs());
    const auto verdict = view_.certify(end.q, v_);
    const double bound = verdict.certified ? verdict.margin_m : std::min(0.0, verdict.margin_m),
                 low = std::min(from.clearance, end.clearance),
                 enough =
                     std::min(out_.margin_m, low >= options_.margin_m ? options_.margin_m
                                                                      : low - bound_resolution_m);
    if (bound < enough && low > 0.0 && bisections > 0) {
      (void)look(from.place);
      view_.depart(from.q, rest_);
      const Node middle = prove_piece(from, 0.5 * (from.place + to), bisections - 1);
      return prove_piece(middle, to, bisections - 1);
    }
    if (!(bound > 0.0 && bound >= options_.margin_m) && !open_) {
      open_ = true;
      out_.first_open_s = from.place * motion_.step_s;
    }
    out_.margin_m = std::min(out_.margin_m, bound);
    view_.depart(end.q, rest_);
    return end;
  }

  const TimedMotion& motion_;
  control::WorldView& view_;
  const ProofOptions& options_;
  VectorXd rest_, v_;
  MotionProof out_;
  bool open_ = false;
};

void check_options(const ProofOptions& options) {
  if (!(options.piece_s > 0.0) || !std::isfinite(options.piece_s))
    refuse(
        fmt::format("proof: pieces of {} s given, expected a positive "
                    "number",
                    options.piece_s));
  if (!(options.margin_m >= 0.0) || !std::isfinite(options.margin_m))
    refuse(
        fmt::format("proof: a margin of {} m given, expected a number "
                    "that is not negative",
                    options.margin_m));
  if (!std::isfinite(options.begin_s))
    refuse(fmt::format("proof: begins at {} s, expected a finite number", options.begin_s));
}

}  // namespace

MotionProof prove(const TimedMotion& motion, control::WorldView& view,
                  const ProofOptions& options) {
  check_options(options);
  if (!motion.well_formed()) return {};
  if (!view.has_obstacles() && !view.has_self()) return {true, infinity, 0.0, motion.step_s};
  return Prover(motion, view, options).run();
}

}  // namespace hamelin::optimal
