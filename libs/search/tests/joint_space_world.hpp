#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <vector>

#include "hamelin/search/search.hpp"

namespace hamelin::test {

/// A world that is given in joint space: balls that a configuration must not enter. Distances of
/// points and lines from them have a closed form, so that motions are proved exactly.
class JointSpaceWorld final : public search::Query {
 public:
  struct Ball {
    Eigen::VectorXd center;
    double radius;
  };
  explicit JointSpaceWorld(std::vector<Ball> balls) : balls_(std::move(balls)) {}

  double clearance(const Eigen::VectorXd& q, double) override {
    ++checks_;
    return distance(q, q);
  }
  bool posture_clear(const Eigen::VectorXd& q, double margin_m) override {
    ++checks_;
    return distance(q, q) >= margin_m;
  }
  bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double margin_m) override {
    ++checks_;
    return distance(a, b) > margin_m;
  }
  [[nodiscard]] long checks() const override { return checks_; }

  /// Of the line from a to b.
  [[nodiscard]] double distance(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
    double least = 1.0;
    const Eigen::VectorXd line = b - a;
    const double square = line.squaredNorm();
    for (const Ball& ball : balls_) {
      const double s =
          square > 0.0 ? std::clamp((ball.center - a).dot(line) / square, 0.0, 1.0) : 0.0;
      least = std::min(least, (a + s * line - ball.center).norm() - ball.radius);
    }
    return least;
  }

 private:
  std::vector<Ball> balls_;
  long checks_ = 0;
};

}  // namespace hamelin::test
