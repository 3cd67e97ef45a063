#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/joint_box.hpp"
#include "hamelin/search/query.hpp"
#include "hamelin/timing/blended_path.hpp"
#include "hamelin/timing/time_law.hpp"

namespace hamelin::timing {

/// Moves the way-points of a path so that the motion along it takes less time:
/// chapter 19 of docs/theory.md. Random changes are kept that shorten the motion and are proved;
/// torques are left out of that comparison. One thread.
class WayPoints {
 public:
  /// @param model, levers kept by reference
  /// @param q_lower, q_upper within which way-points are moved; of size zero: no limits
  WayPoints(const model::Model& model, const scene::Levers& levers, const Limits& limits,
            Eigen::VectorXd q_lower, Eigen::VectorXd q_upper);

  /// As TimeLaw::set_tip_speed().
  void set_tip_speed(double m_s) noexcept { law_.set_tip_speed(m_s); }

  struct Effort {
    int tries = 300;         ///< changes that are tried
    long checks = 100000;    ///< of the query, at most about so many
    Eigen::Index fixed = 1;  ///< points at the beginning that stay, at least one
  };
  /// The duration of a motion along a path, without limits of torques [s].
  [[nodiscard]] double duration_s(const BlendedPath& path) { return law_.duration_s(path.curve()); }
  /// @param path its lines and blends are proved to keep the margins; changed where that helps
  /// @param query its margins are changed
  /// @return the duration of the motion, without limits of torques [s]
  double improve(BlendedPath& path, const search::Margins& margins, search::Query& query, Rng& rng,
                 const Effort& effort);

 private:
  /// Changes a copy of the points. @return the first and the last line that are new
  struct Change {
    Eigen::Index first, last;
  };
  [[nodiscard]] Change change(const Eigen::MatrixXd& from, Eigen::Index fixed, Rng& rng);
  void keep_limits(Eigen::Index point);
  [[nodiscard]] bool keep_constraints(const Change& changed, search::Query& query);
  void predict(const BlendedPath& now, const Change& changed, BlendedPath& out) const;
  [[nodiscard]] bool prove(BlendedPath& candidate, const Change& changed,
                           const search::Margins& margins, search::Query& query);

  TimeLaw law_;
  Blending blending_;
  Eigen::VectorXd q_lower_, q_upper_;
  dynamics::JointBox box_;
  Eigen::MatrixXd trial_;
  double spread_ = 0.0;
};

}  // namespace hamelin::timing
