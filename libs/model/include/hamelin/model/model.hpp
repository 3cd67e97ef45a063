#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "hamelin/model/chain.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::model {

/// A robot placed in a world, ready for the algorithms: joint-aligned frames with their constants absorbed, in SE(2)
/// where the chain is planar, else in SE(3). Immutable and shared between threads; scratch lives in
/// dynamics::Workspace.
class Model {
 public:
  /// @param base pose of the robot's base frame in the world
  /// @param gravity acceleration of free fall [m/s²], world frame
  /// @throws Error invalid, as check(robot) does
  explicit Model(Robot robot, const geometry::SE3& base = geometry::SE3{},
                 const Eigen::Vector3d& gravity = Eigen::Vector3d{0.0, 0.0, -9.81});

  [[nodiscard]] int dof() const noexcept { return robot_.dof(); }
  /// A number that this model shares with its copies only (they are equal), by which scratch knows what it was made
  /// for. An address would not do: the next model may get the same one. Zero once the model was moved from.
  [[nodiscard]] std::uint64_t id() const noexcept { return identity_.value; }
  [[nodiscard]] const Robot& robot() const noexcept { return robot_; }
  [[nodiscard]] const geometry::SE3& base() const noexcept { return base_; }
  [[nodiscard]] const Eigen::Vector3d& gravity() const noexcept { return gravity_; }
  /// Whether all joints keep one plane, so that the SE(2) path is taken.
  [[nodiscard]] bool planar() const noexcept { return std::holds_alternative<PlanarChain>(chain_); }
  /// Whether any joint slides or turns a rotor: then the sweeps ask each joint, else none.
  [[nodiscard]] bool mixed() const noexcept { return mixed_; }
  [[nodiscard]] const std::variant<SpatialChain, PlanarChain>& chain() const noexcept { return chain_; }

  /// World pose of the chain's root frame; of a planar chain its z is the plane's normal.
  [[nodiscard]] const geometry::SE3& root() const noexcept { return root_; }

  /// Pose of link i's COM frame in its joint-aligned frame (constant).
  [[nodiscard]] const geometry::SE3& com_in_frame(int link) const {
    return com_in_frame_[static_cast<std::size_t>(link)];
  }
  /// Pose of the tip in its link's joint-aligned frame (constant).
  [[nodiscard]] const geometry::SE3& tip_in_frame() const noexcept { return tip_in_frame_; }

  /// A collision shape of a link: all points within `radius` of the axis from centre − half_axis to centre + half_axis.
  struct Shape {
    int link;
    int index_in_link;          ///< into Link::spheres, or Link::segments if it is a capsule
    bool is_capsule;            ///< a sphere's axis is a point
    Eigen::Vector3d center;     ///< in the link's joint-aligned frame [m]
    Eigen::Vector3d half_axis;  ///< likewise; zero for a sphere
    double radius;              ///< [m]
  };
  /// The collision shapes of all links, link by link: its spheres, then its capsules.
  [[nodiscard]] const std::vector<Shape>& shapes() const noexcept { return shapes_; }
  /// Whether any shape is a capsule.
  [[nodiscard]] bool has_capsules() const noexcept { return has_capsules_; }
  /// A shape in words: "sphere 2 of link 'forearm'".
  [[nodiscard]] std::string words(const Shape& shape) const;

  /// An upper bound of the distance from the base to any point of any shape or the tip, over all q; infinite never:
  /// prismatic joints count their limits, unlimited ones 1 m. [m]
  [[nodiscard]] double reach() const noexcept { return reach_; }

 private:
  struct Identity {
    Identity();
    Identity(const Identity&) = default;
    Identity(Identity&& other) noexcept : value(std::exchange(other.value, 0)) {}
    Identity& operator=(const Identity&) = default;
    Identity& operator=(Identity&& other) noexcept {
      value = std::exchange(other.value, 0);
      return *this;
    }
    ~Identity() = default;
    std::uint64_t value;
  };

  Identity identity_;
  Robot robot_;
  geometry::SE3 base_;
  Eigen::Vector3d gravity_;
  bool mixed_ = false;
  geometry::SE3 root_;
  std::variant<SpatialChain, PlanarChain> chain_;
  std::vector<geometry::SE3> com_in_frame_;
  geometry::SE3 tip_in_frame_;
  std::vector<Shape> shapes_;
  bool has_capsules_ = false;
  double reach_ = 0.0;
};

}  // namespace hamelin::model
