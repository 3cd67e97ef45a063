#include "hamelin/optimal/optimize.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/optimal/world_clearance.hpp"
#include "refuse.hpp"
#include "transcription.hpp"

namespace hamelin::optimal {

namespace {

constexpr int solutions_max = 16;
constexpr double decimetre = 0.1;
constexpr double first_reserve_m = 2e-4;     // of the margin
constexpr double coarse_shortfall_m = 5e-4;  // of the margin: the places of clearance are too few

constexpr int slower_max = 3;             // times that a motion is slowed down
constexpr double least_shortfall = 1e-6;  // of a proof that fails, in decimetres

// Excesses of torques are shares of their limits.
constexpr double coarse_excess = 0.3;   // the knots are too few
constexpr double useless_excess = 1.0;  // the motion is no start for one with more knots
constexpr double small_excess = 0.02;   // may come from a knot beside the one where it is
constexpr double most_reserve_share = 0.9, least_reserve_share = 2e-4;
constexpr int fine_intervals = 48, finest_intervals = 400;

// The control points of the same motion with twice as many intervals: knot insertion of the uniform
// cubic B-spline (18.2).
MatrixXd with_twice_the_intervals(const MatrixXd& control) {
  MatrixXd out(control.rows(), 2 * control.cols() - 3);
  for (Index i = 0; i < out.cols(); ++i) {
    const Index k = i / 2;
    if (i % 2 == 0)
      out.col(i) = 0.5 * (control.col(k) + control.col(k + 1));
    else
      out.col(i) = 0.125 * (control.col(k) + 6.0 * control.col(k + 1) + control.col(k + 2));
  }
  return out;
}

// The torques along a motion as shares of their limits.
struct TorqueShares {
  double largest = 0.0, time_s = 0.0;  // and where it is
  Index joint = 0;
  MatrixXd by_knot;  // dof × (N + 1), the largest in the intervals around each knot
  // Factor of the duration with which they are kept, if the motion is otherwise the same: 1 or
  // more, infinite if there is none.
  double slower = 1.0;
};

// docs/theory.md (18.21)
double slower_for(double torque, double holding, double limit) {
  const double room = torque > 0.0 ? limit - holding : limit + holding;
  return room > 0.0 ? std::sqrt(std::abs(torque - holding) / room) : infinity;
}

TorqueShares torque_shares(const Problem& problem, const TimedMotion& motion) {
  const VectorXd& limit = problem.limits.torque;
  TorqueShares out;
  out.by_knot = MatrixXd::Zero(limit.size(), motion.intervals() + 1);
  if (limit.size() == 0) return out;
  dynamics::Workspace ws(*problem.model);
  VectorXd torque(limit.size()), holding(limit.size()), q, v, a;
  constexpr Index per_interval = 16;
  for (Index i = 0; i <= per_interval * motion.intervals(); ++i) {
    const double time = motion.step_s * static_cast<double>(i) / static_cast<double>(per_interval);
    motion.at(time, q, v, a);
    dynamics::inverse_dynamics(*problem.model, ws, q, v, a, torque);
    if ((torque.cwiseAbs().array() > limit.array()).any())
      dynamics::gravity_torque(*problem.model, ws, q, holding);
    const Index before = i / per_interval, after = (i + per_interval - 1) / per_interval;
    for (Index j = 0; j < limit.size(); ++j) {
      const double given = std::abs(torque[j]) / limit[j],
                   share = std::isnan(given) ? infinity : given;
      for (const Index k : {before, after}) out.by_knot(j, k) = std::max(out.by_knot(j, k), share);
      if (share > 1.0)
        out.slower = std::max(out.slower, slower_for(torque[j], holding[j], limit[j]));
      if (share > out.largest) out.largest = share, out.time_s = time, out.joint = j;
    }
  }
  return out;
}

MatrixXd inner_points(const MatrixXd& control) {
  return control.middleCols(1, control.cols() - 2);
}

// A motion as a point of the program without clearance.
class Rows {
 public:
  Rows(const Problem& asked, int intervals, const TimedMotion& motion)
      : problem_(without_clearance(asked, intervals, motion.duration_s())), program_(problem_) {
    (void)program_.evaluate(program_.variables_of(inner_points(motion.control)));
  }
  [[nodiscard]] double violation(std::string* what = nullptr) const {
    return program_.violation(what);
  }
  [[nodiscard]] double cost() const { return program_.cost(); }
  [[nodiscard]] const MatrixXd& torques() const { return program_.torques(); }

