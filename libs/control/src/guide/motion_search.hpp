#pragma once
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "guide/guide_query.hpp"
#include "guide/path_timing.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::control {

/// Searches a path to a goal, and makes the fastest motion that it finds along this path or along
/// others. One thread.
class MotionSearch {
 public:
  /// @param timing null: no motions are made
  /// @param other_checks that are spent on other paths
  MotionSearch(const model::Model& model, search::Settings settings,
               std::unique_ptr<PathTiming> timing, long other_checks);

  /// How many checks are worth spending on other paths: while an arm waits for them, they must not
  /// cost more time than they save.
  [[nodiscard]] static long other_checks(const scene::GuideSpec& spec);

  struct Found {
    search::Path path;  ///< that was found first
    /// null if there is none, or none is asked for
    std::unique_ptr<CertifiedPath> motion;
    Eigen::MatrixXd way_points;  ///< of the motion, before corners are rounded
    std::string cause;           ///< one line: why a path has no motion
    double lead_s = 0.0;         ///< on the clock of the other motion, when it begins there
    /// On its own clock, until when it is within the tolerances of a goal that it passes.
    double passed_by_s = 0.0;
    long checks = 0;  ///< of all
  };
  /// @param problem with the options of the goal
  /// @param way_start where the way of a goal begins that has one
  [[nodiscard]] Found find(search::Problem problem, const scene::Goal& goal,
                           const Eigen::VectorXd& way_start, GuideQuery& query);
  /// A path whose motion begins on another one, at speed. Goals must not have a way, an approach or
  /// a retreat.
  /// @param problem its start does not matter
  [[nodiscard]] Found find_on(const Lead& lead, search::Problem problem, const scene::Goal& goal,
                              GuideQuery& query);
  /// The same where the other motion leads to a goal that is passed: the corner there is rounded
  /// within the tolerances of that goal.
  /// @param lead from when on it may begin
  [[nodiscard]] Found find_past(const Lead& lead, const scene::Goal& passed,
                                search::Problem problem, const scene::Goal& goal,
                                GuideQuery& query);

 private:
  /// @param kept by the tip @param times whether a motion is made
  [[nodiscard]] Found find(const search::Problem& problem, search::TipConstraints& kept,
                           GuideQuery& query, bool times);
  /// The first search chose one of the goals: another one to its configuration only, on which the
  /// tip keeps to the approach.
  void choose(search::Problem problem, search::TipConstraints& kept, GuideQuery& query,
              Found& found);
  [[nodiscard]] Found find_after(const Lead& lead, double braking_s, search::Problem& problem,
                                 search::TipConstraints& kept, GuideQuery& query);
  /// A path and others, with the margins that they keep.
  struct Way {
    Eigen::MatrixXd points;
    search::Margins margins;
  };
  [[nodiscard]] std::vector<Way> ways(search::Problem problem, const search::Path& first,
                                      search::Query& query);
  /// By how much a place of a motion is away from a goal, in its tolerances.
  [[nodiscard]] double away(const CertifiedPath& path, double time_s, const scene::Goal& goal);
  /// From when on a motion to a goal is well within its tolerances [s].
  [[nodiscard]] double entering_s(const CertifiedPath& path, const scene::Goal& goal);
  /// Until when a motion is within the tolerances of a goal that it passes well [s]; none: it does
  /// not.
  [[nodiscard]] std::optional<double> leaving_s(const CertifiedPath& path, const scene::Goal& goal);
  [[nodiscard]] geometry::SE3 tip_at(const Eigen::VectorXd& q);
  /// Looks how fast a path is. @param from where the arm comes from straight to its first point;
  ///        of size zero: it begins there @return whether that is clear
  [[nodiscard]] bool consider(const Eigen::MatrixXd& path, const search::Margins& margins,
                              const Eigen::VectorXd& from, search::Query& query);
  /// Searches other paths, and calls `take` with each that keeps as much as the first.
  template <class Take>
  void each_other(search::Problem problem, const search::Path& first, search::Query& query,
                  const Take& take);
  void consider_others(search::Problem problem, const search::Path& first,
                       const Eigen::VectorXd& from, search::Query& query);

  const model::Model& model_;
  dynamics::Workspace ws_;
  search::Search search_;
  std::unique_ptr<PathTiming> timing_;
  long other_checks_;
  double tip_speed_m_s_ = 0.0;  ///< at most, on the way to the goal
};

}  // namespace hamelin::control
