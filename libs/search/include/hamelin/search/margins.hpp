#pragma once
#include <Eigen/Core>
#include <vector>

namespace hamelin::search {

/// The clearance that a path must keep: a full margin, and less near places where the arm must be
/// although they have less, which are the start and the goals. docs/theory.md (17.1)
class Margins {
 public:
  /// @param full_m away from tight places
  explicit Margins(double full_m) : full_(full_m) {}

  void clear() noexcept { places_.clear(); }
  /// A place at which `margin_m` is kept; one that is not less than the full margin has no effect.
  /// @param near, far distance from the place at which its margin counts fully, and not at all [rad
  ///        or m]
  void add(const Eigen::VectorXd& q, double margin_m, double near, double far);
  [[nodiscard]] double full_m() const noexcept { return full_; }
  /// What a configuration must keep [m].
  [[nodiscard]] double required(const Eigen::VectorXd& q) const;
  /// The least that a configuration on the line between two others must keep.
  [[nodiscard]] double least(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;

 private:
  struct Place {
    Eigen::VectorXd q;
    double margin, near, far;
  };
  [[nodiscard]] double margin_at(const Place& place, double distance) const;

  double full_;
  std::vector<Place> places_;
};

}  // namespace hamelin::search
