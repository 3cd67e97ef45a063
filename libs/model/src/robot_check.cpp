#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "check_pose.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::model {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::Matrix6d;
using geometry::SE3;

// Larger numbers are typing errors or overflow when squared; real arms are far below these limits.
constexpr double length_max_m = 1e4;
constexpr double mass_max_kg = 1e9;
constexpr double inertia_max_kg_m2 = 1e15;
// Unit vectors and rotations may deviate by rounding only, since readers normalise them.
constexpr double unit_tolerance = 1e-9;
// A joint counts as having no inertia if the inertia about it with all joints outboard of it free
// is below this share of the inertia with them locked.
constexpr double inertia_share_min = 1e-14;
// The largest difference of entries across the diagonal of an inertia, as a share of the largest
// entry. Products R I Rᵀ in double precision stay below 1e-15, and chains of some hundred such
// products stay below this limit.
constexpr double asymmetry_max = 1e-12;

[[noreturn]] void fail(const std::string& where, const std::string& message) {
  throw Error(ErrorCode::invalid, formatted("{}: {}", where, message));
}

// In ascending order.
Vector3d principal_moments(const Matrix3d& inertia) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(symmetric_part(inertia),
                                                       Eigen::EigenvaluesOnly);
  return solver.eigenvalues();
}

std::string describe(const Vector3d& moments) {
  return formatted("(principal moments {:.6g}, {:.6g}, {:.6g})", moments[0], moments[1],
                   moments[2]);
}

void check_length(const Vector3d& p, const std::string& where, const char* what) {
  if (!p.allFinite() || p.cwiseAbs().maxCoeff() > length_max_m)
    fail(where, formatted("{} is ({}, {}, {}), expected finite numbers up to {} m", what, p.x(),
                          p.y(), p.z(), length_max_m));
}

void check_joint(const Joint& joint, const std::string& where) {
  const Vector3d omega = joint.screw.head<3>(), v = joint.screw.tail<3>();
  check_length(v, where, "the screw's v");
  if (joint.type == JointType::revolute) {
    if (!(std::abs(omega.norm() - 1.0) <= unit_tolerance))
      fail(where, formatted("the axis has length {}, expected 1", omega.norm()));
    if (!(std::abs(omega.dot(v)) <= unit_tolerance * (1.0 + v.norm())))
      fail(where, formatted("the screw has pitch {} m/rad, expected 0 for a revolute joint",
                            omega.dot(v)));
  } else {
    if (!omega.isZero(0.0))
      fail(where, "the screw of a prismatic joint has omega != 0, expected omega = 0");
    if (!(std::abs(v.norm() - 1.0) <= unit_tolerance))
      fail(where, formatted("the axis has length {}, expected 1", v.norm()));
  }
  for (const auto& limit : {joint.lower, joint.upper})
    if (limit && !std::isfinite(*limit))
      fail(where, formatted("a position limit is {}, expected a finite number", *limit));
  if (joint.lower && joint.upper && !(*joint.lower < *joint.upper))
    fail(where,
         formatted("lower limit {} is not below upper limit {}", *joint.lower, *joint.upper));
  if (joint.velocity_max && !(*joint.velocity_max > 0.0 && std::isfinite(*joint.velocity_max)))
    fail(where, formatted("velocity limit {}, expected a positive number", *joint.velocity_max));
  if (joint.effort_max && !(*joint.effort_max > 0.0 && std::isfinite(*joint.effort_max)))
    fail(where, formatted("effort limit {}, expected a positive number", *joint.effort_max));
  if (!(joint.damping >= 0.0 && std::isfinite(joint.damping)))
    fail(where, formatted("damping {}, expected a number of at least 0", joint.damping));
  if (!(joint.friction >= 0.0 && std::isfinite(joint.friction)))
    fail(where, formatted("friction {}, expected a number of at least 0", joint.friction));
  if (!(joint.armature >= 0.0 && joint.armature <= inertia_max_kg_m2))
    fail(where, formatted("armature {}, expected 0 to {}", joint.armature, inertia_max_kg_m2));
}

