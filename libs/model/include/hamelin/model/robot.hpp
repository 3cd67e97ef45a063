#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::model {

using geometry::Vector6d;

enum class JointType : std::int32_t { revolute, prismatic };

struct Joint {
  std::string name;
  JointType type = JointType::revolute;
  /// S = [ω; v], spatial, in the base frame at q = 0; |ω| = 1, or ω = 0 and |v| = 1.
  Vector6d screw = Vector6d::Zero();
  std::optional<double> lower, upper;  ///< position limits [rad or m]; none = unlimited
  std::optional<double> velocity_max;  ///< [rad/s or m/s]
  std::optional<double> effort_max;    ///< [Nm or N]
  double damping = 0.0;                ///< viscous; used only if a scene enables it
  double friction = 0.0;               ///< dry friction [Nm or N]; used only if a scene enables it
  double armature = 0.0;               ///< rotor inertia at the joint [kg m² or kg]
};

/// Collision sphere. Coordinates in the link's COM frame.
struct Sphere {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  std::string part{};  ///< the link lumped into this one that has the sphere; empty: this link
};

/// Collision capsule: a sphere swept along a segment. A radius of zero makes it a line for drawings
/// and gain sets, which is not checked for collisions. Coordinates in the link's COM frame.
struct Segment {
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero(), to_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  std::string part{};  ///< as in Sphere

  [[nodiscard]] bool is_capsule() const noexcept { return radius_m > 0.0; }
};

/// One moving body and the joint that moves it.
struct Link {
  std::string name;
  int parent = -1;  ///< index of the parent link, less than the link's own; −1: the base
  Joint joint;
  geometry::SE3 com;  ///< pose of the COM frame in the base frame at q = 0
  double mass_kg = 0.0;
  /// About the COM, in the COM frame. A matrix counts as symmetric if entries across the diagonal
  /// differ by at most 1e-12 of the largest entry, as in products R I Rᵀ; the symmetric part is
  /// used.
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();
  std::vector<Sphere> spheres;
  std::vector<Segment> segments;
};

/// A frame that moves with a link.
struct Frame {
  std::string name;
  int link = 0;        ///< index of the link it moves with; −1: it is fixed to the base
  geometry::SE3 pose;  ///< in the base frame at q = 0
};

/// An open chain as a file describes it, in one form for all file formats: screws and poses in the
/// base frame at q = 0, the other quantities of a link in its COM frame (examples: data/robots).
/// `notes` lists what the reader lumped, locked or skipped, `warnings` doubtful input that it
/// accepted.
struct Robot {
  std::string name;
  std::vector<Link> links;
  Frame tip;  ///< that goals refer to; not on the base
  /// The other frames that have a name: those of the links of the file, also of links that were
  /// lumped into others or into the base.
  std::vector<Frame> frames;
  /// Spheres of fixed links, in the base frame, each with its part; for self-collision only.
  std::vector<Sphere> base_spheres;
  std::vector<Segment> base_segments;  ///< as base_spheres; capsules only
  /// Pairs of parts that never count as colliding. A part is a link, or a link of the file that was
  /// lumped into another link or into the base.
  std::vector<std::pair<std::string, std::string>> self_collision_disabled;
  std::vector<std::string> notes, warnings;

  [[nodiscard]] int dof() const noexcept { return static_cast<int>(links.size()); }
};

/// Checks what every robot must satisfy: at least one link; parents before children and no
/// branches; unit screws; for each joint, inertia about the joint in the links that it moves;
/// symmetric inertias, with positive principal moments for every link with mass; finite numbers;
/// lower < upper; one frame of each name, the tip included; each part on one body only; disabled
/// pairs that name existing parts. Principal moments that break the triangle inequality pass, since
/// the mass matrix is positive definite with them; readers warn about them.
/// @throws Error invalid: "where: link 'x': what is wrong, what was expected"
void check(const Robot& robot, const std::string& where);

/// The reason why an inertia cannot be part of a mass matrix; empty if it can.
/// @param definite whether its principal moments must be positive; otherwise they may be zero
[[nodiscard]] std::string inertia_fault(const Eigen::Matrix3d& inertia, bool definite);

/// The violation of the triangle inequality by an inertia's principal moments; empty if there is
/// none. No rigid body violates it.
[[nodiscard]] std::string triangle_fault(const Eigen::Matrix3d& inertia);

/// (I + Iᵀ)/2 for an inertia I. A symmetric I is returned bit for bit.
[[nodiscard]] Eigen::Matrix3d symmetric_part(const Eigen::Matrix3d& inertia);

}  // namespace hamelin::model
