#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <optional>
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

  void set_balls(std::vector<Ball> balls) { balls_ = std::move(balls); }

  double clearance(const Eigen::VectorXd& q, double) override {
    ++checks_;
    return distance(q, q);
  }
  double self_clearance(const Eigen::VectorXd&, double most_m) override { return most_m; }
  void set_margins(const search::Margins& margins) override { margins_ = margins; }
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b) override {
    a_ = a;
    b_ = b;
    open_checks_ = motion_checks;
  }
  // Takes so many checks for each motion, and in the last of them proves it.
  std::optional<bool> prove(long checks) override {
    const long made = std::min(std::max(checks, 1L), open_checks_);
    checks_ += made;
    open_checks_ -= made;
    if (open_checks_ > 0) return std::nullopt;
    return clear(a_, b_);
  }
  [[nodiscard]] long checks() const override { return checks_; }

  /// Of the line from a to b.
  [[nodiscard]] double distance(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
    double least = 1.0;
    const double square = (b - a).squaredNorm();
    for (const Ball& ball : balls_) {
      const double s =
          square > 0.0 ? std::clamp((ball.center - a).dot(b - a) / square, 0.0, 1.0) : 0.0;
      least = std::min(least, (a + s * (b - a) - ball.center).norm() - ball.radius);
    }
    return least;
  }

 private:
  static constexpr long motion_checks = 3;
  // Proves a motion as a whole, or its halves where the margins vary.
  bool clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    const double least = margins_.least(a, b),
                 most = std::max(margins_.required(a), margins_.required(b));
    if (most - least < 1e-4 || (b - a).norm() < 0.1) return distance(a, b) > least;
    const Eigen::VectorXd middle = 0.5 * (a + b);
    return clear(a, middle) && clear(middle, b);
  }

  search::Margins margins_{0.0};
  std::vector<Ball> balls_;
  Eigen::VectorXd a_, b_;  // of the motion that is proved
  long open_checks_ = 0, checks_ = 0;
};

}  // namespace hamelin::test
