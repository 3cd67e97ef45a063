#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "cost_to_go.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "params_schema.hpp"
#include "rollout_pool.hpp"
#include "spline.hpp"
#include "tip_path.hpp"
#include "tracker.hpp"
#include "tuning.hpp"
#include "weights.hpp"

namespace hamelin::mppi {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double velocity_share = 0.98;  // of the velocity limits
// Kept from position limits by plans; motors let the arm stray [rad or m].
constexpr double limit_reserve = 1e-3, limit_reserve_sampled = 0.02;
// Least clearances, also at tight goals; motors that act late, with friction and noise, let the arm
// come about a millimetre nearer [m].
constexpr double least_m = 0.001, least_sampled_m = 0.003;
constexpr double beyond_shield_m = 0.002;
constexpr double beside_path_m = 0.002;  // of a path's margin, left to plans beside it
// A joint that strays farther from its planned motion is not followed but planned for from where it
// is [rad or m].
constexpr double stray = 0.03;
constexpr double stray_of_stop = 0.003;   // the same if a shield has stopped the arm in this period
constexpr double reach = 2.0;             // stretch of the path that a rollout may join [rad or m]
constexpr double noise_fade = 1.0;        // length to go below which the noise is less [rad or m]
constexpr double least_noise = 0.15;      // share of the noise that remains where obstacles move
constexpr double progress = 0.02;         // length that counts as progress [rad or m]
constexpr double mover_patience_s = 3.0;  // least time until a stall where obstacles move
constexpr double at_goal = 0.01;          // length to go at which nothing counts as a stall
constexpr int posture_attempts = 20;      // of inverse kinematics without a path
constexpr std::size_t candidate_count = 4;

class Mppi final : public planning::Planner {
 public:
  static constexpr std::uint32_t properties = HAMELIN_TICK_ALLOCATES | HAMELIN_USES_THREADS |
                                              HAMELIN_FOLLOWS_PATHS | HAMELIN_ASKS_FOR_PATHS;

  Mppi(const planning::Host& host, const planning::Setup& setup, const Json& params)
      : host_(host),
        setup_(setup),
        initial_params_(params),
        tuning_(params),
        model_(setup.model()),
        ws_(model_),
        ticks_per_plan_(std::max(
            1L, std::lround(params["plan_period_s"].get<double>() / setup.control_period_s()))),
        spacing_s_(static_cast<double>(ticks_per_plan_) * setup.control_period_s()),
        point_count_(3 + std::max(6L, std::lround(params["horizon_s"].get<double>() / spacing_s_))),
        box_(joint_box(setup)),
        kinematics_(model_, box_),
        task_(setup.dof(), point_count_, static_cast<Index>(setup.path_points_max()) + 1,
              make_margins(setup, params)),
        pool_(host, setup, model_, point_count_, params["samples"], params["threads"], task_),
        tracker_(setup.dof(), params["tracking_rate"], setup.control_period_s()),
        planned_(setup.dof()),
        average_(setup.dof(), point_count_),
        searches_(params["guide"] == "search"),
        recorded_rollouts_(params["record_rollouts"]),
        drawn_(setup.dof(), point_count_),
        tip_path_(static_cast<std::size_t>(point_count_)) {
    plan_ = mean_ = MatrixXd::Zero(setup.dof(), point_count_);
    target_ = torque_ = VectorXd::Zero(setup.dof());
    weights_.resize(static_cast<std::size_t>(pool_.sample_count()));
    order_.resize(weights_.size());
    task_.seed = setup.seed();
    task_.goal.q = target_;
    check_horizon();
    series_ = {host.declare_series("plan_cost", "s"), host.declare_series("mean_cost", "s"),
               host.declare_series("effective_samples", ""),
               host.declare_series("plan_clearance", "m"),
               host.declare_series("colliding_rollouts", "")};
  }
  ~Mppi() override { pool_.finish(); }

  static double influence_m(const Json& params) { return params["query_range_m"]; }

  [[nodiscard]] Tuning prepare_params(const Json& params) const {
    check_fixed_params(params, initial_params_);
    return Tuning(params);
  }
  // Workers use the task, so the next plan takes it.
  void apply_params(const Tuning& tuning) { tuning_ = tuning; }

