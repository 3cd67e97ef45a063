#include "hamelin/timing/time_law.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::timing {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
// The share of the limits that the nodes use at first: torques rise a little between them.
constexpr double first_share = 0.995;
constexpr int solutions_max = 4;
// Slopes and coefficients that count as zero, relative to a limit.
constexpr double negligible = 1e-12;
constexpr double squared_speed_max = 1e8;

void check(const VectorXd& limit, const char* name, Index dof, bool optional) {
  if (optional && limit.size() == 0) return;
  if (limit.size() != dof || !(limit.array() > 0.0).all())
    throw Error(
        ErrorCode::invalid,
        fmt::format("time law: {}: expected {} positive numbers (one per joint)", name, dof));
}

}  // namespace

TimeLaw::TimeLaw(const model::Model& model, Limits limits, Grid grid)
    : model_(model), limits_(std::move(limits)), grid_(grid), ws_(model) {
  check(limits_.velocity, "velocity", model.dof(), true);
  check(limits_.acceleration, "acceleration", model.dof(), false);
  check(limits_.torque, "torque", model.dof(), true);
}

void TimeLaw::add_nodes(double from, double to, Index count) {
  for (Index k = 1; k <= count; ++k)
    nodes_.push_back(from + (to - from) * static_cast<double>(k) / static_cast<double>(count));
}

// Pieces of timed curves are short already.
void TimeLaw::set_nodes(const Curve& curve) {
  nodes_.assign(1, 0.0);
  VectorXd bend(curve.dof());
  for (Index k = 0; k < curve.pieces(); ++k) {
    const double from = curve.knot(k), to = curve.knot(k + 1);
    curve.bound_bend(k, from, to, bend);
    const bool straight = bend.isZero(0.0);
    const auto by_length = static_cast<Index>(std::ceil((to - from) / grid_.spacing));
    add_nodes(from, to, straight ? by_length : std::max(grid_.nodes_per_bend, by_length));
  }
  places_ = Eigen::Map<const VectorXd>(nodes_.data(), static_cast<Index>(nodes_.size()));
  between_ = 0.5 * (places_.head(places_.size() - 1) + places_.tail(places_.size() - 1));
}

void TimeLaw::evaluate(const Curve& curve, const VectorXd& places) {
  const Index n = places.size(), dof = model_.dof();
  for (auto* x : {&q_, &dq_, &ddq_, &inertia_, &bias_, &gravity_}) x->resize(dof, n);
  zero_ = dynamics::StatesXd::Zero(dof, n);
  VectorXd q(dof), dq(dof), ddq(dof);
  Index piece = 0;
  for (Index i = 0; i < n; ++i) {
    piece = curve.at(places[i], q, dq, ddq, piece);
    q_.col(i) = q;
    dq_.col(i) = dq;
    ddq_.col(i) = ddq;
  }
  if (limits_.torque.size() == 0 && !keeps_dynamics_) return;
  dynamics::inverse_dynamics(model_, ws_, q_, zero_, zero_, gravity_);
  dynamics::inverse_dynamics(model_, ws_, q_, zero_, dq_, inertia_);
  dynamics::inverse_dynamics(model_, ws_, q_, dq_, ddq_, bias_);
  inertia_ -= gravity_;
  bias_ -= gravity_;
}

// docs/theory.md (19.6): rows at a node, where x is that of the interval's beginning + lead · u.
void TimeLaw::add_lines(Index node, double lead, double share, double& x_max) {
  const auto add = [&](double a, double b, double low, double high) {
    const double slope = a + lead * b, scale = high - low;
    if (std::abs(slope) * squared_speed_max > negligible * scale &&
        std::abs(slope) > negligible * std::abs(b)) {
      const double inverse = 1.0 / slope, p = low * inverse, q = high * inverse;
      lines_.push_back({std::min(p, q), std::max(p, q), b * inverse});
    } else if (std::abs(b) > 0.0) {
      x_max = std::min(x_max, b > 0.0 ? high / b : low / b);
    }
  };
  for (Index j = 0; j < limits_.torque.size(); ++j) {
    const double g = gravity_(j, node), most = share * limits_.torque[j];
    add(inertia_(j, node), bias_(j, node), -most - g, most - g);
  }
  for (Index j = 0; j < limits_.acceleration.size(); ++j) {
    const double most = share * limits_.acceleration[j];
    add(dq_(j, node), ddq_(j, node), -most, most);
  }
}

