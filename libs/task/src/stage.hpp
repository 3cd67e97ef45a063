#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/control/world.hpp"
#include "hamelin/dynamics/workspace.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/task/task.hpp"

namespace hamelin::task {

/// What the arm holds.
struct Held {
  std::size_t object = 0;
  geometry::SE3 grasp;  ///< pose of the tip in the object's frame
  Eigen::Vector3d approach_axis = Eigen::Vector3d::UnitZ();  ///< of the tip, towards the object
  Eigen::Vector3d upright = Eigen::Vector3d::UnitZ();  ///< the object's z axis at the pick, world
  Eigen::VectorXd q;                                   ///< at which it was attached
  scene::Payload payload;
};

/// Where arm and objects are between two steps.
struct Situation {
  Eigen::VectorXd q;
  std::vector<geometry::SE3> poses;  ///< of the objects
  std::optional<Held> held;
};

/// The world of a task, in which paths are searched from one situation after the other.
class Stage {
 public:
  /// @param task must outlive this
  Stage(const Task& task, std::function<void()> poll);

  /// A path and a motion to a goal, searched with random numbers of this round.
  /// @return the way-points as columns, and which option of the goal they lead to; none: see
  /// cause()
  using Way = std::pair<Eigen::MatrixXd, std::size_t>;
  [[nodiscard]] std::optional<Way> search(const Situation& from, const scene::Goal& goal,
                                          int round);
  /// One line: why the last search found nothing.
  [[nodiscard]] const std::string& cause() const noexcept { return cause_; }

  /// The configuration of all zeros.
  [[nodiscard]] Eigen::VectorXd rest() const { return Eigen::VectorXd::Zero(bare_.dof()); }
  /// Pose of the tip in the world.
  [[nodiscard]] geometry::SE3 tip(const Eigen::VectorXd& q);
  /// The change of the map that takes out of it the objects that it has, too.
  [[nodiscard]] const std::optional<scene::MapChangeSpec>& freed() const noexcept { return freed_; }
  /// What an object that stands at one of some poses at the same place may touch while it is lifted
  /// or lowered: itself, what it stands on, and the voxels below it.
  [[nodiscard]] scene::Allowance around(std::size_t object, const std::vector<geometry::SE3>& poses,
                                        const scene::Allowance& support) const;

 private:
  [[nodiscard]] static control::World::Options options_for(const Task& task);
  void take_out_of_map();
  /// Makes the world that of a situation.
  void arrange(const Situation& situation);

  const Task& task_;
  std::function<void()> poll_;
  model::Model bare_;
  dynamics::Workspace ws_;
  control::World world_;
  std::optional<scene::MapChangeSpec> freed_;
  std::vector<bool> present_;  ///< per object: whether it is in the world
  std::string cause_;
};

}  // namespace hamelin::task
