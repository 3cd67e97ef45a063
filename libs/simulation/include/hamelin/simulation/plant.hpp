#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::simulation {

/// A simulated arm whose joints take torques. One object per run, used by one thread. The loop
/// reads its node, decides on a torque, and lets it step.
class Plant {
 public:
  /// What a plant is, for results and messages.
  struct Description {
    std::string type;        ///< as in a scene's /plant/type
    std::string name;        ///< for messages
    std::string version;     ///< of the program behind it
    std::string integrator;  ///< name of the scheme
    std::string criterion;   ///< of its solver, see integration::Integrator::criterion()
    double tolerance = 0.0;  ///< the number in the criterion
    std::string failure;     ///< why step() fails: "found no root"
    /// Whether it detects contacts itself; a judge does so in any case.
    bool detects_contacts = false;
  };
  /// Where the arm is.
  struct Node {
    long k = 0;           ///< steps since the start
    double time_s = 0.0;  ///< k times the step
    Eigen::VectorXd q, v;
  };
  /// What its own collision detection finds at the node.
  struct Contacts {
    int count = 0;           ///< pairs of shapes that touch
    double deepest_m = 0.0;  ///< smallest distance of a pair, negative inside
  };

  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;
  virtual ~Plant() = default;

  [[nodiscard]] virtual const Description& description() const noexcept = 0;
  /// Places the arm at time 0. @param q, v dof numbers each
  virtual void start(const Eigen::VectorXd& q, const Eigen::VectorXd& v) = 0;
  /// Holds a torque for a step. Allocates nothing, unless the map changes.
  /// @param step_s the same at each call
  /// @return whether it converged; if not, the node is unchanged
  [[nodiscard]] virtual bool step(const Eigen::VectorXd& torque, double step_s) = 0;
  /// From this node on the arm carries something else: the model of the setup has changed, in
  /// place.
  virtual void take_load() = 0;
  /// From this node on the map is another one. @throws Error as scene::Environment::with_change
  virtual void change_map(const scene::MapChangeSpec&) {}
  /// From this node on an obstacle of the scene, by its index, is another one.
  virtual void change_obstacle(std::size_t /*index*/, const scene::Obstacle&) {}
  /// What contacts() does not count from now on.
  virtual void allow(const scene::Allowance&) {}
  /// From this node on these wrenches act on the arm, and no others.
  virtual void push(std::span<const dynamics::ExternalWrench> wrenches) = 0;
  /// Energy at the node.
  [[nodiscard]] virtual integration::Energy energy() = 0;
  [[nodiscard]] virtual Contacts contacts() const { return {}; }
  /// Describes the deepest of contacts(): what touches what, and how deep.
  [[nodiscard]] virtual std::string describe_contact() const { return {}; }

  [[nodiscard]] const Node& node() const noexcept { return node_; }
  /// Of the last step.
  [[nodiscard]] const integration::StepReport& report() const noexcept { return report_; }

 protected:
  Plant() = default;
  Node node_;
  integration::StepReport report_;
};

/// What a plant is made from.
struct PlantSetup {
  const scene::Scene& scene;  ///< surroundings, with everything that a judge sees
  const model::Model& model;  ///< the arm with its payload and rotors; outlives the plant
  Eigen::VectorXd damping;    ///< viscous, of each joint [Nms/rad or Ns/m]
  Eigen::VectorXd friction;   ///< dry, of each joint [Nm or N]
};

/// Makes the plant of scenes whose plant is not hamelin's own.
/// @throws Error invalid for a scene that it cannot simulate
using PlantFactory = std::function<std::unique_ptr<Plant>(const PlantSetup& setup)>;

}  // namespace hamelin::simulation
