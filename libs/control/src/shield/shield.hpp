#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/control/answer.hpp"
#include "hamelin/control/line_buffer.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"
#include "loop/stop.hpp"
#include "loop/stop_finder.hpp"
#include "shield/asides.hpp"
#include "shield/fail_safe.hpp"
#include "shield/line_check.hpp"
#include "shield/move_time.hpp"
#include "shield/mover_check.hpp"
#include "shield/path_proof.hpp"
#include "shield/straying.hpp"

namespace hamelin::control {

/// Lets a step of the arm pass only if a verified way to stop exists after it: chapter 14 of
/// docs/theory.md. Verified means that the arm stays clear of all that stands still and of itself,
/// within its joint limits and within a share of its torque limits, until it rests, by margins that
/// cover the errors that the scene states. If a step is refused, the last verified stop goes on
/// instead; it ends with the first step that is accepted. Where a moving obstacle would hit the
/// arm, the stop is part of an evasion, see FailSafe. A step without one is refused only while the
/// fail-safe motion in force stays clear itself: an arm that will be hit wherever it goes is left
/// to its planner. One object per thread; no allocation after construction.
class Shield {
 public:
  using Node = Stop::Node;
  using Surroundings = control::Surroundings;
  /// Why and where a step was refused.
  struct Refusal {
    StopCause cause = StopCause::answer;
    LineCheck::Blocker blocker;  ///< map, unknown_space, obstacle, self
    int joint = -1;              ///< joint_limit, velocity_limit, torque
  };
  using Counts = ShieldCounts;

  /// @param model the controller's model of the arm, kept by reference
  /// @param self null if self-collision is not modelled; kept by reference
  /// @param period_s time between two steps
  Shield(const scene::Scene& scene, const model::Model& model, const scene::SelfField* self,
         double period_s, const ChangeBounds& changes);

  /// By how much the planner's limits should lie inside those that this keeps.
  [[nodiscard]] const LimitReserve& limit_reserve() const noexcept { return reserve_; }

  /// Begins at a node, which must have a verified stop itself.
  /// @throws Error invalid if it has none, with the bound that would do
  void start(const Surroundings& world, const Node& node);
  /// Begins in place of the shield of the arm with another load, whose counts go on.
  /// @param node where the arm is @param stop where a stop can begin, and what acts there
  /// @return whether there is a verified stop; else see refusal()
  [[nodiscard]] bool start_in_place_of(const Shield& other, const Surroundings& world,
                                       const Node& node, const StopFinder::Start& stop);
  /// A step of the arm.
  struct Step {
    Node from;                         ///< the node as it was verified
    const Eigen::VectorXd& departure;  ///< velocity with which the arm would leave it
    Node to;                           ///< what the step would lead to
    /// Acceleration and torque with which the arm would go on after the step, where these change at
    /// a bounded rate only, and the acceleration that acts besides that of the torque; else not
    /// used.
    const Eigen::VectorXd& acceleration;
    const Eigen::VectorXd& torque;
    const Eigen::VectorXd& disturbance;
  };
  /// The path along which the arm may stop; null: none. It must stay until another one is set and
  /// the stop in force is not along it.
  void set_path(const CertifiedPath* path, const Surroundings& world);
  /// Where the arm should be on it. @param ahead_s time until the step that is tried
  void note_path(const PathStop::Place& at) noexcept { path_place_ = at; }
  /// What is proved of the path.
  [[nodiscard]] const PathProof& path_proof() const noexcept { return path_proof_; }
  /// Decides on a step. @return whether it is accepted; else see refusal()
  [[nodiscard]] bool accept(const Surroundings& world, const Step& step);
  /// Counts a step that cannot be tried: there is no usable answer, or no state after it.
  void refuse();
  /// Whether the last step was refused.
  [[nodiscard]] bool stopping() const noexcept { return stopping_; }
  /// The stop in force, which goes on if the next step is refused.
  [[nodiscard]] Stop& stop() noexcept { return stop_; }
  [[nodiscard]] const Stop& stop() const noexcept { return stop_; }
  /// Whether the last step was the first of a stop.
  [[nodiscard]] bool stop_began() const noexcept { return stopping_ && run_ == 1; }
  [[nodiscard]] const Refusal& refusal() const noexcept { return refusal_; }
  [[nodiscard]] Counts counts() const noexcept;
  /// What is proved of moving obstacles after the last step; none given if there are none in reach.
  [[nodiscard]] std::optional<MoverProof> mover_proof() const noexcept { return proof_; }
  /// The largest margin of any shape that any stop required [m].
  [[nodiscard]] double largest_margin_m() const { return largest_margin_ + margin_m_; }
  /// Describes what was in the way: "link 'hand' would come too near the map".
  [[nodiscard]] std::string describe(const scene::Environment& environment) const;
  /// The same at the end of a line, without allocating.
  void describe(const scene::Environment& environment, LineBuffer& line) const;

