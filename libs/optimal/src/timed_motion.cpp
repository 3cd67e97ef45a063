#include "hamelin/optimal/timed_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::optimal {

using Eigen::Index;

std::array<double, 4> spline_weights(double s) noexcept {
  const double r = 1.0 - s;
  return {r * r * r / 6.0, (4.0 - 6.0 * s * s + 3.0 * s * s * s) / 6.0,
          (4.0 - 6.0 * r * r + 3.0 * r * r * r) / 6.0, s * s * s / 6.0};
}

// docs/theory.md (18.2)
void TimedMotion::at(double time_s, VectorXd& q, VectorXd& v, VectorXd& a) const {
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

MotionProof prove(const TimedMotion& motion, control::WorldView& view, double piece_s) {
  const double duration = motion.duration_s();
  const auto pieces = static_cast<long>(std::ceil(duration / piece_s - 1e-9));
  MotionProof out;
  out.piece_s = duration / static_cast<double>(pieces);
  out.margin_m = std::numeric_limits<double>::infinity();
  VectorXd q, v, a;
  motion.at(0.0, q, v, a);
  view.look(q, 0.0);
  view.depart(q, v);
  for (long i = 1; i <= pieces; ++i) {
    const double time = out.piece_s * static_cast<double>(i);
    motion.at(time, q, v, a);
    view.look(q, time);
    const auto verdict = view.certify(q, v);
    out.margin_m = std::min(out.margin_m, verdict.margin_m);
    if (!verdict.certified && out.certified) {
      out.certified = false;
      out.first_open_s = time - out.piece_s;
    }
    view.depart(q, v);
  }
  return out;
}

}  // namespace hamelin::optimal
