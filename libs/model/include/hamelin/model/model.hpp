#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "hamelin/model/chain.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::model {

/// A robot placed in a world and prepared for the algorithms: joint-aligned frames with precomputed
/// constants, in SE(2) if the chain is planar, otherwise in SE(3). Immutable; threads may share it.
/// Scratch memory is in dynamics::Workspace.
class Model {
 public:
  /// @param base pose of the robot's base frame in the world
  /// @param gravity acceleration of free fall [m/s²], world frame
  /// @throws Error invalid as check(robot), for a base that is no pose with finite numbers up to
  ///         10⁴ m, and for gravity that is not finite
  explicit Model(Robot robot, const geometry::SE3& base = geometry::SE3{},
                 const Eigen::Vector3d& gravity = Eigen::Vector3d{0.0, 0.0, -9.81});

  [[nodiscard]] int dof() const noexcept { return robot_.dof(); }
  /// A number that only this model and its copies have; a workspace uses it to recognise the model
  /// that it was made for. An address cannot serve, since a later model may get the same one. Zero
  /// after the model was moved from.
  [[nodiscard]] std::uint64_t id() const noexcept { return identity_.value; }
  /// A hash of all numbers that the motion of the joints and its energies depend on: the joints,
  /// frames and inertias of the links, rotors, base and gravity. Equal models have the same, also
  /// if they were made one by one or read from a file again; names, limits and collision shapes do
  /// not count. Only for comparisons within one program: it may change between versions.
  [[nodiscard]] std::uint64_t fingerprint() const noexcept { return fingerprint_; }
  [[nodiscard]] const Robot& robot() const noexcept { return robot_; }
  [[nodiscard]] const geometry::SE3& base() const noexcept { return base_; }
  [[nodiscard]] const Eigen::Vector3d& gravity() const noexcept { return gravity_; }
  /// Whether all joints move in one plane; the algorithms then use SE(2).
  [[nodiscard]] bool planar() const noexcept { return std::holds_alternative<PlanarChain>(chain_); }
  /// Whether any joint is prismatic or has rotor inertia. If none is, faster sweeps are used.
  [[nodiscard]] bool has_prismatic_or_rotor() const noexcept { return has_prismatic_or_rotor_; }
  [[nodiscard]] const std::variant<SpatialChain, PlanarChain>& chain() const noexcept {
    return chain_;
  }

  /// World pose of the chain's root frame. For a planar chain its z is the plane's normal.
  [[nodiscard]] const geometry::SE3& root() const noexcept { return root_; }

  /// Pose of link i's COM frame in its joint-aligned frame (constant). The index is not checked.
  [[nodiscard]] const geometry::SE3& com_in_frame(int link) const {
    return com_in_frame_[static_cast<std::size_t>(link)];
  }
  /// Pose of the tip in its link's joint-aligned frame (constant).
  [[nodiscard]] const geometry::SE3& tip_in_frame() const noexcept {
    return frames_.front().in_link;
  }

  /// A frame that has a name.
  struct NamedFrame {
    std::string name;
    int link;               ///< that it moves with; −1: none
    geometry::SE3 in_link;  ///< pose in the link's joint-aligned frame; without link, in the world
  };
  /// The tip, then Robot::frames.
  [[nodiscard]] const std::vector<NamedFrame>& frames() const noexcept { return frames_; }
  /// Index of the tip into frames().
  static constexpr int tip_frame = 0;
  /// Index into frames().
  /// @throws Error usage for a name that no frame has, with the most similar one
  [[nodiscard]] int frame(std::string_view name) const;
  /// Index of a moving link.
  /// @throws Error usage as frame()
  [[nodiscard]] int link(std::string_view name) const;
  /// Index of a joint, which is that of the link it moves.
  /// @throws Error usage as frame()
  [[nodiscard]] int joint(std::string_view name) const;

  /// A collision shape of a link: all points within `radius` of the segment from center − half_axis
  /// to center + half_axis.
  struct Shape {
    int link;
    int index_in_link;          ///< into Link::spheres, or Link::segments if it is a capsule
    bool is_capsule;            ///< otherwise a sphere
    Eigen::Vector3d center;     ///< in the link's joint-aligned frame [m]
    Eigen::Vector3d half_axis;  ///< in the same frame [m]; zero for a sphere
    double radius;              ///< [m]
  };
  /// The collision shapes of all links, link by link: its spheres, then its capsules.
  [[nodiscard]] const std::vector<Shape>& shapes() const noexcept { return shapes_; }
  /// Whether any shape is a capsule.
  [[nodiscard]] bool has_capsules() const noexcept { return has_capsules_; }
  /// A shape's description for messages, for example "sphere 2 of link 'forearm'", or "sphere 2 of
  /// part 'cup'" for what was lumped into a link. The index is that in the link.
  /// @throws Error usage for a shape that this model does not have
  [[nodiscard]] std::string describe(const Shape& shape) const;

  /// An upper bound over all q of the distance from the base to any point of a shape or to the tip
  /// [m]. Prismatic joints contribute their limits, or 1 m without limits, so the bound is always
  /// finite. docs/theory.md (1.22).
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
  bool has_prismatic_or_rotor_ = false;
  geometry::SE3 root_;
  std::variant<SpatialChain, PlanarChain> chain_;
  std::vector<geometry::SE3> com_in_frame_;
  std::vector<NamedFrame> frames_;
  std::vector<Shape> shapes_;
  bool has_capsules_ = false;
  double reach_ = 0.0;
  std::uint64_t fingerprint_ = 0;
};

}  // namespace hamelin::model
