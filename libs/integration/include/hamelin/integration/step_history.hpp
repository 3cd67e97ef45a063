#pragma once
#include <Eigen/Core>
#include <array>

#include "hamelin/dynamics/vector_ref.hpp"

namespace hamelin::integration {

/// The displacements of the last steps, from which a scheme guesses the next one: docs/theory.md
/// (4.24). A plain value.
class StepHistory {
 public:
  explicit StepHistory(Eigen::Index dof) { displacements_.fill(Eigen::VectorXd::Zero(dof)); }

  /// Forgets all steps. The next guess is h v.
  void restart(const dynamics::ConstVectorRef& v);
  /// Whether no step was recorded since the last restart.
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  /// Records the displacement of an accepted step of length h.
  void record(double h, const dynamics::ConstVectorRef& delta);
  /// Extrapolates the displacement of a step of length h: by a polynomial through the last steps if
  /// they all had this length, otherwise by scaling the last one.
  void guess(double h, dynamics::VectorRef delta) const;
  /// The last displacement recorded.
  [[nodiscard]] const Eigen::VectorXd& last() const noexcept { return displacements_[0]; }
  /// The length of that step.
  [[nodiscard]] double step() const noexcept { return step_; }

  friend bool operator==(const StepHistory&, const StepHistory&) = default;

 private:
  std::array<Eigen::VectorXd, 4> displacements_;  ///< newest first; the velocity first if empty()
  int count_ = 0;                                 ///< how many of them are steps of length step_
  double step_ = 0.0;
};

}  // namespace hamelin::integration
