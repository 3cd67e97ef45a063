#include "hamelin/timing/time_law.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "averaged_motion.hpp"
#include "hamelin/core/error.hpp"

namespace hamelin::timing {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
// The share of the limits that the nodes use at first: torques rise a little between them.
constexpr double first_share = 0.995;
constexpr int solutions_max = 12;
// Where q″ jumps by more than this, there are nodes so far before and behind, for timed curves [s].
constexpr double jump_least = 1e-3, beside_jump_s = 1e-6;
// Slopes and coefficients that count as zero, relative to a limit.
constexpr double negligible = 1e-12;
constexpr double squared_speed_max = 1e8;
// The window over which a motion is averaged: at first, at most [s], and its intervals; how often
// it and the shares are changed.
constexpr double least_window_s = 0.02, longest_window_s = 0.5;
constexpr int window_intervals = 4, averages_max = 16;
// What the window alone may use of the bounds of rates, and by how much more is corrected than is
// exceeded.
constexpr double ramp_share = 0.8, corrected = 0.99;
// Averaged motions keep this share of the limits: pieces of the curve meet within their intervals.
constexpr double averaged_share = 0.995;
// Of accelerations, with which averaging begins: the fastest result counts.
constexpr std::array acceleration_shares{1.0, 0.6, 0.35};

void check(const VectorXd& limit, const char* name, Index dof, bool optional) {
  if (optional && limit.size() == 0) return;
  if (limit.size() != dof || !(limit.array() > 0.0).all())
    throw Error(
        ErrorCode::invalid,
        fmt::format("time law: {}: expected {} positive numbers (one per joint)", name, dof));
}

// The largest value of a parabola through three, and of its slope: docs/theory.md (19.9), (19.13).
double largest_value(double f0, double f1, double f2) {
  return std::max({std::abs(f0), std::abs(f1), std::abs(f2)}) + std::abs(f0 - 2.0 * f1 + f2) / 8.0;
}
double largest_slope(double f0, double f1, double f2, double h) {
  return std::max(std::abs(-3.0 * f0 + 4.0 * f1 - f2), std::abs(f0 - 4.0 * f1 + 3.0 * f2)) / h;
}

}  // namespace

TimeLaw::TimeLaw(const model::Model& model, Limits limits, Grid grid)
    : model_(model),
      limits_(std::move(limits)),
      grid_(grid),
      ws_(model),
      one_(model),
      squared_most_(squared_speed_max) {
  check(limits_.velocity, "velocity", model.dof(), true);
  check(limits_.acceleration, "acceleration", model.dof(), false);
  check(limits_.torque, "torque", model.dof(), true);
  check(limits_.jerk, "jerk", model.dof(), true);
  check(limits_.torque_rate, "torque_rate", model.dof(), true);
}

void TimeLaw::add_nodes(double from, double to, Index count) {
  for (Index k = 1; k <= count; ++k)
    nodes_.push_back(from + (to - from) * static_cast<double>(k) / static_cast<double>(count));
}

// Pieces of timed curves are short already. From rest to rest there is some node in between, and
// where it should be is known from several.
void TimeLaw::set_nodes(const Curve& curve) {
  constexpr Index least_of_all = 6;
  const Index least = curve.pieces() == 1 ? least_of_all : 1;
  nodes_.assign(1, 0.0);
  VectorXd bend(curve.dof());
  for (Index k = 0; k < curve.pieces(); ++k) {
    const double from = curve.knot(k), to = curve.knot(k + 1);
    curve.bound_bend(from, to, bend);
    const bool straight = bend.isZero(0.0);
    const auto by_length = static_cast<Index>(std::ceil((to - from) / grid_.spacing));
    add_nodes(from, to, std::max(straight ? least : grid_.nodes_per_bend, by_length));
  }
  places_ = Eigen::Map<const VectorXd>(nodes_.data(), static_cast<Index>(nodes_.size()));
}

