#include "judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace hamelin::test {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Rounding, in parts of a bound.
constexpr double rounding = 1e-9;
// Rounding of positions and velocities of size 3, seen as accelerations and as changes of these.
constexpr double acceleration_rounding = 1e-8, change_rounding = 1e-5;
// Distances are known up to here [m].
constexpr double limit_m = 0.2;
// A bound of how far a point of the arm, or of its load, is from any joint [m].
constexpr double reach_m = 1.5;
// Samples of a period.
constexpr int samples = 8;

}  // namespace

std::string_view to_string(Fault fault) noexcept {
  constexpr std::array<std::string_view, faults> names{
      "contact",      "self_contact", "position", "speed",      "torque", "torque_rate",
      "acceleration", "jerk",         "jump",     "not_finite", "strayed"};
  return names[static_cast<std::size_t>(fault)];
}

Judge::Judge(Bounds bounds, const model::Model& model, bool self_collision)
    : bounds_(std::move(bounds)), self_collision_(self_collision) {
  set_arm(model);
}

void Judge::set_arm(const model::Model& model) {
  ws_.reset();
  self_.reset();
  model_.emplace(model);
  ws_.emplace(*model_);
  arm_ = scene::PlacedShapes(*model_);
  if (self_collision_) self_.emplace(*model_);
  clear_until_m_ = self_clear_until_m_ = 0.0;
}

void Judge::expect_start(const VectorXd& q) {
  q_ = q;
  v_ = a_ = VectorXd::Zero(q.size());
  torque_known_ = false;
  rate_known_ = true;
  clear_until_m_ = self_clear_until_m_ = 0.0;
}

void Judge::expect_resumption(const VectorXd& q, const VectorXd& v) {
  const double rest = bounds_.acceleration * bounds_.period_s;
  if (!v_.isZero(0.0) || v.lpNorm<Eigen::Infinity>() > rest) return;
  rate_known_ = q == q_ && v == v_;
  q_ = q;
  v_ = v;
}

void Judge::note(Fault fault, const std::string& at, double value, double bound) {
  if (++counts_[static_cast<std::size_t>(fault)] > 1) return;
  findings_.push_back(
      fmt::format("{} {}: {:.6g}, bound {:.6g}", at, to_string(fault), value, bound));
}

void Judge::check_straying(double share, const std::string& at) {
  if (share > 1.0) note(Fault::strayed, at, share, 1.0);
}

void Judge::check_bound(Fault fault, const VectorXd& values, const VectorXd& bounds,
                        const std::string& at) {
  Index j = 0;
  if ((values.cwiseAbs() - bounds * (1.0 + rounding)).maxCoeff(&j) <= 0.0) return;
  note(fault, fmt::format("{} joint {}", at, j + 1), values[j], bounds[j]);
}

void Judge::check_positions(const VectorXd& q, const std::string& at) {
  const auto& [lower, upper, velocity, effort] = bounds_.limits;
  for (Index j = 0; j < lower.size(); ++j)
    if (!(q[j] >= lower[j] && q[j] <= upper[j]))
      note(Fault::position, fmt::format("{} joint {}", at, j + 1), q[j],
           q[j] < lower[j] ? lower[j] : upper[j]);
}

void Judge::check_output(const control::Answer& answer, const std::string& at) {
  if (!answer.torque.allFinite() || !answer.q_next.allFinite() || !answer.v_next.allFinite())
    return note(Fault::not_finite, at, 0.0, 0.0);
  check_bound(Fault::torque, answer.torque, bounds_.limits.effort_max, at);
  if (bounds_.torque_rate_Nm_s && torque_known_) {
    const double most = *bounds_.torque_rate_Nm_s * bounds_.period_s;
    check_bound(Fault::torque_rate, answer.torque - torque_,
                VectorXd::Constant(answer.torque.size(), most + acceleration_rounding), at);
  }
  torque_ = answer.torque;
  torque_known_ = true;
  if (bounds_.position) check_set_point(answer, at);
}

void Judge::check_set_point(const control::Answer& answer, const std::string& at) {
  const double T = bounds_.period_s;
  const VectorXd& speeds = bounds_.limits.velocity_max;
  const auto all = [&](double x) { return VectorXd::Constant(q_.size(), x); };
  const VectorXd a = (answer.v_next - v_) / T;
  check_positions(answer.q_next, at + " set point");
  check_bound(Fault::speed, answer.v_next, speeds, at + " set point");
  check_bound(Fault::acceleration, a, all(bounds_.acceleration + acceleration_rounding), at);
  if (rate_known_) check_bound(Fault::jerk, a - a_, all(bounds_.jerk * T + change_rounding), at);
  check_bound(Fault::jump, answer.q_next - q_, T * speeds + all(T * T * bounds_.acceleration), at);
  q_ = answer.q_next;
  v_ = answer.v_next;
  a_ = a;
  rate_known_ = true;
}

// Between ticks the arm moves along the cubic of its states, to within rounding.
void Judge::check_motion(const VectorXd& q, const VectorXd& v, const VectorXd& q_to,
                         const VectorXd& v_to, const control::WorldSnapshot& world, double time_s,
                         const std::string& at) {
  if (!q_to.allFinite() || !v_to.allFinite()) return note(Fault::not_finite, at, 0.0, 0.0);
  check_bound(Fault::speed, v_to, bounds_.limits.velocity_max, at);
  check_positions(q_to, at);
  if (std::exchange(snapshot_, world.number) != world.number) clear_until_m_ = 0.0;
  const double T = bounds_.period_s;
  const double way =
      reach_m * T * v.cwiseAbs().cwiseMax(v_to.cwiseAbs()).sum() + reach_m * (q_to - q).lpNorm<1>();
  clear_until_m_ -= way;
  self_clear_until_m_ -= way;
  if (clear_until_m_ > 0.0 && (!self_ || self_clear_until_m_ > 0.0)) return;
  for (int i = 0; i <= samples; ++i) {
    const double s = static_cast<double>(i) / samples, r = 1.0 - s;
    const VectorXd at_s = r * r * (1.0 + 2.0 * s) * q + s * s * (3.0 - 2.0 * s) * q_to +
                          T * s * r * (r * v - s * v_to);
    check_clearance(at_s, world.environment, time_s + s * T, at);
  }
}

void Judge::check_clearance(const VectorXd& q, const scene::Environment& world, double time_s,
                            const std::string& at) {
  dynamics::forward_kinematics(*model_, *ws_, q);
  arm_.place(*model_, *ws_);
  const double clearance = world.clearance(arm_.view(), {time_s}, limit_m, scene::View::judge, {},
                                           scene::Among::standing);
  if (clearance <= 0.0) note(Fault::contact, at, clearance, 0.0);
  least_clearance_m_ = std::min(least_clearance_m_, clearance);
  clear_until_m_ = clearance;
  if (!self_) return;
  double self = limit_m;
  for (std::size_t k = 0; k < self_->pairs().size(); ++k)
    self = std::min(self, self_->distance(k, arm_.view(), limit_m));
  if (self <= 0.0) note(Fault::self_contact, at, self, 0.0);
  self_clear_until_m_ = 0.5 * self;  // both parts move
}

}  // namespace hamelin::test