  void reset(const planning::ConstVectorMap&, const planning::ConstVectorMap&) {
    pool_.finish();
    waits_ = started_ = false;
    task_.plan = 0;
    known_goal_ = false;
    figures_ = {};
  }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    if (started_) evaluate(plan_, 0, place_in_plan(), spacing_s_, planned_);
    if (const auto sent = tick.torque(); sent && started_) stopped_ |= *sent != torque_;
    const bool period_ends = ticks_ == ticks_per_plan_;
    if (!started_ || strays(tick.q(), stray) ||
        (period_ends && stopped_ && strays(tick.q(), stray_of_stop))) {
      restart(tick);
    } else if (period_ends) {
      finish_plan();
      begin_plan(tick);
    }
    pool_.share(static_cast<double>(ticks_ + 1) / static_cast<double>(ticks_per_plan_));
    evaluate(plan_, 0, place_in_plan(), spacing_s_, planned_);
    tracker_.torque(model_, ws_, tick.q(), tick.v(), planned_, setup_.effort_max(), torque_);
    command.held_torque() = torque_;
    ++ticks_;
    // The planner detects stalls itself, and gives up where it is refused another path.
    if (searches_) command.disable_stall_rule();
    if (gives_up_) command.give_up("no way: no path was found on which the arm made progress");
    for (std::size_t i = 0; i < series_.size(); ++i) command.set_series(series_[i], figures_[i]);
  }

 private:
  enum Figure { plan_cost, mean_cost, effective_samples, plan_clearance, colliding };

  static double least_full_margin(const planning::Setup& setup) {
    return std::max(setup.shield_margin_m(), setup.shield_self_margin_m()) + beyond_shield_m;
  }
  static double full_margin(const planning::Setup& setup, const Json& params) {
    return std::max(params["margin_m"].get<double>(), least_full_margin(setup));
  }
  static Margins make_margins(const planning::Setup& setup, const Json& params) {
    return {setup.dof(), full_margin(setup, params), setup.sampled() ? least_sampled_m : least_m,
            params["goal_margin_m"], params["clearance_range_m"]};
  }
  // Where a path could not keep the full margin, plans cannot either.
  void set_full_margin(const hamelin_goal& goal) {
    const double of_path =
        HAMELIN_HAS_FIELD(&goal, hamelin_goal, path_margin_m) ? goal.path_margin_m : 0.0;
    const double full = full_margin(setup_, initial_params_);
    task_.margins.set_full(
        of_path > 0.0 ? std::min(full, std::max(least_full_margin(setup_), of_path - beside_path_m))
                      : full);
  }
  static double reserve(const planning::Setup& setup) {
    return setup.sampled() ? limit_reserve_sampled : limit_reserve;
  }
  static dynamics::JointBox joint_box(const planning::Setup& setup) {
    const auto limits = [](const auto& of) { return of ? VectorXd(*of) : VectorXd(); };
    return {setup.dof(), limits(setup.q_lower()), limits(setup.q_upper()), reserve(setup)};
  }

  void check_horizon() const {
    const double rest_s = static_cast<double>(point_count_ - 6) * spacing_s_;
    if (tuning_.cruise_speed > rest_s * tuning_.acceleration_max)
      throw Error(ErrorCode::invalid,
                  "params: /horizon_s: the arm cannot brake within the horizon, expected "
                  "horizon_s - 3 plan_period_s >= cruise_speed/acceleration_max");
  }

  [[nodiscard]] bool strays(const planning::ConstVectorMap& q, double limit) const {
    return (planned_.q - q).lpNorm<Eigen::Infinity>() > limit;
  }
  [[nodiscard]] double place_in_plan() const {
    return static_cast<double>(ticks_) / static_cast<double>(ticks_per_plan_);
  }

  // Plans from the measured state: at the start, and where the arm was kept from its plan.
  void restart(const planning::Tick& tick) {
    pool_.finish();
    set_limits(tick.speed_scale());
    JointState& state = planned_;
    state.q = tick.q();
    state.v = tick.v();
    state.a.setZero();
    set_start(state, spacing_s_, plan_);
    Sampler::brake(task_.limits, plan_);
    task_.best = plan_;
    tracker_.reset();
    started_ = true;
    begin_plan(tick);
  }

