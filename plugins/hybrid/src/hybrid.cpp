#include <cstdint>
#include <optional>
#include <variant>

#include "courses.hpp"
#include "hamelin/planning/plugin.hpp"
#include "params_schema.hpp"
#include "shared.hpp"
#include "tuning.hpp"

namespace hamelin::hybrid {
namespace {

class Hybrid final : public planning::Planner {
 public:
  static constexpr std::uint32_t properties =
      HAMELIN_FOLLOWS_TARGETS | HAMELIN_FOLLOWS_PATHS | HAMELIN_FOLLOWS_TRAJECTORIES |
      HAMELIN_ASKS_FOR_PATHS | HAMELIN_TRUSTS_CERTIFIED_PATHS;

  Hybrid(const planning::Host& host, const planning::Setup& setup, const Json& params)
      : initial_params_(params),
        shared_(host, setup, params),
        contact_radius_(params["contact_radius_m"]) {
    // Scenes in which nothing moves need no series.
    if (host.obstacles_ahead(0.0, HAMELIN_MOVING, {}) > 0) {
      evasion_series_ = host.declare_series("evasion", "");
      clearance_series_ = host.declare_series("clearance_ahead", "m");
    }
    if (shared_.steering) turn_series_ = host.declare_series("turn", "s");
  }

  [[nodiscard]] Tuning prepare_params(const Json& params) const {
    check_fixed_params(params, initial_params_);
    return {shared_.setup, params};
  }
  void apply_params(const Tuning& tuning) {
    shared_.set_tuning(tuning);
    measure_margins_ = true;
  }

  // A new start has a new goal_number, so set_goal() forgets what belongs to the goal.
  void reset(const planning::ConstVectorMap&, const planning::ConstVectorMap&) {
    shared_.evader.reset();
    shared_.stall.forget_evasion();
  }

  static double influence_m(const Json& params) { return params["contact_radius_m"]; }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    Shared& s = shared_;
    s.drive.update(tick);
    if (s.goal == nullptr || s.goal_number != tick.goal_number()) set_goal(tick);
    if (measure_margins_) measure_margins();
    s.choose_target();
    s.evader.update(tick, s.arm(), way());

    const bool evades = s.evader.evades();
    const auto track = evades ? std::nullopt : tracking(tick);
    set_margins(track.has_value());
    const Motion motion = evades  ? Evade{}.step(s)
                          : track ? track->step(s, tick)
                                  : step_own_course(tick);
    // The law's velocity after the horizon, with bounded acceleration: docs/theory.md (10.7).
    s.drive.accelerate(s.u, motion.from_present ? s.drive.v() : s.drive.coasting_velocity(),
                       motion.gain, motion.acceleration);
    drive(motion, tick, command);
    if (track)
      s.stall.extend(tick.time_s());
    else
      check_own_course({tick.time_s(), motion.closing_speed, command});
    set_series(command);
  }

 private:
  void set_goal(const planning::Tick& tick) {
    Shared& s = shared_;
    s.goal = &tick.goal();
    s.goal_number = tick.goal_number();
    if (s.steering) s.steering->restart();
    measure_margins_ = true;
    s.clear_path();
    s.searches = s.asks;
    s.stall.begin(tick.time_s());
    course_ = s.follows() ? begin_pursuit() : begin_way(tick);
  }

  Course begin_pursuit() {
    shared_.anchor.set(*shared_.goal);
    shared_.follower.start(shared_.drive.q());
    return Pursuit{};
  }

  // Paths take what moves for what stands, so where something moves, none is asked for yet.
  Course begin_way(const planning::Tick& tick) {
    Shared& s = shared_;
    s.take_path();
    if (!s.path.empty()) return AlongPath{};
    if (s.path_search() == HAMELIN_PATH_NOT_SOUGHT && tick.moving_count() == 0 && s.request_path())
      return Wait{};
    return Straight{};
  }

  void measure_margins() {
    shared_.margins.set_goal(shared_.surroundings, *shared_.goal, contact_radius_);
    measure_margins_ = false;
  }
  // A trajectory was planned to be clear.
  void set_margins(bool tracks) {
    Shared& s = shared_;
    if (tracks)
      s.margins.set_least(s.drive.points());
    else
      s.margins.set(s.drive.points(),
                    s.law.margin_weight(s.model, s.drive.ws(), s.drive.q(), *s.goal));
  }

  // The way that the arm follows if nothing moves into it.
  [[nodiscard]] Way way() const {
    Way way{shared_.goal};
    way.goal_number = shared_.goal_number;
    if (std::holds_alternative<Wait>(course_)) {
      way.waits = true;
    } else if (!shared_.path.empty()) {
      way.path = &shared_.path;
      way.position = shared_.path_position;
      way.ahead = path_ahead;
    }
    return way;
  }

  [[nodiscard]] std::optional<Track> tracking(const planning::Tick& tick) const {
    const bool heads_for_goal =
        std::holds_alternative<Straight>(course_) || std::holds_alternative<AlongPath>(course_);
    return heads_for_goal ? Track::near_reference(shared_, tick) : std::nullopt;
  }

  Motion step_own_course(const planning::Tick& tick) {
    return std::visit([&](const auto& course) { return course.step(shared_, tick); }, course_);
  }

  void check_own_course(const TickEnd& end) {
    const Next next = std::visit([&](auto& course) { return course.check(shared_, end); }, course_);
    if (!next) return;
    course_ = *next;
    shared_.stall.begin(end.time_s);
  }

  void drive(const Motion& motion, const planning::Tick& tick, planning::Command& command) {
    Shared& s = shared_;
    s.drive.begin_filter(motion.pace, [&](const NearPoint& point) {
      if (!s.evader.moves(point.obstacle)) return motion.softness;
      return s.evader.has_rows() ? MoverRows::softness : -1.0;
    });
    if (!motion.keeps_path) s.drive.add_kept(tick.kept(), motion.pace);
    if (s.evader.active() && s.evader.has_rows())
      s.evader.add_rows(s.arm(), s.drive.coasting_velocity(), s.drive.filter());
    s.drive.apply(command);
    if (s.tuning.joint_damping > 0.0) command.damping().setConstant(s.tuning.joint_damping);
  }

  void set_series(planning::Command& command) const {
    const Shared& s = shared_;
    if (s.steering) command.set_series(turn_series_, s.steering->turn().left_s);
    if (!s.evader.active()) return;
    command.set_series(evasion_series_, static_cast<double>(s.evader.act()));
    if (const auto clearance = s.evader.clearance_ahead())
      command.set_series(clearance_series_, *clearance);
  }

  Json initial_params_;
  Shared shared_;
  Course course_;  ///< the arm's own
  std::int32_t evasion_series_ = -1, clearance_series_ = -1, turn_series_ = -1;
  double contact_radius_;
  bool measure_margins_ = true;  ///< whether goal or margins have changed
};

}  // namespace
}  // namespace hamelin::hybrid

HAMELIN_PLANNER_PLUGIN(hamelin::hybrid::Hybrid, "hybrid", "0.1.0",
                       "Attraction, steering without work and short repulsion under a safety "
                       "filter, along searched paths",
                       params_schema);
