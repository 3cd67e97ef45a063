#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>

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
  /// Paths and motions keep the constraints of the first goal.
  [[nodiscard]] Found find(const search::Problem& problem, GuideQuery& query);

 private:
  /// @param query of the same world, which also asks for constraints
  [[nodiscard]] Found find(const search::Problem& problem, const GuideQuery& world,
                           search::Query& query);
  void consider_others(search::Problem problem, const search::Path& first, search::Query& query);

  const model::Model& model_;
  search::Search search_;
  std::unique_ptr<PathTiming> timing_;
  long other_checks_;
};

}  // namespace hamelin::control
