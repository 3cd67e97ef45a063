#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/judge.hpp"
#include "hamelin/sweep/make_plan.hpp"

namespace hamelin::sweep {

/// The scenes of a plan: those given, and those made of problems, clutter and gain sets, whose
/// files it writes into the folder scenes/ of the plan.
class PlanScenes {
 public:
  using Labels = std::map<std::string, std::string>;
  /// A scene file of the plan, with the labels of its runs.
  struct Entry {
    std::string name;  ///< prefix of the ids of its runs
    PlannedScene scene;
    Labels labels;
    bool gains = false;      ///< is combined with gain sets
    bool reference = false;  ///< is the reference without the obstacle
  };

  /// @param directory  of the plan; its folder scenes/ must exist
  /// @param options    kept by reference
  PlanScenes(const std::filesystem::path& directory, const PlanOptions& options)
      : directory_(directory), options_(options) {}

  /// In the order of the options. @throws Error
  [[nodiscard]] std::vector<Entry> make() &&;

 private:
  [[nodiscard]] std::filesystem::path scenes() const { return directory_ / "scenes"; }
  void add_scene(const std::string& name, const Json& document, Labels labels, bool gains = false,
                 bool reference = false);
  void add_scene_file(const std::string& name, const std::filesystem::path& file, Labels labels,
                      const std::optional<Feasibility>& known = std::nullopt, bool gains = false,
                      bool reference = false);
  void add_file(const std::filesystem::path& file);
  void add_problem(const std::filesystem::path& file, const Json& problem);
  void add_sphere_on_path(const std::filesystem::path& file, const scene::ProblemOptions& problem,
                          Labels labels);
  void let_swing(Json& sphere, const Eigen::Vector3d& swing, Labels& labels) const;
  /// The document of the base scene, with file names relative to scenes().
  [[nodiscard]] Json base_document() const;
  void add_clutter(std::size_t index);
  /// The scene with the obstacle and its reference without.
  void add_gain_scenes();

  std::filesystem::path directory_;
  const PlanOptions& options_;
  std::vector<Entry> entries_;
  std::set<std::string> names_;
};

}  // namespace hamelin::sweep
