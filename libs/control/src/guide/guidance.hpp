#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "guide/guide_search.hpp"
#include "hamelin/control/answer.hpp"
#include "hamelin/planning/plugin_abi.h"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// What a planner is shown in place of a goal: a joint goal with the path that a search found.
/// Until it has one, the arm holds its place; if none is found, the planner is shown the goal
/// itself. Searches begin at each goal or where the planner asks, and again where the arm stalls,
/// and where the world changes. A goal that follows a target stays what it is, and gets the path
/// besides. One thread; no allocation after construction.
class Guidance {
 public:
  /// @param points_max the largest number of way-points of a path
  /// @param follows_paths whether the planner follows paths; else it is shown their way-points one
  ///        after the other
  /// @param charges whether each check delays the answer by the scene's check_time_s
  Guidance(const scene::GuideSpec& spec, Eigen::Index dof, Eigen::Index points_max,
           bool follows_paths, bool charges);

  using Figures = GuideFigures;
  enum class News { none, path, no_path };

  /// What a tick knows.
  struct Now {
    double time_s, period_s;
    const Eigen::VectorXd& q;
    const std::shared_ptr<const std::vector<scene::Goal>>& goals;
    std::size_t goal_index;            ///< of the current one
    std::uint64_t goal_number;         ///< another one whenever the goal or the load is another one
    std::uint64_t world;               ///< number of the snapshot
    std::uint64_t allowance;           ///< what the goal may touch, see World::allow()
    const scene::MotionState* target;  ///< that a follow goal has; else null
    const CertifiedPath* in_force;     ///< along which a stop goes on; else null
    const CertifiedPath* followed;     ///< by the reference; null: none
    const ReferenceState& reference;   ///< of the last tick
    [[nodiscard]] const scene::Goal& goal() const { return (*goals)[goal_index]; }
  };
  /// To be called once per tick, before the planner. @return what has arrived
  News update(const Now& now, GuideSearch& search);
  /// The planner asks for a path. @return whether one will be searched
  [[nodiscard]] bool request();
  /// The path leads nowhere: the planner is shown the goal itself.
  void give_up_path() noexcept;
  /// The arm does not make progress. @return whether there will be another search, if there was one
  /// at this goal
  [[nodiscard]] bool stalled() { return mode_ != Mode::off && request(); }
  /// Whether the arm holds its place until a path arrives.
  [[nodiscard]] bool waits() const noexcept { return !follows() && mode_ == Mode::waiting; }
  /// What the planner is shown; null: the goal itself.
  [[nodiscard]] const hamelin_goal* goal() const noexcept {
    return !follows() && (mode_ == Mode::waiting || mode_ == Mode::guided) ? &shown_ : nullptr;
  }
  /// Adds what is known of paths to a goal that is shown as it is.
  void tell(hamelin_goal& goal) const noexcept;
  /// Counts whatever is shown.
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
  /// Where a motion that has just become the current one begins.
  [[nodiscard]] timing::TimedPath::Place beginning() const noexcept { return beginning_; }
  /// The motion along the path; null if there is none.
  [[nodiscard]] const CertifiedPath* motion() const noexcept {
    return mode_ == Mode::guided && !follows() ? motion_.get() : nullptr;
  }
  [[nodiscard]] const Figures& figures() const noexcept { return figures_; }
  /// Why the last search found none.
  [[nodiscard]] std::string_view cause() const noexcept { return cause_; }

