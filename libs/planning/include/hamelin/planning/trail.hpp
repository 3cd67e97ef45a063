#pragma once
#include <Eigen/Core>
#include <algorithm>

namespace hamelin::planning {

/// Configurations that an arm came along; the oldest are forgotten. A way back was clear of all
/// that stands still. No allocation after construction.
class Trail {
 public:
  /// @param spacing least distance between two of them [rad or m]
  Trail(Eigen::Index dof, Eigen::Index capacity, double spacing)
      : points_(Eigen::MatrixXd::Zero(dof, capacity)), spacing_(spacing) {}

  void clear() noexcept { size_ = 0; }
  /// The point that was added `age` points before the newest.
  [[nodiscard]] auto point(Eigen::Index age) const {
    return points_.col((newest_ - age + points_.cols()) % points_.cols());
  }
  /// Adds q if it is far enough from the newest point.
  void add(const Eigen::VectorXd& q) {
    if (size_ > 0 && (point(0) - q).norm() < spacing_) return;
    newest_ = (newest_ + 1) % points_.cols();
    points_.col(newest_) = q;
    size_ = std::min(size_ + 1, points_.cols());
  }
  [[nodiscard]] Eigen::Index size() const noexcept { return size_; }
  /// Skips points that q has reached on the way back, from `age` on. The oldest one is kept.
  [[nodiscard]] Eigen::Index next(Eigen::Index age, const Eigen::VectorXd& q,
                                  double reached) const {
    while (age + 1 < size_ && (point(age) - q).norm() < reached) ++age;
    return age;
  }
  /// Takes the newest points of another trail, as many as it has room for.
  void copy(const Trail& other) {
    size_ = std::min(other.size_, points_.cols());
    newest_ = points_.cols() - 1;
    for (Eigen::Index age = 0; age < size_; ++age) points_.col(newest_ - age) = other.point(age);
  }
  /// Forgets the newest points.
  void forget(Eigen::Index count) {
    newest_ = (newest_ - count + points_.cols()) % points_.cols();
    size_ -= count;
  }

 private:
  Eigen::MatrixXd points_;  ///< a ring, one column per point
  double spacing_;
  Eigen::Index newest_ = 0, size_ = 0;
};

}  // namespace hamelin::planning
