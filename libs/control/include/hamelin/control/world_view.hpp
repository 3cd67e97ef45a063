#pragma once
#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/control/certificate.hpp"
#include "hamelin/control/line_buffer.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::control {

/// What an arm must not touch, and when.
struct Surroundings {
  const scene::Environment& environment;
  std::uint64_t snapshot;  ///< differs if the environment is another one
  double time_s;
  std::uint64_t standing = 0;  ///< differs if what stands still is another
};

/// Obstacles are searched within this distance if the planner gives no other [m].
inline constexpr double default_influence_m = 0.2;

/// The surroundings of the arm at a configuration: near points of obstacles and of its own parts,
/// the smallest clearances, and the proof that the motion between two configurations was clear of
/// both. One object per thread. After construction, only advance_map() and change_map() allocate.
class WorldView {
 public:
  /// All obstacles of a scene, those that a planner is not shown included.
  /// @param influence_m largest distance at which obstacles are found; larger distances count as
  ///        this
  /// @throws Error io, parse or invalid for a map, an obstacle, or a robot without shapes if some
  ///        are needed
  WorldView(const scene::Scene& scene, const model::Model& model, double influence_m);
  /// The same with the influence and the map of another view of the same scene, which is not read
  /// again.
  WorldView(const scene::Scene& scene, const model::Model& model, const WorldView& other);
  /// The obstacles of a world that other threads may update, as take_newest() finds them.
  /// @param scene says whether self-collision is modelled and unknown space is crossed slowly
  /// @param world must outlive this
  WorldView(const scene::Scene& scene, const model::Model& model, World& world);
  /// The surroundings of another view as they are, for the arm with another load.
  /// @param other not one of a World
  [[nodiscard]] static std::unique_ptr<WorldView> for_other_load(const scene::Scene& scene,
                                                                 const model::Model& model,
                                                                 const WorldView& other);
  WorldView(const WorldView&) = delete;
  WorldView& operator=(const WorldView&) = delete;