void TimeLaw::set_nodes_beside_jumps(const Curve& curve) {
  set_nodes(curve);
  VectorXd q(curve.dof()), dq(q), before(q), behind(q);
  std::vector<double> split{0.0};
  Index piece = 0;
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const double s = nodes_[i];
    const bool is_knot = s >= curve.knot(piece + 1);
    if (is_knot && piece + 1 < curve.pieces()) {
      ++piece;
      curve.at(s - beside_jump_s, q, dq, before);
      curve.at(s + beside_jump_s, q, dq, behind);
      if ((behind - before).lpNorm<Eigen::Infinity>() > jump_least &&
          s - split.back() > 4.0 * beside_jump_s) {
        split.push_back(s - beside_jump_s);
        split.push_back(s + beside_jump_s);
        continue;
      }
    }
    split.push_back(s);
  }
  nodes_.swap(split);
  places_ = Eigen::Map<const VectorXd>(nodes_.data(), static_cast<Index>(nodes_.size()));
}

void TimeLaw::evaluate(const Curve& curve, const VectorXd& places, bool torques, Rows& out) {
  const Index n = places.size(), dof = model_.dof();
  for (auto* x : {&q_, &out.tangent, &out.curvature}) x->resize(dof, n);
  VectorXd q(dof), dq(dof), ddq(dof);
  Index piece = 0;
  for (Index i = 0; i < n; ++i) {
    piece = curve.at(places[i], q, dq, ddq, piece);
    q_.col(i) = q;
    out.tangent.col(i) = dq;
    out.curvature.col(i) = ddq;
  }
  evaluate_tip(out);
  if (!torques) return;
  evaluated_ += n;
  for (auto* x : {&out.inertia, &out.bias, &out.gravity}) x->resize(dof, n);
  zero_ = dynamics::StatesXd::Zero(dof, n);
  dynamics::inverse_dynamics(model_, ws_, q_, zero_, zero_, out.gravity);
  dynamics::inverse_dynamics(model_, ws_, q_, zero_, out.tangent, out.inertia);
  dynamics::inverse_dynamics(model_, ws_, q_, out.tangent, out.curvature, out.bias);
  out.inertia -= out.gravity;
  out.bias -= out.gravity;
}

void TimeLaw::evaluate_tip(Rows& out) {
  out.tip.resize(std::isfinite(limits_.tip_speed) ? q_.cols() : 0);
  VectorXd q(model_.dof()), dq(model_.dof());
  for (Index i = 0; i < out.tip.size(); ++i) {
    q = q_.col(i);
    dq = out.tangent.col(i);
    dynamics::forward_kinematics(model_, one_, q);
    out.tip[i] = dynamics::point_velocity(model_, one_, model_.robot().tip.link,
                                          dynamics::tip_pose(model_, one_).p(), dq)
                     .norm();
  }
}

// docs/theory.md (19.6): rows at a node, where x is that of the interval's beginning + lead · u.
// What does not depend on x is one line.
void TimeLaw::add_lines(Index node, double lead, double share, Line& level, double& x_max) {
  const auto add = [&](double a, double b, double low, double high) {
    const double slope = a + lead * b, scale = high - low;
    if (std::abs(slope) * squared_speed_max > negligible * scale &&
        std::abs(slope) > negligible * std::abs(b)) {
      const double inverse = 1.0 / slope, p = low * inverse, q = high * inverse;
      if (b == 0.0) {
        level.low = std::max(level.low, std::min(p, q));
        level.high = std::min(level.high, std::max(p, q));
      } else {
        lines_.push_back({std::min(p, q), std::max(p, q), b * inverse});
      }
    } else if (std::abs(b) > 0.0) {
      x_max = std::min(x_max, b > 0.0 ? high / b : low / b);
    }
  };
  for (Index j = 0; j < limits_.torque.size(); ++j) {
    const double g = rows_.gravity(j, node), most = limits_.torque[j];
    add(rows_.inertia(j, node), rows_.bias(j, node), share * (-most - g), share * (most - g));
  }
  for (Index j = 0; j < limits_.acceleration.size(); ++j) {
    const double most = acceleration_share_ * share * limits_.acceleration[j];
    add(rows_.tangent(j, node), rows_.curvature(j, node), -most, most);
  }
}