 private:
  enum class Mode { off, waiting, guided, unguided };
  /// Whether the current goal is the one after a goal that was passed.
  [[nodiscard]] bool has_passed(const Now& now) const noexcept {
    return (passing_ || (passes_ && lead_ == LeadState::found)) &&
           now.goal_number == goal_number_ + 1 && now.goal_index == pass_goal_;
  }
  [[nodiscard]] bool follows() const noexcept { return follows_; }
  void begin(const Now& now);
  /// Whether the arm is on its way along a motion that may go on before that to another goal.
  [[nodiscard]] bool may_lead(const Now& now) const;
  /// Whether the arm is on its motion, at full rate and not at its end.
  [[nodiscard]] bool follows_motion(const Now& now) const;
  /// Whether a motion can be asked for that leads past the current goal to the next one.
  [[nodiscard]] bool may_pass(const Now& now) const;
  /// Forgets that motion where it cannot be used any more.
  void check_pass(const Now& now);
  void end_pass() noexcept;
  void take_pass(const Now& now, GuideAnswer& answer);
  void take_lead(const Now& now, GuideAnswer& answer);
  /// The motion of an answer is the next one.
  void keep_next(GuideAnswer& answer);
  /// The arm comes to rest before it goes on.
  void end_lead(const Now& now);
  News go_over(const Now& now);
  void ask(const Now& now, GuideSearch& search);
  News take(const Now& now, GuideSearch& search);
  void set_path(const Now& now, const Eigen::MatrixXd& points);
  void hold(const Now& now);
  void show(const Now& now, Eigen::Index first, Eigen::Index count);
  void show_next_point(const Now& now);
  void fill_kept(const Now& now, GuideRequest& request) const;
  /// The place of the path that is nearest to q, on its first lines up to a length.
  struct Place {
    Eigen::Index line = 0;  ///< after this way-point
    double share = 0.0;     ///< of the line
  };
  [[nodiscard]] Place nearest(const Eigen::VectorXd& q, double length) const;

  scene::GuideSpec spec_;
  bool follows_paths_;
  bool follows_ = false;     ///< whether the goal follows a target
  bool needs_path_ = false;  ///< whether the goal does
  double check_time_s_;
  Mode mode_ = Mode::off;
  Eigen::MatrixXd path_;
  Eigen::VectorXd goal_start_;  ///< where the arm was when the goal became the current one
  /// Along the path, and along the one before, which may still be in force.
  std::unique_ptr<CertifiedPath> motion_, before_;
  /// A goal has changed in motion: the arm goes on along the path before, until another motion
  /// that begins on it is there, and has begun.
  enum class LeadState { none, sought, found };
  LeadState lead_ = LeadState::none;
  /// The lead is to the goal after the current one, which is passed.
  bool passes_ = false;
  bool passing_ = false;     ///< the motion is that one, and the current goal is not reached yet
  bool pass_tried_ = false;  ///< on the way to the current goal
  /// What was found for a lead.
  struct Next {
    std::unique_ptr<CertifiedPath> motion;
    Eigen::MatrixXd points;
    double length = 0.0, margin_m = 0.0;
    std::size_t option = 0;
    double begin_s = 0.0;      ///< on the clock of the motion before
    double passed_by_s = 0.0;  ///< on its own clock, if it passes a goal
  };
  Next next_;
  double passed_by_s_ = 0.0;   ///< on the clock of the motion that passes the current goal
  std::size_t pass_goal_ = 0;  ///< index of the goal after the one that is passed
  double ahead_s_ = 0.0;       ///< from when on the next motion is asked for
  timing::TimedPath::Place beginning_;
  Eigen::Index count_ = 0;  ///< way-points of the path
  double margin_m_ = 0.0;   ///< that it keeps
  Eigen::Index point_ = 0;  ///< that is shown to a planner that follows none
  hamelin_goal shown_{};
  std::uint64_t number_ = 0, goal_number_ = 0;
  std::uint64_t world_ = 0;  ///< that the path, or the lack of one, belongs to
  std::uint64_t asked_ = 0;  ///< number of the last request
  bool awaits_ = false;      ///< its answer
  bool wants_ = false;       ///< to ask as soon as the guide is free
  double asked_s_ = 0.0;
  int searches_ = 0;  ///< at this goal, of those that a stall or the start began
  std::string cause_;
  Figures figures_;
};

}  // namespace hamelin::control
