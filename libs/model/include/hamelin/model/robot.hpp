#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::model {

using Vector6d = Eigen::Matrix<double, 6, 1>;

enum class JointType : std::int32_t { revolute, prismatic };

struct Joint {
  std::string name;
  JointType type = JointType::revolute;
  Vector6d screw = Vector6d::Zero();   ///< S = [ω; v], spatial, base frame, at q = 0; |ω| = 1, or ω = 0 and |v| = 1
  std::optional<double> lower, upper;  ///< position limits [rad or m]; none = unlimited
  std::optional<double> velocity_max;  ///< [rad/s or m/s]
  std::optional<double> effort_max;    ///< [Nm or N]
  double damping = 0.0;                ///< viscous, as the robot file gives it; used only where a scene says so
  double friction = 0.0;               ///< dry friction [Nm or N], likewise
  double armature = 0.0;               ///< rotor inertia seen at the joint [kg m² or kg]; part of the dynamics
};

/// Collision sphere. Coordinates in the link's COM frame.
struct Sphere {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  std::string part{};  ///< what was lumped into the link and bears the sphere; empty: the link itself
};

/// Collision capsule: a sphere swept along a segment. With a radius of zero a line, for drawings and gain sets, that
/// collides with nothing. Coordinates in the link's COM frame.
struct Segment {
  Eigen::Vector3d from_m = Eigen::Vector3d::Zero(), to_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  std::string part{};  ///< as a sphere's

  [[nodiscard]] bool is_capsule() const noexcept { return radius_m > 0.0; }
};

/// One moving body with the joint that carries it.
struct Link {
  std::string name;
  int parent = -1;  ///< index of the parent link, −1 for the base; always less than the link's own index
  Joint joint;
  geometry::SE3 com;  ///< pose of the COM frame in the base frame at q = 0
  double mass_kg = 0.0;
  /// About the COM, in the COM frame. What differs across the diagonal by no more than 1e-12 of the largest entry, as
  /// products R I Rᵀ do, counts as symmetric; its symmetric part is used.
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();
  std::vector<Sphere> spheres;
  std::vector<Segment> segments;
};

/// The last link's point that goals speak of.
struct Tip {
  std::string name;
  int link = 0;        ///< index of the link it moves with
  geometry::SE3 pose;  ///< in the base frame at q = 0
};

/// An open chain as a file describes it, brought to one form: screws and poses in the base frame at q = 0, everything
/// about a link in its COM frame (SPEC §1, data/robots). `notes` says what the reader lumped, locked or skipped.
struct Robot {
  std::string name;
  std::vector<Link> links;
  Tip tip;
  std::vector<Sphere> base_spheres;  ///< of what does not move: base frame, each with its part; for self-collision only
  std::vector<Segment> base_segments;  ///< likewise, capsules only
  /// Pairs of parts that never count as colliding: links, or what was lumped into one or into the base.
  std::vector<std::pair<std::string, std::string>> self_collision_disabled;
  std::vector<std::string> notes;

  [[nodiscard]] int dof() const noexcept { return static_cast<int>(links.size()); }
};

/// Checks what every robot must satisfy: at least one link, parents before children and no branches, unit screws,
/// inertia about its joint in whatever a joint moves, symmetric inertias with positive principal moments wherever there
/// is mass, finite numbers, lower < upper, each part on one body only, disabled pairs of parts that are there. Moments
/// against the triangle inequality, which no body has, make a positive definite mass matrix and pass: readers warn.
/// @throws Error invalid: "where: link 'x': what is wrong, what was expected"
void check(const Robot& robot, const std::string& where);

/// Why no mass matrix can be made of an inertia: empty if one can. `definite`: its moments must be positive, else
/// they may be zero.
[[nodiscard]] std::string inertia_fault(const Eigen::Matrix3d& inertia, bool definite);

/// How principal moments tell that no body has them: empty if one may.
[[nodiscard]] std::string triangle_fault(const Eigen::Matrix3d& inertia);

/// Begins the notes that warn.
inline constexpr std::string_view warning_prefix = "warning: ";

/// The notes that warn, without that beginning: what a reader takes though it is doubtful.
[[nodiscard]] std::vector<std::string> warnings(const Robot& robot);

/// (I + Iᵀ)/2; I itself, to the bit, if it is symmetric.
[[nodiscard]] Eigen::Matrix3d symmetric_part(const Eigen::Matrix3d& inertia);

}  // namespace hamelin::model
