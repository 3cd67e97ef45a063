#pragma once
#include "hamelin/reactive/glide.hpp"
#include "hamelin/reactive/inertia.hpp"
#include "hamelin/reactive/law.hpp"
#include "hamelin/reactive/turn.hpp"

namespace hamelin::reactive {

/// The law under the safety filter, run ahead from a configuration without dynamics, its desired
/// velocity turned for a while: docs/theory.md (10.39). It tells where the arm arrives, or where
/// it comes to a stall. Only the constructor allocates.
class Prediction {
 public:
  /// All are kept by reference.
  Prediction(const planning::Setup& setup, const model::Model& model, const LawParams& law,
             const PointMargins& margins, Surroundings& surroundings);
  void set_params(const LawParams& law) noexcept;

  /// @param turn copied @param moving whether obstacles move
  void begin(const Eigen::VectorXd& q, const hamelin_goal& goal, const Turn& turn, bool moving);
  /// Predicts one more posture. @return whether the prediction goes on
  [[nodiscard]] bool step();

  [[nodiscard]] bool arrives() const noexcept { return arrives_; }
  /// Whether it touched something before the turn was over.
  [[nodiscard]] bool is_lost() const noexcept { return best_ == infinity; }
  [[nodiscard]] double time_s() const noexcept { return Glide::step_s * step_; }
  /// The least distance from the goal after the turn, as Law::distance, and where that was.
  [[nodiscard]] double distance() const noexcept { return best_; }
  [[nodiscard]] const Eigen::VectorXd& end() const noexcept { return end_; }

  /// Writes directions in joint space that move the two points sideways which hold the arm back
  /// most at the last posture: ∓ W J'ᵀ t for two tangents t of each. @return their number
  [[nodiscard]] int sideways(Eigen::MatrixXd& directions);
  static constexpr int sideways_max = 4;

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  [[nodiscard]] bool finish(bool arrives) {
    arrives_ = arrives;
    return false;
  }
  void note_distance(double distance);
  void set_velocity();

  const model::Model& model_;
  Law law_;
  LawParams params_;
  Glide glide_;
  Turner turner_;
  dynamics::Workspace ws_;
  const hamelin_goal* goal_ = nullptr;
  Turn turn_;
  bool moving_ = false, arrives_ = false;
  int step_ = 0, idle_ = 0;
  double best_ = infinity;
  Eigen::VectorXd q_, u_, end_, Jt_;
  Inertia inertia_;
  dynamics::Matrix3Xd J_;
};

}  // namespace hamelin::reactive
