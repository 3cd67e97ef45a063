#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::search {

/// A configuration at a goal.
struct Root {
  Eigen::VectorXd q;
  double clearance = 0.0;  ///< [m]
};

/// Finds configurations within the tolerances of goals, one attempt after the other: a search
/// begins with the first root, and others join it later. docs/theory.md, chapter 17
class Roots {
 public:
  /// All must outlive this.
  Roots(const model::Model& model, const dynamics::JointBox& box, const Settings& settings);

  void begin(const Problem& problem);
  /// Whether more attempts are worth while, with so many roots.
  [[nodiscard]] bool tries(std::size_t roots) const noexcept;
  /// @param root receives a clear one, with clearance above 0 @return whether there is one
  [[nodiscard]] bool attempt(Query& query, Rng& rng, Root& root);

 private:
  [[nodiscard]] bool at_joints(const scene::Goal& goal, int attempt, Query& query, Rng& rng,
                               Root& root) const;
  [[nodiscard]] bool at_tip(const scene::Goal& goal, int attempt, Query& query, Rng& rng,
                            Root& root);
  [[nodiscard]] double clearance_of_attempt(int attempt) const noexcept;

  const dynamics::JointBox& box_;
  const Settings& settings_;
  dynamics::InverseKinematics kinematics_;
  const Problem* problem_ = nullptr;
  Eigen::VectorXd q_;
  std::vector<char> found_;  ///< joint goals that need no other root
  int attempt_ = 0;
};

}  // namespace hamelin::search