void TimeLaw::set_lines(Index interval, double share, double& x_max) {
  lines_.clear();
  const double h = places_[interval + 1] - places_[interval];
  add_lines(interval, 0.0, share, x_max);
  add_lines(interval + 1, 2.0 * h, share, x_max);
}

TimeLaw::Range TimeLaw::range(double x) const {
  Range out{-infinity, infinity};
  for (const Line& line : lines_) {
    out.low = std::max(out.low, line.low - line.slope * x);
    out.high = std::min(out.high, line.high - line.slope * x);
  }
  return out;
}

// The width of the range is a concave function of x: from the right, each step goes to where the
// two lines cross that bound it. Finitely many.
double TimeLaw::largest(double x_max) const {
  double x = x_max;
  for (std::size_t i = 0; i <= 2 * lines_.size(); ++i) {
    const Line *low = nullptr, *high = nullptr;
    Range at{-infinity, infinity};
    for (const Line& line : lines_) {
      if (const double u = line.low - line.slope * x; u > at.low) at.low = u, low = &line;
      if (const double u = line.high - line.slope * x; u < at.high) at.high = u, high = &line;
    }
    if (at.low <= at.high || low == nullptr || high == nullptr) return x;
    const double fall = high->slope - low->slope;  // of the width, by x
    const double next = (high->high - low->low) / fall;
    if (!(fall > 0.0) || !(next < x))
      return x <= 0.0 ? -1.0 : std::max(0.0, std::nextafter(x, 0.0));
    x = next;
    if (x < 0.0) return -1.0;
  }
  return x;
}

// docs/theory.md (19.7): the largest squared speeds from which rest can be reached.
bool TimeLaw::backward(const Start& start, double share) {
  const Index n = places_.size();
  squared_max_ = VectorXd::Constant(n, squared_speed_max);
  if (start.speed_max > 0.0)
    squared_max_ = squared_max_.cwiseMin(start.speed_max * start.speed_max);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < limits_.velocity.size(); ++j)
      if (dq_(j, i) != 0.0)
        squared_max_[i] =
            std::min(squared_max_[i], std::pow(share * limits_.velocity[j] / dq_(j, i), 2));
  controllable_.resize(n);
  controllable_[n - 1] = 0.0;
  for (Index i = n - 2; i >= 0; --i) {
    const double h2 = 2.0 * (places_[i + 1] - places_[i]);
    set_lines(i, share, squared_max_[i]);
    lines_.push_back({0.0, controllable_[i + 1] / h2, 1.0 / h2});
    controllable_[i] = largest(squared_max_[i]);
    if (controllable_[i] < 0.0) return false;
  }
  return true;
}

bool TimeLaw::forward(TimedPath& out, const Start& start, double share) {
  const Index n = places_.size();
  constexpr double rounding = 1e-9;
  double x = start.speed * start.speed;
  if (x > controllable_[0] * (1.0 + rounding) + rounding) return false;
  out.place = places_;
  out.time_s.resize(n);
  out.speed.resize(n);
  out.rate.resize(n - 1);
  out.time_s[0] = 0.0;
  out.speed[0] = start.speed;
  double unused = infinity;
  for (Index i = 0; i + 1 < n; ++i) {
    const double h2 = 2.0 * (places_[i + 1] - places_[i]);
    set_lines(i, share, unused);
    const Range allowed = range(x);
    const double u = std::min(std::max(allowed.high, -x / h2), (controllable_[i + 1] - x) / h2);
    const double next = std::max(0.0, x + h2 * u);
    out.rate[i] = u;
    out.speed[i + 1] = std::sqrt(next);
    const double sum = out.speed[i] + out.speed[i + 1];
    if (!(sum > 0.0)) return false;
    out.time_s[i + 1] = out.time_s[i] + h2 / sum;
    x = next;
  }
  return true;
}