void check_body(const Link& link, const std::string& where) {
  check_pose(link.com, where, "the COM frame");
  if (!(link.mass_kg >= 0.0 && link.mass_kg <= mass_max_kg))
    fail(where, formatted("mass {} kg, expected 0 to {}", link.mass_kg, mass_max_kg));
  if (link.mass_kg > 0.0 || !link.inertia_kg_m2.isZero(0.0)) {
    const std::string fault = inertia_fault(link.inertia_kg_m2, true);
    if (!fault.empty()) fail(where, "inertia " + fault);
  }
  for (const auto& sphere : link.spheres) {
    check_length(sphere.center_m, where, "a sphere's centre");
    if (!(sphere.radius_m > 0.0 && sphere.radius_m <= length_max_m))
      fail(where,
           formatted("a sphere's radius is {} m, expected a positive number", sphere.radius_m));
  }
  for (const auto& segment : link.segments) {
    check_length(segment.from_m, where, "a segment's start");
    check_length(segment.to_m, where, "a segment's end");
    if (!(segment.radius_m >= 0.0 && segment.radius_m <= length_max_m))
      fail(where, formatted("a segment's radius is {} m, expected a number of at least 0",
                            segment.radius_m));
  }
}

// Checks that there is inertia about each joint: composite (all joints outboard locked) and
// articulated (all free). The configuration is bent to avoid accidental alignment of the joints.
void check_joint_inertia(const Robot& robot, const std::string& where) {
  const auto n = robot.links.size();
  std::vector<geometry::Vector6d> screws(n);
  std::vector<Matrix6d> bodies(n);
  SE3 moved;
  for (std::size_t i = 0; i < n; ++i) {
    const Link& link = robot.links[i];
    screws[i] = moved.Ad(link.joint.screw);
    moved = moved * SE3::exp(link.joint.screw * (0.7 + 0.1 * static_cast<double>(i % 7)));
    Matrix6d inertia = Matrix6d::Zero();
    inertia.topLeftCorner<3, 3>() = link.inertia_kg_m2;
    inertia.bottomRightCorner<3, 3>() = link.mass_kg * Matrix3d::Identity();
    const Matrix6d to_com = (moved * link.com).inverse().Ad();
    bodies[i] = to_com.transpose() * inertia * to_com;
  }
  Matrix6d composite = Matrix6d::Zero(), articulated = Matrix6d::Zero();
  for (std::size_t i = n; i-- > 0;) {
    composite += bodies[i];
    articulated += bodies[i];
    const double rotor = robot.links[i].joint.armature;
    const double locked = screws[i].dot(composite * screws[i]) + rotor;
    const geometry::Vector6d push = articulated * screws[i];
    const double free = screws[i].dot(push) + rotor;
    if (!(locked > 0.0) || !(free > inertia_share_min * locked))
      fail(where, formatted("link '{}': nothing it moves has inertia about joint '{}', expected a "
                            "positive mass or inertia",
                            robot.links[i].name, robot.links[i].joint.name));
    articulated -= push * push.transpose() / free;
  }
}

bool printable(const std::string& name) {
  return !name.empty() &&
         std::none_of(name.begin(), name.end(), [](unsigned char c) { return c < ' '; });
}

void check_frames(const Robot& robot, const std::string& where) {
  std::set<std::string> names{robot.tip.name};
  for (std::size_t i = 0; i < robot.frames.size(); ++i) {
    const Frame& frame = robot.frames[i];
    if (!printable(frame.name))
      fail(where, formatted("frame {} has no name, or a name with control characters", i));
    const std::string place = formatted("{}: frame '{}'", where, frame.name);
    if (!names.insert(frame.name).second)
      fail(place, "the name is given twice, the tip's included");
    if (frame.link < -1 || frame.link >= robot.dof())
      fail(place,
           formatted("the link's index is {}, expected -1 to {}", frame.link, robot.dof() - 1));
    check_pose(frame.pose, place, "the pose");
  }
}

