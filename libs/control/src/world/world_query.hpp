#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hamelin/control/certificate.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::control {

/// Answers questions about a world at any configuration and time, on the snapshot of the last
/// refresh(). One thread at a time may use an object; several work in parallel, also while the
/// world changes and the control loop runs. Only the constructor, refresh() and boxes() allocate.
/// Configurations are dof numbers each.
class WorldQuery {
 public:
  /// @param view of the world: says up to which distances obstacles and parts of the arm are found
  /// All must outlive this.
  WorldQuery(const model::Model& model, const World& world, const WorldView& view);
  WorldQuery(const WorldQuery&) = delete;
  WorldQuery& operator=(const WorldQuery&) = delete;

  /// Takes the newest snapshot; to be called once before anything else. @return its number
  /// @param allowance leaves out what may be touched, see World::allow()
  std::uint64_t refresh(std::uint64_t allowance = 0);
  [[nodiscard]] const WorldSnapshot& snapshot() const noexcept { return *snapshot_; }
  [[nodiscard]] std::size_t dof() const noexcept { return static_cast<std::size_t>(q_.size()); }

  /// The smallest distance of the arm from obstacles, and from itself where that is modelled; at
  /// most the world's influence [m]. Ends at the first distance below `at_least_m`.
  [[nodiscard]] double clearance(const double* q, const scene::Moment& moment, double at_least_m);
  /// @return how many contacts there are, even if out is smaller; then the nearest are written
  std::size_t contacts(const double* q, const scene::Moment& moment, double influence_m,
                       const planning::ArrayOut<hamelin_contact>& out);
  std::size_t self_contacts(const double* q, double influence_m,
                            const planning::ArrayOut<hamelin_self_contact>& out);
  /// Whether the straight joint motion from q0 at now + t0 to q1 at now + t1 is proved clear, see
  /// Certificate.
  /// @param margin_m a lower bound of all distances if it is
  [[nodiscard]] bool motion_clear(const double* q0, const double* q1, double now_s, double t0_s,
                                  double t1_s, double& margin_m);
  /// Distance of a point of the world from the nearest obstacle, at most `limit_m`.
  /// @param gradient of the distance; zero at the limit
  [[nodiscard]] double distance(const Eigen::Vector3d& point, const scene::Moment& moment,
                                double limit_m, Eigen::Vector3d& gradient);
  /// The boxes of the map, and of unknown space that blocks, that meet a region of the world.
  std::size_t boxes(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                    const planning::ArrayOut<hamelin_box>& out);

 private:
  /// The arm at one end of a piece of a motion.
  struct Node {
    explicit Node(const model::Model& model) : arm(model) {}
    Eigen::VectorXd q;
    scene::Moment moment{0.0};
    scene::PlacedShapes arm;
    std::vector<double> clearance, pairs;
  };
  [[nodiscard]] scene::Shapes place(const double* q);
  /// Measures all clearances at node.q and node.moment. @return whether there is no contact
  [[nodiscard]] bool measure(Node& node);
  [[nodiscard]] Certificate::Node end_of(const Node& node) const;

  const model::Model& model_;
  const World& world_;
  const scene::SelfField* self_;  ///< null if self-collision is not modelled
  double influence_, self_influence_;
  std::shared_ptr<const WorldSnapshot> snapshot_;
  scene::Environment::Scratch scratch_;
  Certificate certificate_;
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  Eigen::VectorXd q_, dq_, rest_;
  Node from_, to_;
  std::vector<scene::Contact> contacts_;
  std::vector<scene::SelfContact> self_contacts_;
  std::vector<std::int32_t> boxes_;
};

}  // namespace hamelin::control