 private:
  /// Sets what is kept from the limits. @param q where the arm starts
  void set_reserve(const scene::Scene& scene, const Eigen::VectorXd& q);
  /// Why the arm cannot begin at a node, and what would do.
  [[nodiscard]] std::string defect_at_start(const Surroundings& world, const Node& node);
  [[nodiscard]] bool verify(const Surroundings& world, const Step& step);
  /// The same with a stop on a straight line.
  [[nodiscard]] bool verify_line(const Surroundings& world, const Step& step);
  // Along a path, in shield_path.cpp.
  [[nodiscard]] bool verify_path(const Step& step);
  /// The place of the path near a node, and the node's deviation from it, in e_ and e_rate_.
  [[nodiscard]] PathStop::Place project(const Node& node, const PathStop::Place& near);
  /// The β with which an arm passes a place, by its acceleration, and the rest of that in
  /// e_acceleration_, where accelerations may not jump; else zero.
  [[nodiscard]] double braking_at(const PathStop::Place& place, const Step& step);
  /// Whether an arm that strays from the path by this much keeps the margins and the joint limits.
  [[nodiscard]] bool within_tube(const Straying::Bounds& stray, Eigen::Index first,
                                 Eigen::Index last);
  /// The stop that was verified is now the one that goes on if the next step is refused.
  void take_tried();
  /// Sets tried_ to a stop after the step. @return whether there is one
  [[nodiscard]] bool find_stop(const Step& step, double least_utilisation);
  /// Whether the stop after the step keeps the joint limits and stays clear.
  [[nodiscard]] bool stop_is_safe(const Surroundings& world, const Step& step);
  [[nodiscard]] bool stop_is_clear(const Surroundings& world, const LineCheck::End& at_to);
  // Of obstacles that move, in shield_movers.cpp.
  /// Lists those that could touch the arm within the horizon. @return whether there are any
  [[nodiscard]] bool list_movers(const Surroundings& world, const Node& node);
  /// Whether the step may be made; sets proof_, and what tried_ does after the stop.
  [[nodiscard]] bool allow_for_movers(const Surroundings& world, const Step& step);
  /// What is known of a motion among moving obstacles.
  struct Foresight {
    MoverProof proof;
    double clear_s;  ///< so long it stays clear of those that are predicted
    double least_m;  ///< lower bound of its distance from them
  };
  /// Of the motion in force; sets proof_.
  Foresight prove_stop_in_force(const Surroundings& world);
  void note_proof();
  /// Sets refusal_ to the obstacle that comes nearest.
  void blame(const Surroundings& world);
  /// A motion among moving obstacles, by how much the arm may stray from it, where the arm is on
  /// it, and the time from now to then.
  struct Examined {
    const FailSafe& motion;
    const Straying::Bounds& stray;
    double from_s, lead_s;
  };
  [[nodiscard]] Foresight prove(MoverCheck& check, const Surroundings& world, const Examined& of);
  [[nodiscard]] Foresight find_fail_safe(const Surroundings& world, const Step& step);
  /// Adds a move to tried_, one of those that come into question, if it is clear.
  /// @param stopped the check of the stop alone @param from_s where the arm is on it
  /// @param ahead velocity of the arm
  [[nodiscard]] Foresight find_evasion(const Surroundings& world, MoverCheck& stopped,
                                       double from_s, const Eigen::VectorXd& ahead);
  /// Sets proof_ while a step is refused. An arm that will be hit where it stops evades.
  void go_on_among_movers(const Surroundings& world);
  [[nodiscard]] Foresight try_move(LineCheck& line, MoverCheck& check, const Surroundings& world,
                                   double from_s, const Eigen::VectorXd& target);
  [[nodiscard]] bool keeps_limits(const Eigen::VectorXd& q) const;
  [[nodiscard]] bool line_is_clear(LineCheck& line, const Surroundings& world,
                                   const LineCheck::End& from, const Eigen::VectorXd& to);
  [[nodiscard]] bool within_velocity(const Eigen::VectorXd& from, const Eigen::VectorXd& to);
  [[nodiscard]] bool within_joint_limits(const Step& step);
  [[nodiscard]] bool is_clear(LineCheck& line, const Surroundings& world,
                              const LineCheck::End& from, const LineCheck::End& to,
                              const Eigen::VectorXd& stray, double more_m = 0.0);
  /// Forgets what is known of obstacles if they are others than before.
  void notice(const Surroundings& world);
  /// Counts the stop in force if it is not clear any more.
  void check_overtaken(const Surroundings& world, const Node& node);
  void count_refusal();
  LineCheck::End place(const Eigen::VectorXd& q, scene::PlacedShapes& arm);