  /// Takes the newest snapshot of the World; results of the last look() still belong to the one
  /// before. @return whether it is another one
  bool take_newest();
  /// What may be touched from now on: it is no obstacle. With a World: what World::allow() gave the
  /// number to; 0: nothing. Results of the last look() still belong to what was allowed before.
  /// For the thread of look(). @return whether that changes what is seen
  bool allow(std::uint64_t allowance);
  /// The same without a World; allocates.
  void allow(const scene::Allowance& allowance);
  /// The number of what may be touched. Any thread.
  [[nodiscard]] std::uint64_t allowance() const noexcept { return allowance_; }
  /// Updates contacts(), self_contacts(), clearances and poses() to the configuration q. Costs
  /// nothing if the last look was at the same configuration, time and snapshot.
  void look(const Eigen::VectorXd& q, double time_s);
  /// The same without contacts, that is poses() and clearances, where all obstacles stand still and
  /// are known; a look() after it completes it.
  void glance(const Eigen::VectorXd& q, double time_s);
  /// Makes the configuration of the last look() the start of the motion for certify().
  void depart(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// Whether the motion from the configuration of depart() to that of the last look() was clear,
  /// see Certificate.
  /// @param q the configuration of the last look() @param v velocity with which it was reached
  [[nodiscard]] Certificate::Verdict certify(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// Changes the map at once; only without a World. Results of the last look() still belong to the
  /// old map. @throws Error io, parse or invalid
  void change_map(const scene::MapChangeSpec& change);
  /// The same for one obstacle.
  void change_obstacle(std::size_t index, const scene::Obstacle& obstacle);
  /// Applies the changes of the map that are due. Results of the last look() still belong to the
  /// old map.
  /// @return one line that describes them; empty if none was due
  [[nodiscard]] std::string advance_map();

  /// The near points that a planner is shown: shapes in order, nearest first within a shape.
  [[nodiscard]] std::span<const scene::Contact> contacts() const noexcept {
    return {contacts_.data(), contact_count_};
  }
  [[nodiscard]] std::span<const scene::SelfContact> self_contacts() const noexcept {
    return {self_contacts_.data(), self_contact_count_};
  }
  /// Contacts at another configuration, with the obstacles where they were at the last look(), or
  /// so long after it by what is known of their future. Only those that move are found beyond
  /// influence_m().
  /// @return how many there are; the nearest out.size() of them are written
  std::size_t closest(const Eigen::VectorXd& q, double influence_m, std::span<scene::Contact> out,
                      double ahead_s = 0.0, scene::Among among = scene::Among::all);
  std::size_t closest_self(const Eigen::VectorXd& q, double influence_m,
                           std::span<scene::SelfContact> out);
  /// The deepest contact of `shapes` at time 0 with obstacles that never move, seen or not.
  /// @return false if there is none
  [[nodiscard]] bool deepest_at_start(const scene::Shapes& shapes, scene::Contact& deepest);
  /// The deepest contact of two parts at the configuration of `shapes`. @return false if there is
  /// none
  [[nodiscard]] bool deepest_self(const scene::Shapes& shapes, scene::SelfContact& deepest);
  /// The arm's shapes at a configuration, valid until the next call of this, closest() or
  /// closest_self().
  [[nodiscard]] scene::Shapes place(const Eigen::VectorXd& q);

  /// Poses of the links at the configuration of the last look().
  [[nodiscard]] const dynamics::Workspace& poses() const noexcept { return poses_; }
  /// The arm's shapes there, in the world.
  [[nodiscard]] scene::Shapes arm() const noexcept { return arm_.view(); }

  /// Clearance to all obstacles, also those that the planner is not shown; at most the influence
  /// [m].
  [[nodiscard]] double clearance_m() const noexcept { return clearance_now_; }
  [[nodiscard]] double self_clearance_m() const noexcept { return self_clearance_now_; }
  /// The same to all that there is at the last look(), including what may be touched.
  [[nodiscard]] double whole_clearance_m() const;
  [[nodiscard]] bool touching() const noexcept {
    return (has_obstacles() && clearance_now_ <= 0.0) || (has_self() && self_clearance_now_ <= 0.0);
  }
  /// The nearest of all obstacle points; null if all are farther than the influence.
  [[nodiscard]] const scene::Contact* nearest() const noexcept {
    return nearest_.sphere >= 0 ? &nearest_ : nullptr;
  }
  /// Describes the contact at the last look(): what touches what, how deep, when, and the exit
  /// direction.
  [[nodiscard]] std::string describe_contact() const;
  /// The contact of a load, in short and without allocating, at the end of a line.
  void describe_contact(LineBuffer& line) const;
  /// Obstacles that became visible at the last look(), as indices into environment().obstacles().
  [[nodiscard]] std::span<const int> revealed() const noexcept { return revealed_; }
  /// 1, or less if the arm is in unknown space that is to be crossed slowly.
  [[nodiscard]] double speed_scale() const noexcept { return speed_scale_; }

  [[nodiscard]] bool has_obstacles() const noexcept { return environment_->has_obstacles(); }
  /// Whether self-collision is modelled.
  [[nodiscard]] bool has_self() const noexcept { return self_ != nullptr; }
  /// That of the last look().
  [[nodiscard]] const scene::Environment& environment() const noexcept { return *environment_; }
  /// The number of the snapshot that the last look() saw; zero without a World.
  [[nodiscard]] std::uint64_t snapshot() const noexcept { return snapshot_; }
  /// The same of what stands still: WorldSnapshot::standing.
  [[nodiscard]] std::uint64_t standing() const noexcept { return standing_; }
  /// The id of an obstacle of environment(), which is its index without a World. `obstacle` may be
  /// that of a contact, also the map or unknown space.
  [[nodiscard]] std::int32_t obstacle_id(int obstacle) const noexcept {
    return obstacle < 0 || ids_.empty() ? obstacle : ids_[static_cast<std::size_t>(obstacle)];
  }
  /// The ids of environment().obstacles(); empty without a World.
  [[nodiscard]] std::span<const std::int32_t> obstacle_ids() const noexcept { return ids_; }
  [[nodiscard]] const scene::SelfField* self_field() const noexcept { return self_.get(); }
  [[nodiscard]] double influence_m() const noexcept { return influence_; }
  [[nodiscard]] double self_influence_m() const noexcept { return self_influence_; }
  /// The largest number of contacts that look() can find.
  [[nodiscard]] std::size_t contacts_max() const noexcept { return contacts_.size(); }
  [[nodiscard]] std::size_t self_contacts_max() const noexcept { return self_contacts_.size(); }

 private:
  struct Own {
    Own(scene::Environment&& of, std::size_t shapes)
        : environment(std::move(of)), scratch(environment, shapes) {}
    scene::Environment environment;
    scene::Environment::Scratch scratch;
    scene::Allowance allowance;
    std::optional<scene::Environment> whole;  ///< with what may be touched, if anything
  };
  [[nodiscard]] scene::Environment& all_of_it() noexcept;
  void take_world(scene::Environment environment);
  void leave_out_allowed();
  WorldView(const scene::Scene& scene, const model::Model& model, double influence_m,
            std::optional<Own> own, World* world, std::size_t contacts_max);
  void see(World::View& view);
  /// @return whether the arm was elsewhere
  bool place_arm(const Eigen::VectorXd& q, double time_s);
  void measure_clearances();
  void update_obstacle_contacts();
  void update_self_contacts();
  void reveal_visible();
  std::size_t find(scene::View view, std::span<scene::Contact> out);
  void update_clearances(std::span<const scene::Contact> contacts);

  const model::Model& model_;
  std::optional<Own> own_;                 ///< without a World
  World* world_;                           ///< null without one
  std::optional<World::View> first_view_;  ///< of the world; kept, since ticks free no memory
  const scene::Environment* environment_ = nullptr;
  const scene::Environment* whole_ = nullptr;  ///< with what may be touched
  std::atomic<std::uint64_t> allowance_{0};
  scene::Environment::Scratch* scratch_ = nullptr;
  std::span<const std::int32_t> ids_;
  std::uint64_t snapshot_ = 0, standing_ = 0;
  std::unique_ptr<scene::SelfField> self_;  ///< null if self-collision is not modelled
  double influence_, self_influence_ = 0.0;
  std::unique_ptr<Certificate> certificate_;
  bool slow_in_unknown_ = false;
  bool hidden_obstacles_ = false;   ///< whether some obstacles may be hidden from the planner
  std::vector<std::uint8_t> seen_;  ///< see Environment::reveal_visible
  std::vector<int> revealed_;

  // at the configuration of the last look()
  /// Whether the following belongs to q_, time_s_ and environment_, without contacts or with them.
  bool current_ = false, has_contacts_ = false;
  Eigen::VectorXd q_;
  dynamics::Workspace poses_;
  double time_s_ = 0.0;
  std::vector<scene::Contact> contacts_, other_contacts_;
  std::vector<scene::SelfContact> self_contacts_;
  std::size_t contact_count_ = 0, self_contact_count_ = 0;
  scene::PlacedShapes arm_;
  std::vector<double> clearance_, self_clearance_;  ///< per shape, per pair of parts
  double clearance_now_ = 0.0, self_clearance_now_ = 0.0, speed_scale_ = 1.0;
  int nearest_pair_ = -1;
  scene::Contact nearest_;  ///< sphere −1: nothing is near

  // at the configuration from which the motion is certified
  double time_before_s_ = 0.0;
  Eigen::VectorXd q_before_, v_before_;
  scene::PlacedShapes arm_before_;
  std::vector<double> clearance_before_, self_clearance_before_;

  scene::Environment::Vicinity vicinity_;  ///< of the arm at the last look()

  // for queries at other configurations
  Eigen::VectorXd query_q_;  ///< of the arm below, if it is placed
  bool query_placed_ = false;
  dynamics::Workspace query_poses_;
  scene::PlacedShapes query_arm_;
};

}  // namespace hamelin::control
