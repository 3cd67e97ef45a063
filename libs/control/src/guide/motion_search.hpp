#pragma once
#include <Eigen/Core>
#include <memory>
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
    long checks = 0;             ///< of all
  };
  /// @param problem with the options of the goal
  /// @param way_start where the way of a goal begins that has one
  [[nodiscard]] Found find(search::Problem problem, const scene::Goal& goal,
                           const Eigen::VectorXd& way_start, GuideQuery& query);

 private:
  /// @param kept by the tip @param times whether a motion is made
  [[nodiscard]] Found find(const search::Problem& problem, search::TipConstraints& kept,
                           GuideQuery& query, bool times);
  /// The first search chose one of the goals: another one to its configuration only, on which the
  /// tip keeps to the approach.
  void choose(search::Problem problem, search::TipConstraints& kept, GuideQuery& query,
              Found& found);
  [[nodiscard]] geometry::SE3 tip_at(const Eigen::VectorXd& q);
  void consider_others(search::Problem problem, const search::Path& first, search::Query& query);

  const model::Model& model_;
  dynamics::Workspace ws_;
  search::Search search_;
  std::unique_ptr<PathTiming> timing_;
  long other_checks_;
  double tip_speed_m_s_ = 0.0;  ///< at most, on the way to the goal
};

}  // namespace hamelin::control