  void set_limits(double speed_scale) {
    auto& limits = task_.limits;
    const int n = setup_.dof();
    limits.speed = VectorXd::Constant(n, tuning_.cruise_speed);
    if (const auto velocity_max = setup_.velocity_max())
      limits.speed = limits.speed.cwiseMin(velocity_share * *velocity_max);
    limits.speed *= spacing_s_ * speed_scale;
    limits.change = VectorXd::Constant(n, tuning_.acceleration_max * spacing_s_ * spacing_s_);
    constexpr double unlimited = 1e9;
    limits.lower = VectorXd::Constant(n, -unlimited);
    limits.upper = -limits.lower;
    if (const auto lower = setup_.q_lower())
      limits.lower = (lower->array() + reserve(setup_)).max(-unlimited);
    if (const auto upper = setup_.q_upper())
      limits.upper = (upper->array() - reserve(setup_)).min(unlimited);
    if (!known_goal_ || task_.goal.type != HAMELIN_GOAL_JOINT) return;
    limits.lower = limits.lower.cwiseMin(task_.goal.q);
    limits.upper = limits.upper.cwiseMax(task_.goal.q);
  }

  // The plan that begins one period from now, from where the present one will be then.
  void begin_plan(const planning::Tick& tick) {
    ticks_ = 0;
    stopped_ = false;
    pool_.refresh();
    set_limits(tick.speed_scale());
    task_.cost = tuning_.cost;
    task_.spacing_s = spacing_s_;
    task_.cruise_speed = tuning_.cruise_speed;
    task_.moving = tick.moving_count() > 0;
    ++task_.plan;
    shift(plan_, task_.mean);
    shift(MatrixXd(task_.best), task_.best);
    task_.best.leftCols<3>() = task_.mean.leftCols<3>();
    evaluate(task_.mean, 0, 0.0, spacing_s_, planned_);
    if (!known_goal_ || goal_number_ != tick.goal_number()) set_goal(tick);
    measure_start();
    check_progress(tick.time_s());
    // An arm that comes to rest where it waits, and where nothing moves, needs no rollouts.
    rolls_ = !waits_ || task_.moving || (task_.mean.rightCols<1>() - target_).norm() > at_goal;
    if (rolls_) pool_.start();
  }

  static void shift(const MatrixXd& from, MatrixXd& to) {
    const Index n = from.cols();
    to.leftCols(n - 1) = from.rightCols(n - 1);
    to.col(n - 1) = from.col(n - 1);
  }

  void set_goal(const planning::Tick& tick) {
    const hamelin_goal& from = tick.goal();
    Goal& goal = task_.goal;
    goal.type = from.type;
    if (from.type == HAMELIN_GOAL_JOINT) goal.q = planning::ConstVectorMap(from.q, setup_.dof());
    goal.position = planning::vec3(from.position_world_m);
    const auto& w = from.quaternion_wxyz;
    if (from.type == HAMELIN_GOAL_POSE)
      goal.rotation = Eigen::Quaterniond(w[0], w[1], w[2], w[3]).normalized().toRotationMatrix();
    goal.tolerance_m = from.tolerance_m;
    goal.tolerance_rad = from.tolerance_rad;
    goal_number_ = tick.goal_number();
    known_goal_ = true;
    gives_up_ = false;
    waits_ = false;
    task_.tip_cost = false;
    set_full_margin(from);
    const auto way_points = setup_.path(from);
    if (way_points.cols() > 1) return follow_way_points(way_points);
    const std::int32_t path_search = HAMELIN_HAS_FIELD(&from, hamelin_goal, path_search)
                                         ? from.path_search
                                         : HAMELIN_PATH_NOT_SOUGHT;
    if (searches_ && path_search == HAMELIN_PATH_NOT_SOUGHT && ask()) return;
    head_straight();
    waits_ = path_search == HAMELIN_PATH_SOUGHT;
  }

  // The arm comes to rest at the end of its plan until it is shown where to wait for the path.
  // @return whether there will be one
  bool ask() {
    if (!host_.request_path()) return false;
    waits_ = true;
    target_ = task_.mean.rightCols<1>();
    task_.tip_cost = false;
    head_for_target();
    return true;
  }

