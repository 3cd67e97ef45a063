#include "interior_point.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/numbers.hpp"

namespace hamelin::optimal {

namespace {

constexpr double least_shift = 1e-8, largest_shift = 1e12;
constexpr double gradient_max = 100.0;     // of the scaled cost at the guess
constexpr double multiplier_range = 1e10;  // of slack · multiplier / μ
constexpr int backtracks_max = 30;
constexpr double small_decrease = 0.1;    // of cost and violation, in μ
constexpr int small_decreases_max = 4;    // in a row, until the barrier is lowered
constexpr double least_share = 0.01;      // of a slack or multiplier that a step leaves
constexpr double gap_share = 0.03;        // of the duality gap: a decrease that is not worth a step
constexpr double small_violation = 0.01;  // sum over all rows, for which μ may be lowered early
constexpr double centred = 3.0;  // largest |s λ − μ| for which μ may be lowered early, in μ

// A number that is not one counts as infinite.
void grow(double& most, double x) {
  if (!(x <= most)) most = std::isnan(x) ? infinity : x;
}

}  // namespace

InteriorPoint::InteriorPoint(Transcription& program, const SolveOptions& options,
                             const Start& start)
    : program_(program),
      options_(options),
      first_slack_(start.slack),
      mu_(start.mu),
      hessian_(program.hessian_matrix()),
      lower_{1.0, program.lower()},
      upper_{-1.0, program.upper()},
      gradient_(VectorXd::Zero(program.variables())),
      row_(VectorXd::Zero(program.rows())),
      weights_(row_),
      row_step_(row_) {
  for_each_side([&](Side& side) {
    side.slack = VectorXd::Ones(program.rows());
    side.multiplier = side.residual = side.slack_step = side.multiplier_step = row_;
    for (Index r = 0; r < program.steady_rows(); ++r)
      if (side.bounds(r)) side.rows.push_back(r);
  });
  awake_.assign(static_cast<std::size_t>(program.rows() - program.steady_rows()), false);
}

// False if the program has no finite numbers at x.
bool InteriorPoint::start(VectorXd x) {
  x_ = std::move(x);
  if (!program_.evaluate(x_)) return false;
  program_.gradient(gradient_);
  scale_ = std::min(1.0, gradient_max / gradient_.lpNorm<Eigen::Infinity>());
  for (Index r = program_.steady_rows(); r < program_.rows(); ++r) {
    lower_.slack[r] = lower_.inside(program_, r);
    if (lower_.slack[r] > 0.0)
      resting_log_ += std::log(lower_.slack[r]);
    else
      awaken(r);
  }
  wake();
  for_each_side([&](Side& side) {
    for (const Index r : side.rows) {
      side.slack[r] = std::max(first_slack_, side.inside(program_, r));
      side.multiplier[r] = mu_ / side.slack[r];
    }
    for (Index r = 0; r < program_.rows(); ++r) bounds_ += side.bounds(r) ? 1.0 : 0.0;
    find_residuals(side);
  });
  first_violation_ = std::max(1.0, filter_point().violation);
  filter_.reset(first_violation_);
  return true;
}

void InteriorPoint::awaken(Index row) {
  awake_[static_cast<std::size_t>(row - program_.steady_rows())] = true;
  lower_.rows.push_back(row);
  lower_.multiplier[row] = mu_ / lower_.slack[row];
  lower_.residual[row] = lower_.slack_step[row] = lower_.multiplier_step[row] = 0.0;
}

// Rows whose distances have come below their bounds.
void InteriorPoint::wake() {
  program_.for_each_near([&](Index r) {
    if (awake_[static_cast<std::size_t>(r - program_.steady_rows())]) return;
    resting_log_ -= std::log(lower_.slack[r]);
    awaken(r);
  });
}

void InteriorPoint::rest() {
  awake_.assign(awake_.size(), false);
  const auto awake = [&](Index r) {
    return awake_[static_cast<std::size_t>(r - program_.steady_rows())];
  };
  program_.for_each_near([&](Index r) { awake(r) = true; });
  std::erase_if(lower_.rows, [&](Index r) {
    if (r < program_.steady_rows() || awake(r)) return false;
    if (lower_.slack[r] != lower_.inside(program_, r)) {
      awake(r) = true;
      return false;
    }
    resting_log_ += std::log(lower_.slack[r]);
    return true;
  });
}

void InteriorPoint::find_residuals(Side& side) const {
  for (const Index r : side.rows) side.residual[r] = side.inside(program_, r) - side.slack[r];
}

// docs/theory.md (18.9). Multipliers far above one measure stationarity, as in IPOPT.
InteriorPoint::Errors InteriorPoint::errors(double mu) {
  program_.gradient(gradient_);
  gradient_ *= scale_;
  right_ = gradient_;
  row_ = upper_.multiplier - lower_.multiplier;
  program_.for_each_entry([&](Index r, Index v, double d) { right_[v] += d * row_[r]; });
  double sum = 0.0;
  for_each_side([&](const Side& side) {
    for (const Index r : side.rows) sum += side.multiplier[r];
  });
  const double mean = sum / std::max<double>(1.0, 2.0 * static_cast<double>(program_.rows())),
               divisor = std::max(100.0, mean) / 100.0;
  // at rows that rest, slack · multiplier is the barrier's
  Errors out{right_.allFinite() ? right_.lpNorm<Eigen::Infinity>() / divisor : infinity, 0.0,
             std::abs(mu_ - mu) / divisor};
  for_each_side([&](const Side& side) {
    for (const Index r : side.rows) {
      grow(out.violation, std::abs(side.residual[r]));
      grow(out.complementarity, std::abs(side.slack[r] * side.multiplier[r] - mu) / divisor);
    }
  });
  return out;
}

// docs/theory.md (18.20)
bool InteriorPoint::cheap_enough(const Errors& now) const {
  const double cost = program_.cost(), small = options_.cost_tolerance * std::abs(cost);
  if (!(small > 0.0) || !(now.violation <= options_.no_violation()) ||
      !(std::abs(cost_before_ - cost) <= small))
    return false;
  double gap = 0.0;
  for_each_side([&](const Side& side) {
    for (const Index r : side.rows) gap += side.slack[r] * side.multiplier[r];
  });
  return gap <= scale_ * small;
}

// docs/theory.md (18.12). Where distances have kinks, stationarity may stay large although cost and
// violation decrease no more.
void InteriorPoint::lower_barrier() {
  if (!can_lower_barrier()) return;
  const Errors now = errors(mu_);
  const bool solved = now.within(10.0 * mu_),
             early = near_minimum_ && now.complementarity <= centred * mu_;
  if (!solved && !early && small_decreases_ < small_decreases_max) return;
  small_decreases_ = 0;
  near_minimum_ = false;
  mu_ = std::max(options_.tolerance / 11.0, std::min(0.2 * mu_, std::pow(mu_, 1.5)));
  filter_.reset(first_violation_);
}

// docs/theory.md (18.10), (18.11)
bool InteriorPoint::find_direction() {
  const Index rows = program_.rows();
  weights_.setZero();
  VectorXd push = VectorXd::Zero(rows);
  for_each_side([&](const Side& side) {
    for (const Index r : side.rows) {
      const double weight = side.multiplier[r] / side.slack[r];
      weights_[r] += weight;
      push[r] += side.sign * (mu_ / side.slack[r] - weight * side.residual[r]);
    }
  });
  row_ = upper_.multiplier - lower_.multiplier;
  right_ = -gradient_;
  program_.for_each_entry([&](Index r, Index v, double d) { right_[v] += d * push[r]; });
  if (!factor()) return false;
  dx_ = right_;
  hessian_.solve(dx_);
  row_step_.setZero();
  program_.for_each_entry([&](Index r, Index v, double d) { row_step_[r] += d * dx_[v]; });
  for_each_side([&](Side& side) { find_side_steps(side); });
  return dx_.allFinite();
}

// The Hessian of the Lagrangian if it is positive definite, else its part that is never negative.
bool InteriorPoint::factor() {
  program_.hessian(scale_, row_, weights_, true, hessian_);
  if (hessian_.factor(0.0)) return true;
  for (double shift = least_shift; shift < largest_shift; shift *= 100.0) {
    program_.hessian(scale_, row_, weights_, false, hessian_);
    if (hessian_.factor(shift)) return true;
  }
  return false;
}

void InteriorPoint::find_side_steps(Side& side) {
  for (const Index r : side.rows) {
    side.slack_step[r] = side.sign * row_step_[r] + side.residual[r];
    side.multiplier_step[r] = mu_ / side.slack[r] - side.multiplier[r] -
                              side.multiplier[r] / side.slack[r] * side.slack_step[r];
  }
}

double InteriorPoint::largest_step(const Side& side, const VectorXd& x, const VectorXd& dx) const {
  const double share = 1.0 - std::min(least_share, mu_);
  double step = 1.0;
  for (const Index r : side.rows)
    if (dx[r] < 0.0) step = std::min(step, -share * x[r] / dx[r]);
  return step;
}

// docs/theory.md (18.12)
Filter::Point InteriorPoint::filter_point() const {
  double barrier = resting_log_, violation = 0.0;
  for_each_side([&](const Side& side) {
    for (const Index r : side.rows) {
      barrier += std::log(side.slack[r]);
      violation += std::abs(side.residual[r]);
    }
  });
  return {violation, scale_ * program_.cost() - mu_ * barrier};
}

double InteriorPoint::barrier_slope() const {
  double slope = gradient_.dot(dx_);
  for_each_side([&](const Side& side) {
    for (const Index r : side.rows) slope -= mu_ * side.slack_step[r] / side.slack[r];
  });
  return slope;
}

// The minimum with the barrier is a number of bounds times μ above that without.
void InteriorPoint::count_small_decreases(const Filter::Point& before, const Filter::Point& now) {
  const double decrease = before.cost - now.cost;
  near_minimum_ = decrease < gap_share * bounds_ * mu_ && now.violation <= before.violation &&
                  now.violation < small_violation;
  const bool small = std::abs(decrease) < small_decrease * mu_ &&
                     before.violation - now.violation < small_decrease * mu_;
  small_decreases_ = small ? small_decreases_ + 1 : 0;
}

// Where a row is inside its bound, the slack is its distance from the bound, so that the barrier
// itself sees how the row bends; elsewhere it takes its own step.
void InteriorPoint::take_slacks(Side& side, const VectorXd& before, double step) const {
  for (const Index r : side.rows) {
    const double inside = side.inside(program_, r);
    side.slack[r] =
        inside >= least_share * before[r] ? inside : before[r] + step * side.slack_step[r];
  }
  find_residuals(side);
}

// The iterate before trials that were all rejected: the program may be at one of them, which may
// not even be a motion.
void InteriorPoint::restore(const VectorXd& x, const VectorXd& slack_l, const VectorXd& slack_u) {
  x_ = x;
  (void)program_.evaluate(x_);
  lower_.slack = slack_l;
  upper_.slack = slack_u;
  for_each_side([&](Side& side) { find_residuals(side); });
}

bool InteriorPoint::take_step() {
  const VectorXd x = x_;
  const VectorXd slack_l = lower_.slack, slack_u = upper_.slack;
  const double slope = barrier_slope();
  cost_before_ = program_.cost();
  const Filter::Point before = filter_point();
  double step = std::min(largest_step(lower_, lower_.slack, lower_.slack_step),
                         largest_step(upper_, upper_.slack, upper_.slack_step));
  bool accepted = false;
  for (int k = 0; k < backtracks_max && !accepted; ++k, step *= 0.5) {
    x_ = x + step * dx_;
    if (!program_.evaluate(x_)) continue;
    wake();
    take_slacks(lower_, slack_l, step);
    take_slacks(upper_, slack_u, step);
    const Filter::Point now = filter_point();
    accepted = filter_.accept(before, now, slope, step);
    if (accepted) count_small_decreases(before, now);
  }
  if (!accepted) restore(x, slack_l, slack_u);
  rest();
  for_each_side([&](Side& side) {
    const double share = largest_step(side, side.multiplier, side.multiplier_step);
    for (const Index r : side.rows) side.multiplier[r] += share * side.multiplier_step[r];
    keep_multipliers_near(side);
  });
  return accepted;
}

void InteriorPoint::keep_multipliers_near(Side& side) const {
  for (const Index r : side.rows)
    side.multiplier[r] = std::clamp(side.multiplier[r], mu_ / (multiplier_range * side.slack[r]),
                                    multiplier_range * mu_ / side.slack[r]);
}

Solution InteriorPoint::solve(VectorXd x) {
  Solution out;
  if (!start(std::move(x))) {
    out.cause = "a number is not finite at the guess";
    return out;
  }
  for (out.iterations = 0;; ++out.iterations) {
    const Errors now = errors(0.0);
    out.stationarity = now.stationarity;
    out.converged = now.within(options_.tolerance) || cheap_enough(now);
    if (out.converged) break;
    lower_barrier();
    if (out.iterations == options_.iterations_max) {
      out.cause = fmt::format("no solution within {} iterations", options_.iterations_max);
      break;
    }
    if (options_.stop && options_.stop()) {
      out.cause = "stopped";
      break;
    }
    if (find_direction() && take_step() && !(small_decreases_ > small_decreases_max)) continue;
    if (can_lower_barrier()) {
      small_decreases_ = small_decreases_max;
      continue;
    }
    out.cause = "no step decreases cost and violation any further";
    break;
  }
  return out;
}

}  // namespace hamelin::optimal
