#pragma once
#include "hamelin/reactive/glide.hpp"
#include "hamelin/reactive/law.hpp"

namespace hamelin::reactive {

/// Runs a simplified form of the law under the safety filter ahead from any configuration:
/// kinematics only, unit inertia, long steps, docs/theory.md (10.26), (10.27). The arm follows the
/// result with the same kind of law and rows.
class Rollout {
 public:
  Rollout(const planning::Setup& setup, const model::Model& model, const LawParams& law,
          const Margins& margins, Surroundings& surroundings);

  void set_params(const LawParams& law) noexcept {
    law_.set_params(law);
    params_ = law;
  }
  /// Sets the goal near which margins shrink.
  void set_goal(const hamelin_goal& goal) { goal_ = &goal; }
  /// Starts at q towards a joint vector. @param tolerance largest |error| of a joint on arrival
  void begin(const Eigen::VectorXd& q, const Eigen::VectorXd& to, int steps, double tolerance);
  /// Starts at q towards the goal itself.
  void begin(const Eigen::VectorXd& q, int steps);

  enum class Step { moved, arrived, ended, touched };
  /// Checks q() and takes one step, unless the rollout ends here. `touched` means that q() is in
  /// contact.
  [[nodiscard]] Step step();
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  /// The distance from the target at the last checked configuration.
  [[nodiscard]] double distance() const noexcept { return distance_; }
  /// The distance of a configuration from the goal, as Law::distance.
  [[nodiscard]] double goal_distance(const Eigen::VectorXd& q);

 private:
  void start(const Eigen::VectorXd& q, int steps);
  [[nodiscard]] bool arrived(const Target& target) const;

  const model::Model& model_;
  dynamics::Workspace ws_;
  Law law_;
  LawParams params_;
  Glide glide_;
  Eigen::MatrixXd identity_;
  Eigen::VectorXd q_, to_, u_;
  const hamelin_goal* goal_ = nullptr;
  bool to_goal_ = false;
  int steps_left_ = 0, idle_ = 0;
  double tolerance_ = 0.0, distance_ = 0.0, best_ = 0.0;
};

}  // namespace hamelin::reactive
