#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>

namespace hamelin::mppi {

/// The clearance that a configuration needs. It is less near places where the arm must be although
/// they have less clearance: where it is now, and goals. docs/theory.md (15.8)
class Margins {
 public:
  static constexpr std::size_t max_goals = 6;

  /// @param full_m away from tight places @param least_m at any place
  /// @param slack_m by how much the clearance of a tight goal may be undercut
  Margins(Eigen::Index dof, double full_m, double least_m, double slack_m)
      : full_(full_m), least_(std::min(least_m, full_m)), slack_(slack_m) {
    start_.q = Eigen::VectorXd::Zero(dof);
    for (auto& goal : goals_) goal.q = start_.q;
  }

  /// The same with a larger full margin.
  [[nodiscard]] Margins with_reserve(double reserve_m) const {
    Margins out = *this;
    out.full_ += reserve_m;
    return out;
  }
  void clear_goals() noexcept { goal_count_ = 0; }
  template <class Vector>
  void add_goal(const Vector& q, double clearance_m) {
    if (goal_count_ < max_goals)
      set(goals_[goal_count_++], q, std::max(least_, clearance_m - slack_));
  }
  /// The place where a plan starts must not make it impossible, whatever its clearance.
  template <class Vector>
  void set_start(const Vector& q, double clearance_m) {
    set(start_, q, std::max(0.0, clearance_m - start_slack_m));
  }
  template <class Vector>
  [[nodiscard]] double required(const Vector& q) const {
    double margin = at(start_, q);
    for (std::size_t i = 0; i < goal_count_; ++i) margin = std::min(margin, at(goals_[i], q));
    return margin;
  }
  [[nodiscard]] double full() const noexcept { return full_; }

 private:
  static constexpr double start_slack_m = 2e-4;
  // Largest difference of a joint at which a tight place counts fully, and not at all [rad or m].
  static constexpr double near = 0.1, far = 0.5;

  struct Place {
    Eigen::VectorXd q;
    double margin = 1.0;
  };
  template <class Vector>
  void set(Place& place, const Vector& q, double margin) const {
    place.q = q;
    place.margin = std::min(full_, margin);
  }
  template <class Vector>
  [[nodiscard]] double at(const Place& place, const Vector& q) const {
    if (place.margin >= full_) return full_;
    const double distance = (q - place.q).template lpNorm<Eigen::Infinity>();
    const double weight = std::clamp((distance - near) / (far - near), 0.0, 1.0);
    return place.margin + weight * (full_ - place.margin);
  }

  double full_, least_, slack_;
  Place start_;
  std::array<Place, max_goals> goals_;
  std::size_t goal_count_ = 0;
};

}  // namespace hamelin::mppi