 private:
  static Problem without_clearance(Problem problem, int intervals, double duration_s) {
    problem.intervals = intervals;
    problem.duration_s = duration_s;
    problem.clearance = nullptr;
    return problem;
  }
  Problem problem_;
  Transcription program_;
};

// Solves a problem, and again with tighter bounds or more knots until the motion keeps what was
// asked for at all times, docs/theory.md (18.19).
class Refinement {
 public:
  Refinement(const Problem& asked, const MatrixXd& way_points, control::WorldView& view,
             const SolveOptions& options)
      : asked_(asked),
        way_points_(way_points),
        view_(view),
        problem_(asked),
        options_(options),
        guess_(guess_along(way_points, asked.intervals)) {
    if (problem_.clearance != nullptr) problem_.reserve_m += first_reserve_m;
  }

  Optimized run() {
    Optimized best = attempt();
    int iterations = best.iterations;
    Optimized last = best;
    for (int i = 1; i < solutions_max && !done(last) && refine(last); ++i) {
      last = attempt();
      iterations += last.iterations;
      if (last.solution.violation < best.solution.violation) best = last;
    }
    best.iterations = iterations;
    return best;
  }

 private:
  [[nodiscard]] bool done(const Optimized& found) const {
    return found.solution.violation <= options_.tolerance || !found.motion.well_formed() ||
           (options_.stop && options_.stop());
  }

  Optimized attempt() {
    Optimized out;
    out.solution = solve(problem_, guess_, options_);
    out.iterations = out.solution.iterations;
    solved_ = out.solution.violation <= options_.no_violation();
    out.motion = {out.solution.step_s, out.solution.control};
    out.clearance_points = problem_.clearance_points;
    if (!out.motion.well_formed()) return out;
    shares_ = torque_shares(asked_, out.motion);
    for (int i = 0; i < slower_max && slow_down(out); ++i)
      shares_ = torque_shares(asked_, out.motion);
    out.torque_share = shares_.largest;
    out.proof = prove(out.motion, view_, {asked_.margin_m, asked_.begin_s});
    judge(out);
    return out;
  }

  // Violations of rates and torques that are small cost less time this way than another solution
  // takes to find. False if that is not so.
  bool slow_down(Optimized& out) const {
    if (options_.cost_tolerance <= 0.0 || asked_.objective != Objective::time ||
        !asked_.v_start.isZero(0.0) || !asked_.v_goal.isZero(0.0))
      return false;
    const double violation = rows_of(out).violation(),
                 factor = std::max(shares_.slower, 1.0 + violation);
    if (violation <= options_.tolerance && shares_.largest <= 1.0) return false;
    if (!(factor <= 1.0 + options_.cost_tolerance)) return false;
    out.motion.step_s *= factor + options_.tolerance;
    return true;
  }

  // What was asked for at the knots, without clearance, which the proof examines.
  [[nodiscard]] Rows rows_of(const Optimized& out) const {
    return {asked_, problem_.intervals, out.motion};
  }

  // The violation of what was asked for, at the knots and between them.
  void judge(Optimized& out) const {
    const Rows rows = rows_of(out);
    Solution& s = out.solution;
    s.violated.clear();
    s.violation = rows.violation(&s.violated);
    s.cost = rows.cost();
    s.torque = rows.torques();
    s.step_s = out.motion.step_s;
    const auto add = [&](double violation, const std::string& what) {
      if (violation <= s.violation) return;
      s.violation = violation;
      s.violated = what;
    };
    add(shares_.largest - 1.0, fmt::format("torque of joint {} at {:.4g} s, {:.4g} of its limit",
                                           shares_.joint + 1, shares_.time_s, shares_.largest));
    if (!out.proof.certified)
      add(std::max(least_shortfall, (asked_.margin_m - out.proof.margin_m) / decimetre),
          out.proof.margin_m > 0.0
              ? fmt::format("clearance, {:.6g} m proved, expected the margin {:.6g} m",
                            out.proof.margin_m, asked_.margin_m)
              : fmt::format("clearance, not proved from {:.4g} s on, expected the margin {:.6g} m",
                            out.proof.first_open_s, asked_.margin_m));
    if (s.violation <= options_.tolerance) s.violated.clear();
  }

