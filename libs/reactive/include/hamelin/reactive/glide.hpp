#pragma once
#include "hamelin/reactive/obstacles.hpp"
#include "hamelin/reactive/point_margins.hpp"
#include "hamelin/reactive/safety_filter.hpp"
#include "hamelin/reactive/surroundings.hpp"

namespace hamelin::reactive {

/// An arm without dynamics that is moved in long steps along obstacles and joint limits by a
/// velocity under a safety filter: docs/theory.md (10.26), (10.27). Predictions are made of such
/// steps. Only the constructor allocates.
class Glide {
 public:
  static constexpr double step_s = 0.06;    ///< long steps are possible without dynamics
  static constexpr double radius_m = 0.07;  ///< obstacles beyond this distance are ignored

  /// @param surroundings kept by reference, as are model and margins
  Glide(const planning::Setup& setup, const model::Model& model, const PointMargins& margins,
        Surroundings& surroundings);

  /// Goes to a configuration and finds what is near.
  /// @param ahead_s time at which moving obstacles count where they are predicted to be; below 0
  ///        they do not count
  /// @param self_radius_m up to which parts of the arm count
  /// @return false if the arm touches something
  [[nodiscard]] bool place(const Eigen::VectorXd& q, double ahead_s, double self_radius_m);
  [[nodiscard]] const dynamics::Workspace& ws() const noexcept { return ws_; }
  [[nodiscard]] std::span<NearPoint> points() noexcept { return obstacles_.points(); }
  /// The multiplier of a near point's row in the last filter(): positive if it held the arm back.
  [[nodiscard]] double multiplier(std::size_t point) const;

  /// Projects u to an admissible velocity. @param weight Law::margin_weight
  /// @param M, W metric of the projection and its inverse
  void filter(double weight, const Eigen::MatrixXd& M, const Eigen::MatrixXd& W,
              Eigen::VectorXd& u);

 private:
  void set_box(Eigen::VectorXd& u);

  const planning::Setup setup_;
  const model::Model& model_;
  const PointMargins& margins_;
  Surroundings& surroundings_;
  dynamics::Workspace ws_;
  Obstacles obstacles_;
  SafetyFilter filter_;
  Eigen::VectorXd q_, lower_, upper_;
};

}  // namespace hamelin::reactive
