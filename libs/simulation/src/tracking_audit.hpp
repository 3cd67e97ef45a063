#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/dynamics/damped_inverse.hpp"
#include "hamelin/log/result.hpp"

namespace hamelin::simulation {

/// How well the tip follows a target, judged apart from planner and controller. A target is
/// **free** while a posture that holds it is found from the arm's own by the damped iteration
/// (16.12) of docs/theory.md, within the joint limits and clear of obstacles and of the arm itself
/// by 2 cm, and the straight joint motion there is clear. This is examined every 20 ms.
class TrackingAudit {
 public:
  /// @param limits joint limits, where they are modelled; all must outlive this
  TrackingAudit(const model::Model& model, const control::ModelledLimits& limits);

  /// Notes a node. @param h time since the last one [s]
  void observe(const scene::Goal& goal, const control::TargetState& target,
               const Eigen::VectorXd& q, control::WorldView& judge, double h);
  /// The arm carries something else: its model has changed, in place.
  void take_load() { ws_ = dynamics::Workspace(model_); }
  /// Counts a line of the stream that is refused. @return the number of these so far
  long count_refused_line() noexcept { return ++out_.refused_lines; }

  /// The figures so far; none if no target was followed.
  [[nodiscard]] std::optional<log::Result::Following> figures() const;
  /// Of the last node.
  [[nodiscard]] const control::GoalError& error() const noexcept { return error_; }
  [[nodiscard]] bool free() const noexcept { return free_; }

 private:
  struct Sums {
    double time_s = 0.0, square_m = 0.0, max_m = 0.0, square_rad = 0.0, max_rad = 0.0;
    void add(const control::GoalError& error, double h);
    [[nodiscard]] log::Result::Following::Errors errors() const;
  };
  [[nodiscard]] bool is_free(const scene::Goal& goal, const geometry::SE3& target,
                             const Eigen::VectorXd& q, control::WorldView& judge);
  [[nodiscard]] bool solve(const scene::Goal& goal, const geometry::SE3& target);
  [[nodiscard]] bool is_clear(const Eigen::VectorXd& q, control::WorldView& judge, double by_m,
                              double from_self_by_m);
  void note_resumption(bool tracked, double h);

  const model::Model& model_;
  const control::ModelledLimits& limits_;
  dynamics::Workspace ws_;
  dynamics::Matrix6Xd J_;
  dynamics::DampedInverse inverse_;
  Eigen::VectorXd q_, step_, between_;
  control::GoalError error_;
  bool free_ = false, observed_ = false;
  double since_check_s_ = 0.0;
  double away_s_ = 0.0;     ///< how long the target has not been free
  double resume_s_ = -1.0;  ///< time since it is free again and not yet tracked; below 0: none
  Sums all_, while_free_;
  log::Result::Following out_;
};

}  // namespace hamelin::simulation
