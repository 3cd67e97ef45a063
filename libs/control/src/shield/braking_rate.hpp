#pragma once
#include <Eigen/Core>
#include <optional>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::control {

/// Finds how fast an arm can stop on a straight joint line: the largest rate α at which the torques
/// M(q)(−α w) + s² C(q, w) w + g(q) of the StopMotion stay within given limits until it rests:
/// docs/theory.md (14.10)–(14.13). One object per thread. No allocation after construction.
class BrakingRate {
 public:
  /// @param effort_max allowed torques [Nm or N]; of size zero: any
  /// @param acceleration_max of each joint [rad/s² or m/s²]; of size zero: any
  /// @param rate_max α is never larger [1/s]
  BrakingRate(const model::Model& model, Eigen::VectorXd effort_max,
              Eigen::VectorXd acceleration_max, double rate_max);

  /// A rate at which the arm can stop from q with velocity w. The rate of the last call is kept if
  /// it uses enough of the allowed torque.
  /// @param least_utilisation of the allowed torque; lower values accept slower stops, and are
  ///        found faster
  /// @return none if there is no such rate
  [[nodiscard]] std::optional<double> find(const Eigen::VectorXd& q, const Eigen::VectorXd& w,
                                           double least_utilisation);
  static constexpr double usual_utilisation = 0.7, full_utilisation = 0.95;
  /// A bound of the largest |torque| that the motion of the last call of find() requires at the
  /// rate that was tried last, between the points of the line, too, as a share of what is allowed.
  [[nodiscard]] double utilisation() const noexcept { return utilisation_; }

 private:
  static constexpr Eigen::Index points = 8;  ///< on the line, the last one at rest
  [[nodiscard]] double upper_rate(const Eigen::VectorXd& w) const;
  void set_line(const Eigen::VectorXd& q, const Eigen::VectorXd& w, double rate);
  /// Utilisation at a rate; keeps torques in with_rate_.
  double evaluate(const Eigen::VectorXd& q, const Eigen::VectorXd& w, double rate);
  /// Rates that the torques at the points of the last evaluate() allow: from first to second.
  std::pair<double, double> allowed_rates(double rate);

  const model::Model& model_;
  Eigen::VectorXd effort_max_, acceleration_max_;
  double rate_max_, last_;
  double utilisation_ = 0.0;
  dynamics::BatchWorkspace ws_;
  dynamics::StatesXd q_, v_, a_, with_rate_, without_;
  Eigen::VectorXd rise_;  ///< of each torque between the points [Nm or N]
};

}  // namespace hamelin::control
