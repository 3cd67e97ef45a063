#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/search/query.hpp"
#include "hamelin/search/tip_curve.hpp"

namespace hamelin::search {

/// What is the same for all searches of an arm.
struct Settings {
  /// Joint limits, of size zero where they are not modelled [rad or m].
  Eigen::VectorXd q_lower, q_upper;
  double margin_m = 0.012;  ///< clearance to keep away from the start and goals
  /// Clearance that parts of the arm keep from each other, at most the margin, and no more than
  /// they have at the start.
  double self_margin_m = 0.012;
  double least_m = 0.001;  ///< clearance to keep everywhere, if start and goals have it
  double slack_m = 0.003;  ///< by which the clearance of a tight goal may be undercut near it
  double root_clearance_m = 0.0;  ///< clearance of configurations at a goal of the tip, if possible
  long checks_max = 200000;       ///< after which a search ends without a path
  long improve_checks = 0;        ///< for how many checks a path is improved after it was shortened
  std::uint64_t seed = 1;
};

/// A search to be made.
struct Problem {
  Eigen::VectorXd start;
  /// Joint, position or pose goals, at least one: the path leads to any of them.
  std::vector<scene::Goal> goals;
  std::uint64_t number = 0;  ///< of the search: distinguishes the random numbers
  /// dof × way-points of a path from near the start, which led to one of the goals before the world
  /// changed; what is still clear of it is where the search begins. May be empty, and is ignored if
  /// its end is no longer a goal.
  Eigen::MatrixXd known{};
  /// The whole way of the tip to the only goal, to its tolerance; then nothing is searched besides
  /// how the joints follow it.
  std::optional<TipCurve> way{};
  /// What the path begins with.
  std::optional<scene::Stretch> retreat{};
  /// Whether the first path is shortened; then only the query keeps the tip on an approach or a
  /// retreat.
  bool shortens = true;
};

/// What a search found of one of its goals.
struct GoalFigures {
  long tried = 0;      ///< attempts to find a configuration there
  long reached = 0;    ///< of them, those that found one, whatever it touches
  long exceeding = 0;  ///< of these, those at which the tip exceeds a constraint
  long clear = 0;      ///< and those that keep all constraints and the clearance asked for
  long blocked = 0;    ///< of these, those whose approach is not clear
};

/// One line: why a goal was not the one that a path leads to.
[[nodiscard]] std::string why_not(const GoalFigures& goal);

/// What a search found.
struct Path {
  /// dof × number of way-points, from the start to a configuration within the tolerances of a goal;
  /// empty: none was found. Every straight line between two of them was proved clear.
  Eigen::MatrixXd points;
  double length = 0.0;               ///< [rad or m], in the Euclidean norm
  Eigen::MatrixXd planned;           ///< what was found first, before it was shortened
  double margin_m = 0.0;             ///< the full margin that it keeps, see Settings::margin_m
  long checks = 0;                   ///< of the whole search, with steps of inverse kinematics
  long first_checks = 0;             ///< until the first path was found
  int roots = 0;                     ///< configurations at the goals
  double way_share = 0.0;            ///< of Problem::way, how much was proved
  Eigen::MatrixXd way{};             ///< as points, the part of it that was proved, if not all was
  std::size_t goal = 0;              ///< index of the one that it leads to
  std::vector<GoalFigures> goals{};  ///< of all, in their order
  long states = 0;                   ///< nodes of the trees
  std::string cause;                 ///< one line: why none was found
  [[nodiscard]] bool found() const noexcept { return points.cols() > 0; }
};

/// Sum of the Euclidean lengths of the lines between the columns [rad or m].
[[nodiscard]] double path_length(const Eigen::MatrixXd& points);

/// Searches collision-free joint paths by two trees that grow towards each other: chapter 17 of
/// docs/theory.md. The result follows from settings, problem and query alone, in any order of
/// searches, with any number of threads, each of which needs an object of its own, and in slices of
/// any size. A search allocates when it begins and when it ends; in between only trees of more than
/// 4096 nodes do.
class Search {
 public:
  /// @param model must outlive this
  /// @throws Error invalid if settings do not fit the model
  Search(const model::Model& model, Settings settings);
  /// Deleted: a temporary model is gone before any search could use it.
  Search(const model::Model&& model, Settings settings) = delete;
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;
  ~Search();

  /// Begins a search. @param query must stay as it is until the search has ended
  /// @throws Error invalid for a start or goals that do not fit the arm or are not finite
  void begin(const Problem& problem, Query& query);
  /// Continues for so many checks, and for at most a few postures or one batch of roots more.
  /// @return whether the search has ended
  bool advance(long checks);
  /// The path of a search that has ended.
  [[nodiscard]] const Path& path() const noexcept;
  /// What its lines keep; only if one was found.
  [[nodiscard]] const Margins& margins() const noexcept;
  /// begin() and advance() to the end.
  [[nodiscard]] Path search(const Problem& problem, Query& query);

  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }

 private:
  class Run;
  const model::Model& model_;
  Settings settings_;
  std::unique_ptr<Run> run_;
};

}  // namespace hamelin::search
