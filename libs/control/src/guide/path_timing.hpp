#pragma once
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string_view>

#include "guide/guide_query.hpp"
#include "guide/motion_limits.hpp"
#include "guide/path_certifier.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/timing/blended_path.hpp"
#include "hamelin/timing/time_law.hpp"
#include "hamelin/timing/way_points.hpp"
#include "shield/certified_path.hpp"

namespace hamelin::control {

/// A motion that goes on for a while before another one begins, at speed: docs/theory.md (19.16).
struct Lead {
  const CertifiedPath* path;
  double time_s;  ///< on its clock, from which on the new motion holds
};

/// Makes timed motions of paths that a search has found, and says what is proved of them.
class PathTiming {
 public:
  /// @param model kept by reference @param self null if self-collision is not modelled
  /// @param settings of the search, for the joint limits that way-points keep
  PathTiming(const scene::Scene& scene, const model::Model& model, const scene::SelfField* self,
             const MotionBounds& bounds, const search::Settings& settings);

  /// Begins with the paths to a goal. @param number of the search, for random numbers
  /// @param tip_speed_m_s at most; infinite: any
  void begin(std::uint64_t number, double tip_speed_m_s);
  /// The motion begins on another one, between begin() and consider(). Where rates are bounded
  /// there is none.
  /// @param braking_s in which the arm is slow enough for another direction
  /// @param from, towards receive where new paths begin, and a place straight ahead to which they
  ///        lead first
  void begin_with(const Lead& lead, double braking_s, Eigen::VectorXd& from,
                  Eigen::VectorXd& towards);
  /// The same where new paths begin at the end of the other motion, and round the corner there.
  void begin_past(const Lead& lead, Eigen::VectorXd& from);
  /// Takes a path, if it is the fastest so far.
  /// @param points way-points @param margins that the lines between them are proved to keep
  /// @param query proves the blends; its margins are changed
  void consider(const Eigen::MatrixXd& points, const search::Margins& margins,
                search::Query& query);
  [[nodiscard]] bool has_path() const noexcept { return best_.has_value(); }
  /// Improves the fastest path and makes a motion along it.
  /// @return null if there is none; see cause()
  [[nodiscard]] std::unique_ptr<CertifiedPath> make(search::Query& query);
  /// The way-points of the fastest path.
  [[nodiscard]] const Eigen::MatrixXd& points() const { return best_->points(); }
  /// One line: why the last make() found no motion.
  [[nodiscard]] std::string_view cause() const noexcept { return law_.cause(); }
  /// Work beside that of the query, in checks.
  [[nodiscard]] long checks() const noexcept { return checks_; }

 private:
  /// The motion keeps to another one up to a place of its curve.
  void lead_to(const Lead& lead, double place);

  Eigen::VectorXd stop_acceleration_;
  scene::Levers levers_;
  timing::Blending blending_;
  timing::TimeLaw law_;
  timing::WayPoints way_points_;
  PathCertifier certifier_;
  timing::WayPoints::Effort effort_;
  std::uint64_t seed_;
  Rng rng_{0};
  std::optional<timing::BlendedPath> best_;
  bool leads_ = false;  ///< whether it begins on another motion
  timing::Curve lead_;  ///< what it keeps of that; of no pieces: nothing
  double lead_speed_ = 0.0, lead_clearance_m_ = 0.0, lead_self_m_ = 0.0;
  std::optional<search::Margins> margins_;
  double best_s_ = 0.0;
  long checks_ = 0;
};

}  // namespace hamelin::control