  const model::Model& model_;
  const scene::SelfField* self_;
  std::string scene_name_;
  std::vector<std::string> shape_names_, pair_names_;  ///< for describe()
  bool sampled_;                                       ///< whether actuation is not ideal
  double period_s_, margin_m_;
  long dwell_;  ///< steps that a stop lasts at least, unless it ends before
  ModelledLimits limits_;
  double torque_share_;
  Eigen::VectorXd speed_max_;  ///< of size zero: not modelled
  LimitReserve reserve_;
  scene::Levers levers_;
  StopFinder finder_;
  Straying straying_;  ///< of tried_
  Stop stop_;
  LineCheck step_line_, ramp_line_, stop_line_;
  dynamics::Workspace ws_;
  FailSafe tried_;
  scene::PlacedShapes arm_from_, arm_to_, arm_line_, arm_end_;
  Eigen::VectorXd no_addition_;  ///< of size zero
  double largest_margin_ = 0.0;
  Eigen::VectorXd line_stray_, zero_, way_, hold_;

  PathProof path_proof_;
  PathStop::Place path_place_;
  Eigen::VectorXd path_q_, path_v_, path_a_, e_, e_rate_, e_acceleration_, path_effort_;
  timing::TimedPath::Cursor path_cursor_;

  std::optional<std::uint64_t> snapshot_;  ///< for which the lines' anchors hold
  std::uint64_t standing_ = 0;             ///< for which the path is proved
  std::size_t existing_ = 0;               ///< obstacles at the last call
  bool changed_ = false;  ///< whether obstacles changed since the stop was verified
  bool stopping_ = false;
  long run_ = 0;
  Refusal refusal_;
  Counts counts_;

  // of obstacles that move
  double lead_s_;  ///< time from a measurement to the step that is tried
  MoveTime move_time_;
  LineCheck move_line_, other_line_;
  MoverCheck stop_check_, move_check_, other_check_, force_check_;
  MoverCheck bounded_check_;  ///< of obstacles with bounded speed
  std::optional<Asides> asides_;
  std::vector<int> predicted_, bounded_;  ///< in reach, indices of obstacles
  bool all_listed_ = true;
  Eigen::VectorXd aside_;  ///< where the evasion that was found last leads
  bool has_aside_ = false;
  std::optional<MoverProof> proof_;
};

}  // namespace hamelin::control
