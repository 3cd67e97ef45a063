#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::search {

/// What a search asks of the world. Used by one thread. Configurations are dof numbers [rad or m].
class Query {
 public:
  Query() = default;
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;
  virtual ~Query() = default;
  /// The smallest distance of the arm from obstacles and from itself [m]; anything below
  /// `at_least_m` if it is less than that.
  [[nodiscard]] virtual double clearance(const Eigen::VectorXd& q, double at_least_m) = 0;
  /// Whether the arm keeps at least `margin_m` at q.
  [[nodiscard]] virtual bool posture_clear(const Eigen::VectorXd& q, double margin_m) = 0;
  /// Whether the arm is proved to keep more than `margin_m` on the straight joint motion from a to
  /// b.
  [[nodiscard]] virtual bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                                          double margin_m) = 0;
  /// How many checks the calls so far took: postures of the whole arm that were measured, and
  /// pieces of motions that were examined.
  [[nodiscard]] virtual long checks() const = 0;
};

/// Whether this build has the planners of OMPL.
[[nodiscard]] bool available() noexcept;
/// One line for a user who asks for a guide in a build that has none.
[[nodiscard]] std::string_view why_unavailable() noexcept;

/// What is the same for all searches of an arm.
struct Settings {
  scene::GuideType type = scene::GuideType::rrt_connect;
  /// Joint limits, of size zero where they are not modelled [rad or m].
  Eigen::VectorXd q_lower, q_upper;
  double margin_m = 0.012;  ///< clearance to keep away from the start and goals
  double least_m = 0.001;   ///< clearance to keep everywhere, if start and goals have it
  double slack_m = 0.003;   ///< by which the clearance of a tight goal may be undercut near it
  double root_clearance_m = 0.0;  ///< clearance of configurations at a goal of the tip, if possible
  long checks_max = 200000;       ///< after which a search ends without a path
  /// For how many checks a planner that optimises goes on after its first path.
  long improve_checks = 20000;
  std::uint64_t seed = 1;
  bool shortens = true;  ///< whether the path is shortened
};

/// A search to be made.
struct Problem {
  Eigen::VectorXd start;
  scene::Goal goal;          ///< joint, position or pose
  std::uint64_t number = 0;  ///< of the search: distinguishes the random numbers
};

/// What a search found.
struct Path {
  /// dof × number of way-points, from the start to a configuration within the goal's tolerances;
  /// empty: none was found. Every straight line between two of them was proved clear.
  Eigen::MatrixXd points;
  double length = 0.0;      ///< [rad or m], in the Euclidean norm
  Eigen::MatrixXd planned;  ///< what the planner found, before it was shortened
  double margin_m = 0.0;    ///< the full margin that it keeps, see Settings::margin_m
  long checks = 0;          ///< of the whole search
  long first_checks = 0;    ///< until the first path was found
  int roots = 0;            ///< configurations at the goal
  long states = 0;          ///< of the planner's graph
  std::string cause;        ///< one line: why none was found
  [[nodiscard]] bool found() const noexcept { return points.cols() > 0; }
};

/// Sum of the Euclidean lengths of the lines between the columns [rad or m].
[[nodiscard]] double path_length(const Eigen::MatrixXd& points);

/// Searches collision-free joint paths by OMPL's planners: chapter 17 of docs/theory.md. The result
/// follows from problem and query alone, in any order of searches and with any number of threads,
/// each of which needs an object of its own.
class Guide {
 public:
  /// @param model must outlive this
  /// @throws Error invalid if the build has no OMPL, or settings do not fit the model
  Guide(const model::Model& model, Settings settings);
  /// Deleted: a temporary model is gone before any search could use it.
  Guide(const model::Model&& model, Settings settings) = delete;

  /// @throws Error invalid for a start or goal that does not fit the arm or is not finite
  [[nodiscard]] Path search(const Problem& problem, Query& query) const;
  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }

 private:
  const model::Model& model_;
  Settings settings_;
};

}  // namespace hamelin::search
