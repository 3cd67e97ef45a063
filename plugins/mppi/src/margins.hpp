#pragma once
#include <Eigen/Core>
#include <algorithm>

namespace hamelin::mppi {

/// The clearance that a configuration needs, and that from which on it costs nothing. Both are less
/// near places where the arm must be although they have less clearance: where it is now (the first
/// only), and a goal. docs/theory.md (15.8)
class Margins {
 public:
  /// @param full_m away from tight places @param least_m at any place
  /// @param slack_m by how much the clearance of a tight goal may be undercut
  /// @param range_m clearance from which on a place away from tight goals costs nothing
  Margins(Eigen::Index dof, double full_m, double least_m, double slack_m, double range_m)
      : full_(full_m),
        least_(std::min(least_m, full_m)),
        slack_(slack_m),
        range_(std::max(range_m, full_m)) {
    start_.q = goal_.q = Eigen::VectorXd::Zero(dof);
  }

  /// @param full_m away from tight places, at most the range
  void set_full(double full_m) { full_ = std::clamp(full_m, least_, range_); }
  template <class Vector>
  void set_goal(const Vector& q, double clearance_m) {
    goal_.q = q;
    goal_.margin = std::min(full_, std::max(least_, clearance_m - slack_));
    goal_.range = std::min(range_, clearance_m);
  }
  /// The place where a plan starts must not make it impossible, whatever its clearance.
  template <class Vector>
  void set_start(const Vector& q, double clearance_m) {
    start_.q = q;
    start_.margin = std::min(full_, std::max(0.0, clearance_m - start_slack_m));
    start_.range = range_;
  }

  struct Required {
    double margin_m, range_m;
  };
  template <class Vector>
  [[nodiscard]] Required required(const Vector& q) const {
    Required out{full_, range_};
    lower(start_, q, out);
    lower(goal_, q, out);
    return out;
  }
  /// The largest range of any place.
  [[nodiscard]] double range() const noexcept { return range_; }

 private:
  static constexpr double start_slack_m = 2e-4;
  // Largest difference of a joint at which a tight place counts fully, and not at all [rad or m].
  static constexpr double near = 0.1, far = 0.8;

  struct Place {
    Eigen::VectorXd q;
    double margin = 1.0, range = 1.0;
  };
  template <class Vector>
  void lower(const Place& place, const Vector& q, Required& out) const {
    if (place.margin >= full_ && place.range >= range_) return;
    const double distance = (q - place.q).template lpNorm<Eigen::Infinity>();
    const double weight = std::clamp((distance - near) / (far - near), 0.0, 1.0);
    out.margin_m = std::min(out.margin_m, place.margin + weight * (full_ - place.margin));
    out.range_m = std::min(out.range_m, place.range + weight * (range_ - place.range));
  }

  double full_, least_, slack_, range_;
  Place start_, goal_;
};

}  // namespace hamelin::mppi
