#pragma once
#include "law.hpp"
#include "margins.hpp"
#include "obstacles.hpp"
#include "safety_filter.hpp"
#include "surroundings.hpp"

namespace hamelin::hybrid {

/// The law under the safety filter, run ahead from any configuration: kinematics only, unit inertia, long steps. What
/// it reaches the arm can reach, for the arm is driven by the same law under the same rows.
class Rollout {
 public:
  Rollout(const planning::Setup& setup, const model::Model& model, const LawParams& law, const Margins& margins,
          Surroundings& surroundings);

  /// The goal of the run, by which margins shrink.
  void take_goal(const hamelin_goal& goal) { goal_ = &goal; }
  /// Starts at q towards a joint vector. @param tolerance arrival, largest |error| of a joint
  void begin(const Eigen::VectorXd& q, const Eigen::VectorXd& to, int steps, double tolerance);
  /// Starts at q towards the goal itself.
  void begin(const Eigen::VectorXd& q, int steps);

  enum class Step { moved, arrived, ended, touched };
  /// Looks at q() and, unless it is over, moves on. `touched`: q() is no place to be.
  [[nodiscard]] Step step();
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  /// How far off the target q() was, when last looked at.
  [[nodiscard]] double distance() const noexcept { return distance_; }
  /// How far off the goal a configuration is, as Law::distance.
  [[nodiscard]] double goal_distance(const Eigen::VectorXd& q);

 private:
  void start(const Eigen::VectorXd& q, int steps);
  [[nodiscard]] bool arrived(const Target& target) const;
  void filter();

  const planning::Setup setup_;
  const model::Model& model_;
  const Margins& margins_;
  Surroundings& surroundings_;
  dynamics::Workspace ws_;
  Law law_;
  LawParams params_;
  Obstacles obstacles_;
  SafetyFilter filter_;
  Eigen::MatrixXd identity_;
  Eigen::VectorXd q_, to_, u_, lower_, upper_;
  const hamelin_goal* goal_ = nullptr;
  bool to_goal_ = false;
  int left_ = 0, idle_ = 0;
  double tolerance_ = 0.0, distance_ = 0.0, best_ = 0.0;
};

}  // namespace hamelin::hybrid
