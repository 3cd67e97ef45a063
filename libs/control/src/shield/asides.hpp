#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/trail.hpp"
#include "shield/mover_check.hpp"

namespace hamelin::control {

/// Proposes where an arm could move to if a moving obstacle would hit it where it stops: away from
/// the obstacle, out of its way, back where the arm came from, onwards, and random ways. Each is a
/// joint line, docs/theory.md (14.29). One object per thread. No allocation after construction.
class Asides {
 public:
  /// @param limits of the joints; proposals keep `reserve` from them
  Asides(const model::Model& model, const ModelledLimits& limits, const Eigen::VectorXd& reserve,
         std::uint64_t seed);

  /// Notes where the arm is.
  void pass(const Eigen::VectorXd& q) { trail_.add(q); }
  /// The next proposal, in a fixed order that begins again at its end.
  /// @param threat where the arm would be hit if it stopped @param from where it would stop
  /// @param ahead velocity with which it moves
  /// @param ws used, and overwritten
  void propose(dynamics::Workspace& ws, const MoverCheck::Threat& threat,
               const Eigen::VectorXd& from, const Eigen::VectorXd& ahead, Eigen::VectorXd& target);

  /// The longest way of a proposal [rad or m].
  static constexpr double longest = 1.2;

 private:
  static constexpr int directions = 6, kinds = directions + 4;

  const model::Model& model_;
  Eigen::VectorXd lower_, upper_;  ///< of size zero: none
  Rng rng_;
  int next_ = 0;
  planning::Trail trail_;
};

}  // namespace hamelin::control
