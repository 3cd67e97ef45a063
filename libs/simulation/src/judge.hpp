#pragma once
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "constraint_audit.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/plant.hpp"

namespace hamelin::simulation {

/// Watches a run with all obstacles in sight: whether the arm touches anything at a node or on the
/// way there, and how near it comes. It has no part in decisions.
class Judge {
 public:
  /// @param model the arm as it is, kept by reference, as are the others
  /// @param controllers what the controller sees: judged by that if nothing is hidden from it; null
  ///        if that is not known
  Judge(const scene::Scene& scene, const model::Model& model, Plant& plant,
        control::WorldView* controllers);

  [[nodiscard]] control::WorldView& view() noexcept { return *view_; }
  /// Whether its view is not the controller's.
  [[nodiscard]] bool has_own_view() const noexcept { return own_ != nullptr; }

  /// Looks at the node that the last step reached, and proves that the step stayed clear.
  void observe_node();
  /// The arm leaves the node. @param v velocity with which it does
  void depart(const Eigen::VectorXd& v);
  /// The world has changed at this node, as the scene says by now. @return what, or nothing
  [[nodiscard]] std::string advance_map();
  void change_map(const scene::MapChangeSpec& change) { own_->change_map(change); }
  void change_obstacle(std::size_t index, const scene::Obstacle& obstacle) {
    own_->change_obstacle(index, obstacle);
  }
  /// The arm carries something else: its model has changed, in place.
  void take_load();
  /// Goal `index` may touch something from this node on, or, where it is null, nothing.
  void allow(const scene::Allowance* may_touch, std::size_t goal);
  /// Looks at the node again after such a change.
  void look_again();

  /// Whether the step to this node was proved clear.
  [[nodiscard]] bool certified() const noexcept { return certified_; }
  /// Whether the arm touches anything at this node.
  [[nodiscard]] bool touching() const noexcept { return touching_; }
  /// The same, or the plant counts a contact there.
  [[nodiscard]] bool in_contact() const noexcept { return touching_ || contacts_.count > 0; }
  /// Describes a contact on the way to this node; empty if there was none.
  [[nodiscard]] const std::string& contact_on_the_way() const noexcept { return on_the_way_; }
  /// Describes the contact at this node, and who counted it if the plant counts, too.
  [[nodiscard]] std::string describe_contact() const;
  /// Why a run cannot start in contact, and what would help.
  [[nodiscard]] std::string describe_refusal() const;
  /// Describes the contact with an obstacle that moves or appears; none if it is with something
  /// else.
  [[nodiscard]] std::optional<log::Result::MoverContact> mover_contact() const;
  /// Describes goals at which the arm touches something.
  [[nodiscard]] std::vector<std::string> describe_goals_in_contact();

  /// Counts the contacts of this node for the result, if the plant counts, too.
  void count_contacts(log::Result& result) const;
  void fill(log::Result& result) const;

 private:
  void certify();
  /// Notes by how much joints are beyond their limits.
  void note_limits();
  void note_clearance();

  const scene::Scene& scene_;
  const model::Model& model_;
  Plant& plant_;
  control::ModelledLimits limits_;
  bool certifies_;                           ///< whether the scene asks for proofs
  std::unique_ptr<control::WorldView> own_;  ///< null if the controller sees all as it is
  control::WorldView* view_;                 ///< that, or the controller's
  bool certified_ = true, touching_ = false;
  std::string on_the_way_;
  std::size_t goal_ = 0;  ///< the current one
  ConstraintAudit constraints_;
  scene::Allowance may_touch_;                  ///< that of the current goal
  std::vector<log::Result::MayTouch> allowed_;  ///< the last one is in force, if any is
  Plant::Contacts contacts_;                    ///< by the plant
  double min_clearance_ = 0.0, min_self_clearance_ = 0.0;
  long certified_steps_ = 0, checked_steps_ = 0;
  std::optional<double> tightest_step_m_, position_excess_, speed_excess_;
};

}  // namespace hamelin::simulation
