#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "hamelin/model/model.hpp"

namespace hamelin::optimal {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What a motion minimises.
enum class Objective : std::int32_t {
  effort,  ///< ∫ τᵀRτ dt in a given time
  time,    ///< the time itself
};

/// Bounds of the motion, one number per joint each; a vector of size zero, or an infinite number,
/// is no bound. All but the positions are bounds of absolute values.
struct Limits {
  VectorXd position_min, position_max;  ///< [rad or m]
  VectorXd velocity;                    ///< [rad/s or m/s]
  VectorXd acceleration;                ///< [rad/s² or m/s²]
  VectorXd jerk;                        ///< [rad/s³ or m/s³]
  VectorXd torque;                      ///< [Nm or N]

  /// Positions, velocities and torques of the robot's joints.
  static Limits of(const model::Model& model);
};

/// The distances at one configuration that are below their bounds: row by row, each once.
class NearDistances {
 public:
  void clear() noexcept { rows_.clear(), distances_.clear(); }
  /// @param distance in metres
  /// @param gradient dof numbers [m per rad or m]
  void add(Eigen::Index row, double distance, const VectorXd& gradient);
  [[nodiscard]] Eigen::Index size() const noexcept {
    return static_cast<Eigen::Index>(rows_.size());
  }
  [[nodiscard]] Eigen::Index row(Eigen::Index i) const { return rows_[index(i)]; }
  [[nodiscard]] double distance(Eigen::Index i) const { return distances_[index(i)]; }
  [[nodiscard]] auto gradient(Eigen::Index i) const { return gradients_.col(i); }

 private:
  static std::size_t index(Eigen::Index i) noexcept { return static_cast<std::size_t>(i); }
  std::vector<Eigen::Index> rows_;
  std::vector<double> distances_;
  MatrixXd gradients_;  ///< dof × at least size()
};

/// Distances of the arm from what it must not touch, as functions of the configuration.
class Clearance {
 public:
  virtual ~Clearance() = default;
  /// How many distances there are, always the same.
  [[nodiscard]] virtual Eigen::Index rows() const = 0;
  /// The bounds of the distances from above [m], rows() numbers: farther away nothing is looked
  /// for.
  [[nodiscard]] virtual const VectorXd& far() const = 0;
  /// @param q dof numbers
  /// @param near is cleared before
  virtual void evaluate(const VectorXd& q, NearDistances& near) = 0;
  /// All distances. @param distances rows() numbers [m]
  /// @param gradients dof × rows() [m per rad or m]; zero where a distance is at its bound
  void evaluate_all(const VectorXd& q, VectorXd& distances, MatrixXd& gradients);
};

/// Numbers of intervals that a Problem may have.
inline constexpr int least_intervals = 6, most_intervals = 100000;

/// With Objective::time no motion is shorter [s]: at rest where the goal is the start, it lasts as
/// long. Far below what any arm can use, and above zero.
inline constexpr double least_duration_s = 1e-3;

/// A motion between two states that is sought: docs/theory.md, chapter 18.
struct Problem {
  const model::Model* model = nullptr;
  VectorXd q_start, v_start, q_goal, v_goal;  ///< dof numbers each
  int intervals = 50;                         ///< N: the motion has N + 1 knots
  Objective objective = Objective::effort;
  /// Of the motion, or with Objective::time of the first guess, at least least_duration_s.
  double duration_s = 1.0;
  Limits limits;
  /// Taken off the torque limits at each knot, for what the torques between the knots exceed those
  /// at the knots by: dof × (N + 1), less than the limits [Nm or N]; with size zero none.
  MatrixXd torque_reserve;
  /// R of the effort, diagonal, dof numbers; with size zero the inverse squares of the torque
  /// limits, or of 1 without limits; of usual torques
  /// with Objective::time.
  VectorXd effort_weights;
  /// With Objective::time, the weight of the mean of τᵀRτ beside the time [s]: it makes the
  /// solution unique and smooth.
  double time_effort_weight = 1e-3;
  Clearance* clearance = nullptr;  ///< null: none; called by one thread at a time
  double margin_m = 0.0;           ///< least clearance
  /// Added to the margin, but in the first and last interval only as far as the clearance of that
  /// end allows: for what the clearance may fall short by between the places where it is required.
  double reserve_m = 0.0;
  double begin_s = 0.0;  ///< time at which the motion begins, for obstacles that move
  /// Configurations per interval at which clearance is required: the knots, and between them.
  int clearance_points = 1;
};

/// @throws Error invalid, one line that names what is wrong: no model, sizes, numbers that are not
///         finite or out of their range, a start or goal outside the limits or nearer to an
///         obstacle than the margin, too few intervals, joints that cannot hold the arm at an end
void check(const Problem& problem);

}  // namespace hamelin::optimal