  // Makes the next problem. False if there is none that might help.
  bool refine(const Optimized& found) {
    const double excess = shares_.largest - 1.0;
    const bool coarse = excess > coarse_excess && 2 * problem_.intervals <= finest_intervals,
               first = problem_.intervals == asked_.intervals;
    // without a motion at the knots, more of them help only where torques are what is violated
    if (!solved_ && first && !(coarse && asked_.objective == Objective::time)) return false;
    if (!found.proof.certified && !reserve_clearance(found.proof)) return false;
    problem_.duration_s = found.motion.duration_s();
    options_.near_solution = true;
    guess_ = inner_points(found.motion.control);
    if (coarse)
      add_knots(found.motion, excess);
    else if (excess > 0.0)
      reserve_torques();
    return true;
  }

  // The torques at the knots differ from those along the motion by O(h²).
  void add_knots(const TimedMotion& motion, double excess) {
    problem_.torque_reserve.resize(0, 0);
    problem_.intervals *= 2;
    guess_ = inner_points(with_twice_the_intervals(motion.control));
    if (excess <= useless_excess) return;
    while (problem_.intervals < fine_intervals) problem_.intervals *= 2;
    guess_ = guess_along(way_points_, problem_.intervals);
    problem_.duration_s *= problem_.objective == Objective::time ? 1.5 : 1.0;
    options_.near_solution = false;
  }

  // Lowers the bounds where a torque exceeds its limit, but at the ends no farther than halfway to
  // what holds the arm there.
  void reserve_torques() {
    const VectorXd& limit = asked_.limits.torque;
    MatrixXd& reserve = problem_.torque_reserve;
    const Index N = problem_.intervals;
    if (reserve.size() == 0) reserve = MatrixXd::Zero(limit.size(), N + 1);
    MatrixXd most = most_reserve_share * limit.replicate(1, N + 1);
    most.col(0) = most.col(0).cwiseMin(0.5 * (limit - holding_torque(asked_.q_start)));
    most.col(N) = most.col(N).cwiseMin(0.5 * (limit - holding_torque(asked_.q_goal)));
    for (Index j = 0; j < limit.size(); ++j) {
      const double largest = shares_.by_knot.row(j).maxCoeff() - 1.0;
      for (Index k = 0; k <= N && largest > 0.0; ++k) {
        const double excess = largest <= small_excess ? largest : shares_.by_knot(j, k) - 1.0;
        if (excess > 0.0)
          reserve(j, k) =
              std::min(most(j, k), reserve(j, k) + (1.2 * excess + least_reserve_share) * limit[j]);
      }
    }
  }

  [[nodiscard]] VectorXd holding_torque(const VectorXd& q) const {
    dynamics::Workspace ws(*asked_.model);
    VectorXd out(q.size());
    dynamics::gravity_torque(*asked_.model, ws, q, out);
    return out.cwiseAbs();
  }

  bool reserve_clearance(const MotionProof& proof) {
    if (problem_.clearance == nullptr) return false;
    const double shortfall = asked_.margin_m - proof.margin_m;
    if (shortfall <= coarse_shortfall_m)
      problem_.reserve_m += 1.5 * shortfall + 2e-5;
    else if (2 * problem_.clearance_points <= clearance_points_max)
      problem_.clearance_points *= 2;
    else
      return false;
    return true;
  }

  const Problem& asked_;
  const MatrixXd& way_points_;
  control::WorldView& view_;
  Problem problem_;  // with more knots and tighter bounds
  SolveOptions options_;
  MatrixXd guess_;
  bool solved_ = false;  // whether the last solution keeps the bounds of problem_
  TorqueShares shares_;  // of the last motion
};

}  // namespace

Optimized optimize(const Problem& problem, const MatrixXd& way_points, control::WorldView& view,
                   const SolveOptions& options) {
  check(problem);
  if (way_points.rows() != problem.model->dof())
    refuse(fmt::format("way-points: {} numbers given each, expected {} (one per joint)",
                       way_points.rows(), problem.model->dof()));
  Problem asked = problem;
  WorldClearance clearance(*problem.model, view);
  if (clearance.rows() > 0) asked.clearance = &clearance;
  return Refinement(asked, way_points, view, options).run();
}

}  // namespace hamelin::optimal