void TimeLaw::add_lines(Index interval, double& x_max) {
  const double h = places_[interval + 1] - places_[interval], share = shares_[interval];
  Line level{-infinity, infinity, 0.0};
  first_line_.push_back(lines_.size());
  add_lines(interval, 0.0, share, level, x_max);
  add_lines(interval + 1, 2.0 * h, share, level, x_max);
  lines_.push_back(level);
}

// They are appended from the last interval to the first.
std::span<const TimeLaw::Line> TimeLaw::lines_of(Index interval) const {
  const std::size_t later = first_line_.size() - 1 - static_cast<std::size_t>(interval),
                    begin = first_line_[later];
  return std::span(lines_).subspan(begin,
                                   (interval > 0 ? first_line_[later + 1] : lines_.size()) - begin);
}

TimeLaw::Range TimeLaw::range(std::span<const Line> lines, double x) {
  Range out{-infinity, infinity};
  for (const Line& line : lines) {
    out.low = std::max(out.low, line.low - line.slope * x);
    out.high = std::min(out.high, line.high - line.slope * x);
  }
  return out;
}

// The width of the range is a concave function of x: from the right, each step goes to where the
// two lines cross that bound it. Finitely many.
double TimeLaw::largest(std::span<const Line> lines, double x_max) {
  double x = x_max;
  for (std::size_t i = 0; i <= 2 * lines.size(); ++i) {
    const Line *low = nullptr, *high = nullptr;
    Range at{-infinity, infinity};
    for (const Line& line : lines) {
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
bool TimeLaw::backward() {
  const Index n = places_.size();
  squared_max_ = VectorXd::Constant(n, squared_most_);
  for (Index i = 0; i < n; ++i) {
    const double share = std::min(shares_[std::min(i, n - 2)], shares_[std::max<Index>(i - 1, 0)]);
    for (Index j = 0; j < limits_.velocity.size(); ++j)
      if (const double slope = rows_.tangent(j, i); slope != 0.0)
        squared_max_[i] =
            std::min(squared_max_[i], std::pow(share * limits_.velocity[j] / slope, 2));
    if (rows_.tip.size() > 0 && rows_.tip[i] > 0.0)
      squared_max_[i] =
          std::min(squared_max_[i], std::pow(share * limits_.tip_speed / rows_.tip[i], 2));
  }
  controllable_.resize(n);
  controllable_[n - 1] = squared_at_end_;
  lines_.clear();
  first_line_.clear();
  for (Index i = n - 2; i >= 0; --i) {
    const double h2 = 2.0 * (places_[i + 1] - places_[i]);
    add_lines(i, squared_max_[i]);
    lines_.push_back({0.0, controllable_[i + 1] / h2, 1.0 / h2});
    controllable_[i] = largest(std::span(lines_).subspan(first_line_.back()), squared_max_[i]);
    lines_.pop_back();
    if (controllable_[i] < 0.0) return false;
  }
  return true;
}

bool TimeLaw::forward(TimedPath& out, double speed) {
  const Index n = places_.size();
  constexpr double rounding = 1e-9;
  double x = std::isfinite(speed) ? speed * speed : controllable_[0];
  if (x > controllable_[0] * (1.0 + rounding) + rounding) return false;
  out.place = places_;
  out.time_s.resize(n);
  out.speed.resize(n);
  out.rate.resize(n - 1);
  out.ramp = VectorXd::Zero(n - 1);
  out.time_s[0] = 0.0;
  out.speed[0] = std::sqrt(x);
  for (Index i = 0; i + 1 < n; ++i) {
    const double h2 = 2.0 * (places_[i + 1] - places_[i]);
    const Range allowed = range(lines_of(i), x);
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

bool TimeLaw::pass(TimedPath& out, double speed) {
  if (!backward()) {
    cause_ = "the limits do not hold the arm everywhere on the path";
    return false;
  }
  if (forward(out, speed)) return true;
  cause_ = "the arm is too fast at the beginning of the path";
  return false;
}

double TimeLaw::duration_s(const Curve& curve) {
  if (!curve.is_smooth()) return infinity;
  set_nodes(curve);
  evaluate(curve, places_, limits_.torque.size() > 0, rows_);
  shares_ = VectorXd::Constant(places_.size() - 1, first_share);
  return pass(trial_, 0.0) ? trial_.duration_s() : infinity;
}

bool TimeLaw::solve(TimedPath& out, double speed) {
  if (!out.curve.is_smooth()) {
    cause_ = "the path has a corner";
    return false;
  }
  evaluated_ = 0;
  set_nodes(out.curve);
  evaluate(out.curve, places_, true, rows_);
  shares_ = VectorXd::Constant(places_.size() - 1, first_share);
  return limits_.have_rates() ? solve_with_ramps(out) : solve_with_jumps(out, speed);
}

// With the time as parameter q′ is zero where the motion rests, so dσ/dt need not be.
bool TimeLaw::slow_down(TimedPath& out) {
  evaluated_ = 0;
  set_nodes_beside_jumps(out.curve);
  evaluate(out.curve, places_, true, rows_);
  shares_ = VectorXd::Constant(places_.size() - 1, first_share);
  squared_most_ = squared_at_end_ = 1.0;
  const bool found = solve_with_jumps(out, infinity);
  squared_most_ = squared_speed_max;
  squared_at_end_ = 0.0;
  return found;
}

bool TimeLaw::solve_with_jumps(TimedPath& out, double speed) {
  for (int i = 0; i < solutions_max; ++i) {
    if (!pass(out, speed)) return false;
    if (i == 0) evaluate_between(out);
    bool within = true;
    for (Index k = 0; k + 1 < out.nodes(); ++k) {
      const double most = used(out, k, rows_).values;
      if (most <= 1.0) continue;
      within = false;
      shares_[k] *= std::min(0.999, 0.999 / most);
    }
    if (within) {
      store(rows_, out);
      return true;
    }
  }
  cause_ = "torques between the nodes of the path exceed their limits";
  return false;
}

// The larger the accelerations, the longer the window over which they change: neither extreme is
// the fastest.
bool TimeLaw::solve_with_ramps(TimedPath& out) {
  bool found = false;
  other_.curve = out.curve;
  for (const double share : acceleration_shares) {
    acceleration_share_ = share;
    shares_.setConstant(first_share);
    if (!average_until_within(other_)) continue;
    if (!found || other_.duration_s() < out.duration_s()) std::swap(other_, out);
    found = true;
  }
  acceleration_share_ = 1.0;
  return found;
}

// Accelerations that are exceeded are lowered where they come from, and the window is made longer
// until rates are not exceeded.
bool TimeLaw::average_until_within(TimedPath& out) {
  double window_s = least_window_s;
  for (int i = 0; i < averages_max && window_s <= longest_window_s; ++i) {
    if (!pass(trial_, 0.0)) return false;
    average(trial_, window_s, window_intervals, out);
    evaluate(out.curve, out.place, true, averaged_);
    evaluate_between(out);
    lowered_ = VectorXd::Ones(shares_.size());
    Used most;
    for (Index k = 0; k + 1 < out.nodes(); ++k) {
      Used at = used(out, k, averaged_);
      at.values /= averaged_share;
      most = {std::max(most.values, at.values), std::max(most.rates, at.rates),
              std::max(most.ramp, at.ramp)};
      // rates grow with the third power of the speed, and accelerations with its square
      const double excess =
          at.ramp > ramp_share ? at.values : std::max(at.values, std::pow(at.rates, 2.0 / 3));
      if (excess > 1.0) lower_shares(out, k, window_s, corrected / excess);
    }
    if (std::max(most.values, most.rates) <= 1.0) {
      store(averaged_, out);
      return true;
    }
    shares_ = shares_.cwiseProduct(lowered_);
    if (most.ramp > ramp_share) window_s *= most.ramp / (corrected * ramp_share);
  }
  cause_ = "the bounds of jerk and torque rate leave no motion";
  return false;
}

void TimeLaw::lower_shares(const TimedPath& averaged, Index interval, double window_s,
                           double factor) {
  const double from = averaged.time_s[interval] - window_s, to = averaged.time_s[interval + 1];
  for (Index k = 0; k + 1 < trial_.nodes() && trial_.time_s[k] <= to; ++k)
    if (trial_.time_s[k + 1] >= from) lowered_[k] = std::min(lowered_[k], factor);
}

void TimeLaw::evaluate_between(const TimedPath& motion) {
  const Index n = motion.nodes() - 1;
  VectorXd places(n);
  for (Index k = 0; k < n; ++k) {
    const double h = 0.5 * (motion.time_s[k + 1] - motion.time_s[k]);
    places[k] = motion.place[k] +
                h * (motion.speed[k] + h * (0.5 * motion.rate[k] + h * motion.ramp[k] / 6.0));
  }
  if (!limits_.have_rates()) places = 0.5 * (motion.place.head(n) + motion.place.tail(n));
  evaluate(motion.curve, places, true, between_);
}

// docs/theory.md (19.9): at the ends and in the middle of an interval, with what a parabola through
// three points may rise between them.
TimeLaw::Used TimeLaw::used(const TimedPath& motion, Index i, const Rows& nodes) const {
  Used out;
  const double h = motion.time_s[i + 1] - motion.time_s[i], r = motion.ramp[i], u0 = motion.rate[i],
               u1 = u0 + 0.5 * h * r, u2 = u0 + h * r, x0 = motion.speed[i] * motion.speed[i],
               x2 = motion.speed[i + 1] * motion.speed[i + 1],
               w1 = motion.speed[i] + 0.5 * h * (u0 + 0.25 * h * r),
               x1 = limits_.have_rates() ? w1 * w1 : 0.5 * (x0 + x2);
  const auto raise = [](double& most, double value, const VectorXd& limit, Index j) {
    if (limit.size() > 0) most = std::max(most, value / limit[j]);
  };
  for (Index j = 0; j < model_.dof(); ++j) {
    const double a0 = nodes.tangent(j, i) * u0 + nodes.curvature(j, i) * x0,
                 a1 = between_.tangent(j, i) * u1 + between_.curvature(j, i) * x1,
                 a2 = nodes.tangent(j, i + 1) * u2 + nodes.curvature(j, i + 1) * x2,
                 t0 = nodes.inertia(j, i) * u0 + nodes.bias(j, i) * x0 + nodes.gravity(j, i),
                 t1 = between_.inertia(j, i) * u1 + between_.bias(j, i) * x1 +
                      between_.gravity(j, i),
                 t2 = nodes.inertia(j, i + 1) * u2 + nodes.bias(j, i + 1) * x2 +
                      nodes.gravity(j, i + 1);
    raise(out.values, largest_value(a0, a1, a2), limits_.acceleration, j);
    raise(out.values, largest_value(t0, t1, t2), limits_.torque, j);
    raise(out.values, std::abs(between_.tangent(j, i)) * std::sqrt(x1), limits_.velocity, j);
    raise(out.values, std::abs(nodes.tangent(j, i)) * motion.speed[i], limits_.velocity, j);
    raise(out.rates, largest_slope(a0, a1, a2, h), limits_.jerk, j);
    raise(out.rates, largest_slope(t0, t1, t2, h), limits_.torque_rate, j);
    raise(out.ramp, std::abs(r * between_.tangent(j, i)), limits_.jerk, j);
    raise(out.ramp, std::abs(r * between_.inertia(j, i)), limits_.torque_rate, j);
  }
  if (between_.tip.size() > 0)
    out.values = std::max({out.values, between_.tip[i] * std::sqrt(x1) / limits_.tip_speed,
                           nodes.tip[i] * motion.speed[i] / limits_.tip_speed});
  return out;
}

void TimeLaw::store(const Rows& nodes, TimedPath& out) {
  out.inertia = nodes.inertia;
  out.bias = nodes.bias;
  out.gravity = nodes.gravity;
  out.tangent = nodes.tangent;
  out.curvature = nodes.curvature;
}

}  // namespace hamelin::timing
