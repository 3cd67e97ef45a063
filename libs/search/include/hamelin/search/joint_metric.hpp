#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "hamelin/model/model.hpp"

namespace hamelin::search {

/// The weight of each joint in distances between configurations, docs/theory.md (17.17): by how
/// much of the arm it moves how far, so that radians and metres may be mixed. It is 1 for a
/// revolute joint with a long lever.
[[nodiscard]] Eigen::VectorXd joint_weights(const model::Model& model);

/// sqrt(Σ (w_j (a_j − b_j))²); weights of size zero are ones.
template <class A, class B>
[[nodiscard]] double weighted_distance(const Eigen::VectorXd& weights, const A& a, const B& b) {
  double square = 0.0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    const double d = (weights.size() > 0 ? weights[j] : 1.0) * (a[j] - b[j]);
    square += d * d;
  }
  return std::sqrt(square);
}

/// The distance of a configuration from the line between a and b.
[[nodiscard]] inline double weighted_distance(const Eigen::VectorXd& weights,
                                              const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                                              const Eigen::VectorXd& q) {
  double along = 0.0, square = 0.0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    const double w = weights.size() > 0 ? weights[j] : 1.0, d = w * (b[j] - a[j]);
    along += d * w * (q[j] - a[j]);
    square += d * d;
  }
  const double s = square > 0.0 ? std::clamp(along / square, 0.0, 1.0) : 0.0;
  double apart = 0.0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    const double w = weights.size() > 0 ? weights[j] : 1.0,
                 d = w * (a[j] + s * (b[j] - a[j]) - q[j]);
    apart += d * d;
  }
  return std::sqrt(apart);
}

}  // namespace hamelin::search