  template <class Points>
  void follow_way_points(const Points& way_points) {
    task_.path.clear();
    task_.path.add(planned_.q);
    for (Index i = 0; i < way_points.cols(); ++i) task_.path.add(way_points.col(i));
    begin_path(task_.goal.q);
  }

  // Without a path: straight to the goal, or to the nearest posture with the tip at it.
  void head_straight() {
    target_ = task_.mean.rightCols<1>();
    if (task_.goal.type == HAMELIN_GOAL_JOINT)
      target_ = task_.goal.q;
    else
      find_posture();
    task_.tip_cost = task_.goal.type != HAMELIN_GOAL_JOINT;
    head_for_target();
  }

  void head_for_target() {
    task_.path.clear();
    task_.path.add(target_);
    begin_path(target_);
  }

  void find_posture() {
    Rng rng(setup_.seed() + goal_number_);
    double least = std::numeric_limits<double>::infinity();
    VectorXd q = target_;
    for (int i = 0; i < posture_attempts; ++i) {
      if (kinematics_.solve(tip_target(task_.goal), q)) {
        const double distance = (q - task_.mean.rightCols<1>()).norm();
        if (distance < least) least = distance, target_ = q;
      }
      box_.draw(rng, q);
    }
  }

  [[nodiscard]] std::span<const double> span_of(const VectorXd& q) const {
    return {q.data(), static_cast<std::size_t>(q.size())};
  }

  void begin_path(const VectorXd& end) {
    task_.margins.set_goal(end, pool_.evaluator().query().clearance(span_of(end)));
    task_.path_from = 0.0;
    least_left_ = std::numeric_limits<double>::infinity();
  }

  // Where the next plan starts, on the path and with what clearance.
  void measure_start() {
    task_.start_clearance_m = pool_.evaluator().query().clearance(span_of(planned_.q), spacing_s_);
    task_.margins.set_start(planned_.q, task_.start_clearance_m);
    const auto place = cost_to_go(task_.path, planned_.q, task_.path_from, task_.path_from + reach);
    left_ = place.cost;
    task_.path_from = place.s;
    task_.path_to = place.s + reach;
    double share = std::min(1.0, left_ / noise_fade);
    if (task_.moving) share = std::max(share, least_noise);
    task_.noise = share * tuning_.noise;
  }

  // After a stall the planner asks for another path. What moves is given time to leave.
  void check_progress(double time_s) {
    const bool advances = left_ < at_goal || left_ < least_left_ - progress;
    if (waits_ || advances) {
      least_left_ = std::min(left_, least_left_);
      progress_s_ = time_s;
      return;
    }
    double patience_s = tuning_.stall_time_s;
    if (task_.moving) patience_s = std::max(patience_s, mover_patience_s);
    if (!searches_ || gives_up_ || time_s - progress_s_ < patience_s) return;
    gives_up_ = !ask();
    if (!gives_up_) measure_start();
  }

  // docs/theory.md (15.12), (15.13)
  void finish_plan() {
    pool_.finish();
    if (!rolls_) {
      plan_ = task_.best = task_.mean;
      return;
    }
    const Index count = pool_.sample_count();
    double collisions = 0.0;
    for (Index i = 0; i < count; ++i) {
      weights_[static_cast<std::size_t>(i)] = pool_.cost(i);
      order_[static_cast<std::size_t>(i)] = i;
      collisions += pool_.collides(i) ? 1.0 : 0.0;
    }
    const auto ranked = static_cast<std::ptrdiff_t>(
        std::min(order_.size(), std::max(candidate_count, recorded_rollouts_)));
    std::partial_sort(order_.begin(), order_.begin() + ranked, order_.end(), [&](Index a, Index b) {
      return pool_.cost(a) < pool_.cost(b) || (pool_.cost(a) == pool_.cost(b) && a < b);
    });
    draw_rollouts();
    figures_[effective_samples] = weights_of_costs(weights_, tuning_.temperature_s);
    figures_[colliding] = collisions;
    average();
    choose();
    pool_.get_points(order_.front(), task_.best);
  }

