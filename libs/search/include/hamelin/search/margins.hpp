#pragma once
#include <Eigen/Core>
#include <limits>
#include <utility>
#include <vector>

namespace hamelin::search {

/// The clearance that a path must keep: a full margin, and less near places where the arm must be
/// although they have less, which are the start and the goals. docs/theory.md (17.1)
class Margins {
 public:
  /// A place where less than the full margin is kept.
  struct Place {
    Eigen::VectorXd q;
    double margin;     ///< kept there [m]
    double near, far;  ///< distances at which it counts fully, and not at all
  };

  /// @param full_m away from tight places
  /// @param weights of the joints in distances between configurations, docs/theory.md (17.17); of
  ///        size zero: ones
  explicit Margins(double full_m, Eigen::VectorXd weights = {})
      : full_(full_m), weights_(std::move(weights)) {}

  void clear() noexcept { places_.clear(); }
  /// Parts of the arm keep no more than that from each other [m].
  void set_self_most(double most_m) noexcept { self_most_ = most_m; }
  [[nodiscard]] double self_most_m() const noexcept { return self_most_; }
  /// One whose margin is not less than the full margin has no effect.
  void add(const Eigen::VectorXd& q, double margin_m, double near, double far);
  [[nodiscard]] double full_m() const noexcept { return full_; }
  [[nodiscard]] const Eigen::VectorXd& weights() const noexcept { return weights_; }
  [[nodiscard]] double weight(Eigen::Index joint) const {
    return weights_.size() > 0 ? weights_[joint] : 1.0;
  }
  [[nodiscard]] const std::vector<Place>& places() const noexcept { return places_; }
  /// What a configuration must keep [m].
  [[nodiscard]] double required(const Eigen::VectorXd& q) const;
  /// The same for a curve whose joints stray so far from the motions that are proved: all margins
  /// are larger by what that moves shapes [m].
  [[nodiscard]] Margins raised(double by_m, Eigen::VectorXd stray) const;
  /// How far joints may be from the motions that are proved; of size zero: they are on them.
  [[nodiscard]] const Eigen::VectorXd& stray() const noexcept { return stray_; }
  /// By how much they change at most per distance between configurations [m].
  [[nodiscard]] double slope() const;
  /// The least that a configuration on the line between two others must keep.
  [[nodiscard]] double least(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;

 private:
  [[nodiscard]] double margin_at(const Place& place, double distance) const;

  double full_, self_most_ = std::numeric_limits<double>::infinity();
  Eigen::VectorXd weights_, stray_;
  std::vector<Place> places_;
};

}  // namespace hamelin::search
