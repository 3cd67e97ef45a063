#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "evasion_check.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/simulation/explain.hpp"
#include "shield/asides.hpp"

namespace hamelin::simulation {

/// Searches evasions from the states of a run, from its end backwards.
class EvasionSearch {
 public:
  /// The run; the last point is at the contact.
  struct Run {
    std::filesystem::path log;  ///< for messages
    const scene::Scene& scene;
    const model::Model& model;
    const std::vector<log::Trajectory::Point>& points;
    std::string obstacle;  ///< that was touched
  };
  /// @throws Error invalid if the obstacle is not in the scene; as make_environment() does
  EvasionSearch(const Run& run, const ExplainOptions& options);

  /// Fills in what the search finds.
  void run(Explanation& explanation);

 private:
  using Point = log::Trajectory::Point;

  void find_threat();
  /// Notes when each hidden obstacle came into sight.
  void find_sightings();
  [[nodiscard]] std::optional<double> known_since() const;
  [[nodiscard]] EvasionCheck::Knowledge knowledge_at(double time_s) const;
  /// Indices of the states that a search starts from, the latest first.
  [[nodiscard]] std::vector<std::size_t> starts() const;
  /// The start, and what was known there; no motion yet.
  [[nodiscard]] Explanation::Found begin(std::size_t start,
                                         std::optional<double> known_since_s) const;
  /// Tries motions from one start.
  void search_from(std::size_t start, Explanation::Found found,
                   const EvasionCheck::Knowledge& knowledge, Explanation& explanation);
  /// The n-th motion from a start.
  void propose(int n, std::size_t start, Evasion& evasion);
  [[nodiscard]] const Point& point_before(std::size_t start, double back_s) const;
  /// Whether the motion that the arm made was predicted to come within 1 cm of something.
  bool contact_predicted(std::size_t start, const EvasionCheck::Knowledge& knowledge);

  Run run_;
  const ExplainOptions& options_;
  double contact_s_, delay_s_;
  scene::Environment environment_;
  EvasionCheck check_;
  std::size_t obstacle_ = 0;
  std::vector<double> seen_since_s_;  ///< per obstacle; infinite: never
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  control::MoverCheck::Threat threat_;
  control::Asides asides_;
  Rng rng_;
};

}  // namespace hamelin::simulation