// Checks that each part is on one body only and that disabled pairs name existing parts.
void check_parts(const Robot& robot, const std::string& where) {
  std::map<std::string, int> body_of;
  for (int i = 0; i < robot.dof(); ++i)
    body_of.emplace(robot.links[static_cast<std::size_t>(i)].name, i);
  const auto place = [&](const std::string& part, int body, const std::string& owner) {
    if (std::any_of(part.begin(), part.end(), [](unsigned char c) { return c < ' '; }))
      fail(where, owner + ": a shape's part has a name with control characters");
    if (body_of.emplace(part, body).first->second != body)
      fail(where, formatted("{}: part '{}' is on another link as well, expected one link per part",
                            owner, part));
  };
  for (int i = 0; i < robot.dof(); ++i) {
    const Link& link = robot.links[static_cast<std::size_t>(i)];
    for (const Sphere& sphere : link.spheres)
      if (!sphere.part.empty()) place(sphere.part, i, formatted("link '{}'", link.name));
    for (const Segment& segment : link.segments)
      if (!segment.part.empty()) place(segment.part, i, formatted("link '{}'", link.name));
  }
  for (const Sphere& sphere : robot.base_spheres) {
    if (sphere.part.empty())
      fail(where, "base_spheres: a sphere has no part, expected the name of its link");
    check_length(sphere.center_m, where + ": base_spheres", "a sphere's centre");
    if (!(sphere.radius_m > 0.0 && sphere.radius_m <= length_max_m))
      fail(where, formatted("base_spheres: a radius is {} m, expected a positive number",
                            sphere.radius_m));
    place(sphere.part, -1, "base_spheres");
  }
  for (const Segment& segment : robot.base_segments) {
    if (segment.part.empty())
      fail(where, "base_segments: a capsule has no part, expected the name of its link");
    check_length(segment.from_m, where + ": base_segments", "a capsule's start");
    check_length(segment.to_m, where + ": base_segments", "a capsule's end");
    if (!(segment.radius_m > 0.0 && segment.radius_m <= length_max_m))
      fail(where, formatted("base_segments: a radius is {} m, expected a positive number",
                            segment.radius_m));
    place(segment.part, -1, "base_segments");
  }
  std::vector<std::string> names;
  names.reserve(body_of.size());
  for (const auto& [name, body] : body_of) names.push_back(name);
  for (const auto& [a, b] : robot.self_collision_disabled)
    for (const auto& name : {a, b})
      if (body_of.count(name) == 0)
        fail(where,
             formatted("self_collision_disabled: no link '{}'{}", name, did_you_mean(name, names)));
}

}  // namespace

// Eigen's largest entry may drop a NaN, so finiteness is checked by itself.
void check_pose(const SE3& g, const std::string& where, const char* what) {
  check_length(g.p(), where, what);
  const double off = (g.R() * g.R().transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!g.R().allFinite() || !(off <= unit_tolerance) || g.R().determinant() < 0.0)
    fail(where, formatted("the rotation of {} is not a rotation matrix", what));
}

std::string inertia_fault(const Matrix3d& inertia, bool definite) {
  constexpr double definite_tolerance = 1e-12;
  if (!inertia.allFinite() || inertia.cwiseAbs().maxCoeff() > inertia_max_kg_m2)
    return formatted("has an entry that is not a finite number up to {} kg m2", inertia_max_kg_m2);
  const double asymmetry = (inertia - inertia.transpose()).cwiseAbs().maxCoeff();
  if (asymmetry > asymmetry_max * inertia.cwiseAbs().maxCoeff())
    return formatted(
        "is not symmetric: entries differ by {:.6g} kg m2 from those across the diagonal",
        asymmetry);
  const Vector3d moments = principal_moments(inertia);
  const double least = moments[0], largest = moments[2];
  if (definite ? !(least > definite_tolerance * largest)
               : least < -definite_tolerance * std::abs(largest))
    return formatted("is not positive {} {}", definite ? "definite" : "semi-definite",
                     describe(moments));
  return {};
}

std::string triangle_fault(const Matrix3d& inertia) {
  // Published figures are rounded and may miss the inequality by their last digit.
  constexpr double tolerance = 1e-4;
  const Vector3d moments = principal_moments(inertia);
  if (moments[0] + moments[1] >= (1.0 - tolerance) * moments[2]) return {};
  return formatted("breaks the triangle inequality {}: no rigid body does", describe(moments));
}

Matrix3d symmetric_part(const Matrix3d& inertia) {
  return 0.5 * (inertia + inertia.transpose());
}

void check(const Robot& robot, const std::string& where) {
  if (robot.links.empty()) fail(where, "the robot has no moving link, expected at least one");
  std::set<std::string> links, joints;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Link& link = robot.links[i];
    if (!printable(link.name) || !printable(link.joint.name))
      fail(where,
           formatted("link {}: it or its joint has no name, or a name with control characters", i));
    const std::string place = formatted("{}: link '{}'", where, link.name);
    if (!links.insert(link.name).second) fail(place, "the name is given twice");
    if (link.parent != static_cast<int>(i) - 1)
      fail(place, formatted("parent is {}, expected {}: links in order, no branches", link.parent,
                            static_cast<int>(i) - 1));
    const std::string joint_place = formatted("{}: joint '{}'", place, link.joint.name);
    if (!joints.insert(link.joint.name).second) fail(joint_place, "the name is given twice");
    check_joint(link.joint, joint_place);
    check_body(link, place);
  }
  if (robot.tip.link < 0 || robot.tip.link >= robot.dof())
    fail(where, formatted("tip: the link's index is {}, expected 0 to {}", robot.tip.link,
                          robot.dof() - 1));
  check_pose(robot.tip.pose, where + ": tip", "the pose");
  check_frames(robot, where);
  check_parts(robot, where);
  check_joint_inertia(robot, where);
}

}  // namespace hamelin::model