  // The paths of the tip in the best rollouts.
  void draw_rollouts() {
    for (std::size_t i = 0; i < std::min(recorded_rollouts_, order_.size()); ++i) {
      pool_.get_points(order_[i], drawn_);
      const Index count = tip_path(model_, ws_, drawn_, tip_path_);
      host_.draw_path(std::span(tip_path_).first(static_cast<std::size_t>(count)));
    }
  }

  // The weighted mean of all rollouts keeps their limits, because these are convex.
  void average() {
    mean_.setZero();
    Index sample = 0;
    for (const auto& block : pool_.blocks())
      for (Index lane = 0; lane < lane_count; ++lane, ++sample) {
        const double w = weights_[static_cast<std::size_t>(sample)];
        if (w < 1e-12) continue;
        for (Index j = 0; j < mean_.rows(); ++j)
          for (Index i = 0; i < point_count_; ++i) mean_(j, i) += w * block.point(j, i)[lane];
      }
    mean_.leftCols<3>() = task_.mean.leftCols<3>();
    mean_.col(point_count_ - 2) = mean_.col(point_count_ - 1) = mean_.col(point_count_ - 3);
  }

  // The mean, or a rollout that costs less, the first that is proved clear. Without any, the arm
  // keeps to the plan before, which ends at rest, or brakes if that costs less. Where obstacles
  // move the plan before may not be clear any more, and the arm takes what costs least.
  void choose() {
    average_.set_lane(0, mean_);
    pool_.evaluator().begin(task_, average_);
    pool_.evaluator().evaluate(task_, average_, 0);
    figures_[mean_cost] = average_.cost[0];
    bool mean_tried = false;
    for (std::size_t i = 0; i < candidate_count; ++i) {
      const Index sample = order_[i];
      if (!mean_tried && average_.cost[0] <= pool_.cost(sample)) {
        mean_tried = true;
        if (accept(mean_, average_.cost[0], average_.clearance_m[0])) return;
      }
      pool_.get_points(sample, plan_);
      if (accept(plan_, pool_.cost(sample), pool_.clearance_m(sample))) return;
    }
    Index otherwise = pool_.cost(Sampler::proposal_brake) < pool_.cost(Sampler::proposal_mean)
                          ? Sampler::proposal_brake
                          : Sampler::proposal_mean;
    if (task_.moving) otherwise = order_.front();
    pool_.get_points(otherwise, plan_);
    set_figures(pool_.cost(otherwise), pool_.clearance_m(otherwise));
  }

  bool accept(const MatrixXd& points, double cost, double clearance_m) {
    if (!pool_.evaluator().verify(task_, points)) return false;
    if (&points != &plan_) plan_ = points;
    set_figures(cost, clearance_m);
    return true;
  }

  void set_figures(double cost, double clearance_m) {
    figures_[plan_cost] = cost;
    figures_[plan_clearance] = clearance_m;
  }

  planning::Host host_;
  planning::Setup setup_;
  Json initial_params_;
  Tuning tuning_;
  model::Model model_;
  dynamics::Workspace ws_;
  long ticks_per_plan_, ticks_ = 0;
  double spacing_s_;
  Index point_count_;
  dynamics::JointBox box_;
  dynamics::InverseKinematics kinematics_;
  Task task_;
  RolloutPool pool_;
  Tracker tracker_;
  JointState planned_;
  Rollouts average_;
  bool searches_;       ///< whether it asks for paths
  bool waits_ = false;  ///< for a path
  bool started_ = false, stopped_ = false, gives_up_ = false, known_goal_ = false, rolls_ = false;
  std::uint64_t goal_number_ = 0;
  double left_ = 0.0, least_left_ = 0.0, progress_s_ = 0.0;  ///< lengths to go, and since when
  MatrixXd plan_, mean_;  ///< control points of the motion in execution, and of the average
  VectorXd target_, torque_;
  std::vector<double> weights_;
  std::vector<Index> order_;
  std::size_t recorded_rollouts_;
  MatrixXd drawn_;
  std::vector<Eigen::Vector3d> tip_path_;
  std::array<std::int32_t, 5> series_{};
  std::array<double, 5> figures_{};
};

}  // namespace
}  // namespace hamelin::mppi

HAMELIN_PLANNER_PLUGIN(hamelin::mppi::Mppi, "mppi", "0.1.0",
                       "Sampling model-predictive control with rollouts that end at rest",
                       params_schema);