// docs/theory.md (19.9): at the middle of each interval, with what a parabola through three points
// may rise between them.
double TimeLaw::excess(const TimedPath& motion) {
  double most = 0.0;
  const Index n = places_.size();
  const auto rise = [](double f0, double f1, double f2) {
    return std::max({std::abs(f0), std::abs(f1), std::abs(f2)}) +
           std::abs(f0 - 2.0 * f1 + f2) / 8.0;
  };
  for (Index i = 0; i + 1 < n; ++i) {
    const double u = motion.rate[i], x0 = motion.speed[i] * motion.speed[i],
                 x2 = motion.speed[i + 1] * motion.speed[i + 1], x1 = 0.5 * (x0 + x2);
    for (Index j = 0; j < model_.dof(); ++j) {
      const double a =
          rise(dq_(j, i) * u + ddq_(j, i) * x0, mid_dq_(j, i) * u + mid_ddq_(j, i) * x1,
               dq_(j, i + 1) * u + ddq_(j, i + 1) * x2);
      most = std::max(most, a / limits_.acceleration[j]);
      if (limits_.torque.size() > 0) {
        const double t = rise(inertia_(j, i) * u + bias_(j, i) * x0 + gravity_(j, i),
                              mid_inertia_(j, i) * u + mid_bias_(j, i) * x1 + mid_gravity_(j, i),
                              inertia_(j, i + 1) * u + bias_(j, i + 1) * x2 + gravity_(j, i + 1));
        most = std::max(most, t / limits_.torque[j]);
      }
      if (limits_.velocity.size() > 0)
        most = std::max(most, std::abs(mid_dq_(j, i)) * std::sqrt(x1) / limits_.velocity[j]);
    }
  }
  return most;
}

bool TimeLaw::pass(TimedPath& out, const Start& start, double share) {
  if (!backward(start, share)) {
    cause_ = "the limits do not hold the arm everywhere on the path";
    return false;
  }
  if (forward(out, start, share)) return true;
  cause_ = "the arm is too fast at the beginning of the path";
  return false;
}

double TimeLaw::duration_s(const Curve& curve) {
  if (!curve.is_smooth()) return infinity;
  set_nodes(curve);
  keeps_dynamics_ = false;
  evaluate(curve, places_);
  return pass(trial_, {}, first_share) ? trial_.duration_s() : infinity;
}

bool TimeLaw::solve(TimedPath& out, const Start& start) {
  keeps_dynamics_ = true;
  if (!out.curve.is_smooth()) {
    cause_ = "the path has a corner";
    return false;
  }
  set_nodes(out.curve);
  evaluate(out.curve, between_);
  std::swap(mid_dq_, dq_);
  std::swap(mid_ddq_, ddq_);
  std::swap(mid_inertia_, inertia_);
  std::swap(mid_bias_, bias_);
  std::swap(mid_gravity_, gravity_);
  evaluate(out.curve, places_);
  double share = first_share;
  for (int i = 0; i < solutions_max; ++i) {
    if (!pass(out, start, share)) return false;
    const double used = excess(out);
    if (used <= 1.0) {
      out.inertia = inertia_;
      out.bias = bias_;
      out.gravity = gravity_;
      out.tangent = dq_;
      out.curvature = ddq_;
      return true;
    }
    share *= std::min(0.999, 0.999 / used);
  }
  cause_ = "torques between the nodes of the path exceed their limits";
  return false;
}

}  // namespace hamelin::timing
