#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "root_lanes.hpp"

namespace hamelin::search {

/// A configuration at a goal.
struct Root {
  Eigen::VectorXd q;
  double clearance = 0.0;  ///< [m]
  std::size_t goal = 0;    ///< its index
  /// dof × way-points outwards from q, to where the search begins: of a goal with an approach.
  Eigen::MatrixXd tail{};
};

/// Finds configurations within the tolerances of goals, one attempt after the other: a search
/// begins with the first root, and others join it later. Goals of the tip are tried in batches of
/// postures that take turns at them, goals and postures near the start first. docs/theory.md,
/// chapter 17
class Roots {
 public:
  /// All must outlive this.
  Roots(const model::Model& model, const dynamics::JointBox& box, const Settings& settings,
        const Eigen::VectorXd& weights);

  void begin(const Problem& problem);
  /// Whether more attempts are worth while, with so many roots.
  [[nodiscard]] bool tries(std::size_t roots) const noexcept;
  /// Whether the next attempt is one more of a batch.
  [[nodiscard]] bool in_batch() const noexcept { return steps_ > 0 || next_ < ordered_; }
  /// A root was found to be of no use, because its approach is blocked.
  void reject(const Root& root) { ++figures_[root.goal].blocked; }
  /// What was found of each goal since begin().
  [[nodiscard]] const std::vector<GoalFigures>& figures() const noexcept { return figures_; }
  /// @param root receives a clear one, with clearance above 0 @return whether there is one
  [[nodiscard]] bool attempt(Query& query, Rng& rng, Root& root);
  /// Takes a configuration that is within the tolerances of a goal and clear as a root.
  /// @return whether it is one
  [[nodiscard]] bool take(const Eigen::VectorXd& q, Query& query, Root& root);
  /// Steps of inverse kinematics, besides the checks of the query, since begin().
  [[nodiscard]] long checks() const noexcept { return checks_; }
  /// By how much a goal exceeds a constraint of the tip, of those that were tried; none: none did.
  [[nodiscard]] const std::optional<TipConstraints::Excess>& excess() const noexcept {
    return excess_;
  }

 private:
  void order_goals();
  [[nodiscard]] bool at_joints(Query& query, Rng& rng, Root& root);
  [[nodiscard]] bool at_next_goal(Query& query, Rng& rng, Root& root);
  [[nodiscard]] bool reaches(const scene::Goal& goal, const Eigen::VectorXd& q);
  /// Whether the tip keeps the query's constraints.
  [[nodiscard]] bool keeps(Query& query, const Eigen::VectorXd& q);
  void begin_batch(Query& query, Rng& rng);
  void choose_goals();
  void restrict(TipConstraints& constraints, dynamics::TipTarget& target);
  void continue_batch();
  void order_batch(unsigned near);
  [[nodiscard]] bool at_tip(Query& query, Root& root);
  [[nodiscard]] double least_clearance() const noexcept;

  const dynamics::JointBox& box_;
  const Settings& settings_;
  const Eigen::VectorXd& weights_;
  RootLanes root_lanes_;
  dynamics::InverseKinematics kinematics_;
  const model::Model& model_;
  dynamics::Workspace ws_;
  const Problem* problem_ = nullptr;
  std::vector<char> found_;           ///< joint goals that need no other root
  std::vector<GoalFigures> figures_;  ///< of all goals
  /// Indices of the goals of the joints and of the tip: poses before positions, the nearest first.
  std::vector<std::size_t> joints_, tips_;
  std::size_t poses_ = 0;  ///< of tips_
  geometry::SE3 start_tip_;
  std::size_t joint_ = 0, tip_ = 0;  ///< places in both from which the next attempts go on
  std::array<std::size_t, kernel::lanes> lane_goals_{};
  long batches_ = 0;
  std::optional<TipConstraints::Excess> excess_;
  long attempts_ = 0;
  int rounds_ = 0;  ///< how often all joint goals had their turn
  long checks_ = 0;
  int steps_ = 0;  ///< that the batch may still take towards its targets
  RootLanes::Targets targets_;
  Eigen::MatrixXd q_;                     ///< the batch
  std::array<int, kernel::lanes> order_;  ///< its postures that are worth an attempt
  int next_ = 0, ordered_ = 0;
  Eigen::VectorXd sample_;
};

}  // namespace hamelin::search
