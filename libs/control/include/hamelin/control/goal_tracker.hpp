#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// The distance of the arm from a goal.
struct GoalError {
  std::optional<double> metres;  ///< of the tip, for position and pose goals
  /// Of the tip's rotation for pose goals; the largest of all joints for joint goals.
  std::optional<double> radians;
  double size = 0.0;       ///< in tolerances, the larger of both; up to 1 within them
  bool reached = false;    ///< within the goal's tolerances, speeds included
  std::size_t option = 0;  ///< of several the nearest, measured by their tolerances
};

/// Error of a goal. `ws` must have the poses of q by this model. A follow goal has none of its own,
/// see target_error().
[[nodiscard]] GoalError goal_error(const scene::Goal& goal, const model::Model& model,
                                   const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                                   const Eigen::VectorXd& v);

/// The distance of the tip from the target of a follow goal. It is never reached. `ws` must have
/// the arm's poses by this model.
[[nodiscard]] GoalError target_error(const scene::Goal& goal, const geometry::SE3& target,
                                     const model::Model& model, const dynamics::Workspace& ws);

/// Keeps track of the current goal, and detects stalls: an arm at rest away from the goal.
class GoalTracker {
 public:
  /// @param goals at least one; must outlive this, or stay until set_goals()
  /// @param rule none: stalls are not detected; must outlive this
  GoalTracker(const std::vector<scene::Goal>& goals, const std::optional<scene::StallRule>& rule,
              const model::Model& model);

  /// Selects the next goal if the current one is reached. `ws` must have the poses of q.
  /// @return whether it was
  [[nodiscard]] bool advance(const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                             const Eigen::VectorXd& v);
  /// Starts with the first of other goals.
  /// @param goals as for the constructor
  void set_goals(const std::vector<scene::Goal>& goals) noexcept {
    goals_ = &goals;
    restart();
  }
  /// The arm carries something else. `model` must outlive this, or stay until the next call.
  void set_model(const model::Model& model) noexcept { model_ = &model; }
  /// Starts again with the first goal.
  void restart() noexcept {
    index_ = 0;
    rest_s_ = 0.0;
  }
  /// Looks for a stall as if the arm had just come to rest.
  void forget_rest() noexcept { rest_s_ = 0.0; }
  [[nodiscard]] bool all_reached() const noexcept { return index_ == goals_->size(); }
  /// Index of the current goal; size() after the last.
  [[nodiscard]] std::size_t index() const noexcept { return index_; }
  [[nodiscard]] std::size_t size() const noexcept { return goals_->size(); }
  /// The current goal, or the last one.
  [[nodiscard]] const scene::Goal& goal() const {
    return (*goals_)[std::min(index_, goals_->size() - 1)];
  }

  /// Whether the current goal follows a target.
  [[nodiscard]] bool follows() const { return goal().type == scene::GoalType::follow; }

  /// Evaluates the scene's stall rule, which does not apply to a follow goal; to be called once per
  /// step of dt_s. A stall is a tip whose speed stayed below that of the rule for its hold time,
  /// and for position and pose goals also farther from the goal than its distance.
  [[nodiscard]] bool stalled(const dynamics::Workspace& ws, const Eigen::VectorXd& v, double dt_s);

 private:
  const std::vector<scene::Goal>* goals_;
  const std::optional<scene::StallRule>& rule_;
  const model::Model* model_;
  std::size_t index_ = 0;
  double rest_s_ = 0.0;
};

/// The goal that follows a target, which is the last one; null if there is none.
[[nodiscard]] const scene::Goal* follow_goal_of(const std::vector<scene::Goal>& goals) noexcept;

}  // namespace hamelin::control
