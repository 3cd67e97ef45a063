#pragma once
#include <Eigen/Core>
#include <array>

#include "hamelin/dynamics/vector_ref.hpp"

namespace hamelin::integration {

/// The displacements of the last steps, from which a scheme guesses the next one. A plain value.
class StepHistory {
 public:
  explicit StepHistory(Eigen::Index dof) { displacements_.fill(Eigen::VectorXd::Zero(dof)); }

  /// Forgets all steps. The next guess is h v.
  void restart(const dynamics::ConstVectorRef& v);
  /// Whether no step was recorded since the last restart.
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  /// Records the displacement of an accepted step of length h.
  void record(double h, const dynamics::ConstVectorRef& delta);
  /// The displacement that a step of length h can be expected to make: polynomial extrapolation through the last steps
  /// if they were all of this length; else the last one, scaled.
  void guess(double h, dynamics::VectorRef delta) const;
  /// The last displacement recorded.
  [[nodiscard]] const Eigen::VectorXd& last() const noexcept { return displacements_[0]; }

  friend bool operator==(const StepHistory&, const StepHistory&) = default;

 private:
  std::array<Eigen::VectorXd, 4> displacements_;  ///< newest first; while empty() the first is the velocity
  int count_ = 0;                                 ///< how many of them are steps of length step_
  double step_ = 0.0;
};

}  // namespace hamelin::integration
