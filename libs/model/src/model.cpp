#include "hamelin/model/model.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <optional>

#include "check_pose.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/core/text.hpp"

namespace hamelin::model {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::SE3;
using geometry::Vec3;

// Two directions count as parallel if the sine of the angle between them is below this.
constexpr double parallel_sine = 1e-14;
// A chain counts as planar if its axes deviate by less than this. It is larger than parallel_sine
// because numbers in files are rounded more than doubles.
constexpr double planar_sine = 1e-9;

Vec3<double> small(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

Vector3d axis_of(const Joint& joint) {
  return joint.type == JointType::revolute ? joint.screw.head<3>() : joint.screw.tail<3>();
}

// The point nearest to `near` on the axis of a revolute joint, whose screw is [ω; −ω × r] with a
// point r of the axis. `near` itself for a prismatic joint.
Vector3d origin_near(const Joint& joint, const Vector3d& near) {
  if (joint.type == JointType::prismatic) return near;
  const Vector3d w = joint.screw.head<3>();
  const Vector3d foot = w.cross(joint.screw.tail<3>());  // |ω| = 1
  return foot + w * w.dot(near - foot);
}

Vector3d any_normal(const Vector3d& z) {
  const Vector3d least = std::abs(z.x()) <= std::abs(z.y()) && std::abs(z.x()) <= std::abs(z.z())
                             ? Vector3d::UnitX()
                         : std::abs(z.y()) <= std::abs(z.z()) ? Vector3d::UnitY()
                                                              : Vector3d::UnitZ();
  return (least - z * z.dot(least)).normalized();
}

double angle_about(const Vector3d& axis, const Vector3d& from, const Vector3d& to) {
  return std::atan2(axis.dot(from.cross(to)), from.dot(to));
}

// A link's inertia about the origin of `frame`, in its axes. Both `frame` and the link's COM pose
// are given in the base frame. docs/theory.md (1.19).
Matrix3d inertia_in(const SE3& frame, const Link& link) {
  const SE3 com = frame.inverse() * link.com;
  const Vector3d& c = com.p();
  return com.R() * link.inertia_kg_m2 * com.R().transpose() +
         link.mass_kg * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
}

SE3 frame_of(const Vector3d& x, const Vector3d& z, const Vector3d& origin) {
  Matrix3d R;
  R.col(0) = x;
  R.col(1) = z.cross(x);
  R.col(2) = z;
  return {R, origin};
}

// The plane's normal if all joints move in one plane.
std::optional<Vector3d> plane_normal(const Robot& robot) {
  std::optional<Vector3d> normal;
  for (const auto& link : robot.links)
    if (link.joint.type == JointType::revolute && !normal) normal = link.joint.screw.head<3>();
  if (!normal) return std::nullopt;
  for (const auto& link : robot.links) {
    const Vector3d axis = axis_of(link.joint);
    const double off = link.joint.type == JointType::revolute ? normal->cross(axis).norm()
                                                              : std::abs(normal->dot(axis));
    if (off > planar_sine) return std::nullopt;
  }
  return normal;
}

// Joint-aligned frames at q = 0 in the base frame: the root first, then one per link.
std::vector<SE3> spatial_frames(const Robot& robot) {
  const auto& links = robot.links;
  std::vector<SE3> frames;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const Vector3d z = axis_of(links[i].joint);
    const Vector3d origin = origin_near(links[i].joint, links[i].com.p());
    const Vector3d before = i == 0 ? any_normal(z) : Vector3d(frames.back().R().col(0));
    Vector3d x = before - z * z.dot(before);
    x = x.norm() > 0.5 ? Vector3d(x.normalized()) : any_normal(z);
    if (i + 1 < links.size()) {
      const Vector3d normal = z.cross(axis_of(links[i + 1].joint));
      if (normal.norm() > parallel_sine) {
        x = normal.normalized();
        x = (x - z * z.dot(x)).normalized();
      }
    }
    frames.push_back(frame_of(x, z, origin));
  }
  frames.insert(frames.begin(), frames.front());
  return frames;
}

SpatialChain spatial_chain(const Robot& robot, const std::vector<SE3>& frames, const SE3& base,
                           const Vector3d& gravity) {
  SpatialChain chain;
  const SE3 root = base * frames[0];
  chain.gravity = small(root.R().transpose() * gravity);
  chain.potential_constant = 0.0;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Link& link = robot.links[i];
    const SE3& parent = frames[static_cast<std::size_t>(link.parent + 1)];
    const SE3& frame = frames[i + 1];
    const Vector3d x_parent = parent.R().col(0), z_parent = parent.R().col(2);
    const Vector3d x = frame.R().col(0), z = frame.R().col(2);
    const double alpha = angle_about(x_parent, z_parent, z);
    const Matrix3d I = inertia_in(frame, link);
    SpatialLink out{};
    out.parent = link.parent;
    out.prismatic = link.joint.type == JointType::prismatic;
    out.cos_alpha = std::cos(alpha);
    out.sin_alpha = std::sin(alpha);
    out.offset = angle_about(z, x_parent, x);
    out.p0 = small(parent.R().transpose() * (frame.p() - parent.p()));
    out.armature = link.joint.armature;
    out.mass = link.mass_kg;
    out.moment = small(link.mass_kg * (frame.inverse() * link.com.p()));
    out.inertia = {I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2)};
    chain.potential_constant -= link.mass_kg * gravity.dot(root.p());
    chain.links.push_back(out);
  }
  return chain;
}

// Planar frames: z is the normal and all origins are in the root's plane. Out-of-plane offsets are
// kept in com_in_frame.
std::vector<SE3> planar_frames(const Robot& robot, const Vector3d& normal) {
  std::vector<SE3> frames;
  const Vector3d root = origin_near(robot.links[0].joint, robot.links[0].com.p());
  const auto in_plane = [&](const Vector3d& p) -> Vector3d {
    return p - normal * normal.dot(p - root);
  };
  for (const auto& link : robot.links) {
    const bool prismatic = link.joint.type == JointType::prismatic;
    Vector3d x = prismatic ? axis_of(link.joint) : any_normal(normal);
    x = (x - normal * normal.dot(x)).normalized();
    frames.push_back(frame_of(x, normal, in_plane(origin_near(link.joint, link.com.p()))));
  }
  frames.insert(frames.begin(), frame_of(any_normal(normal), normal, root));
  return frames;
}

PlanarChain planar_chain(const Robot& robot, const std::vector<SE3>& frames, const SE3& base,
                         const Vector3d& gravity) {
  PlanarChain chain;
  const SE3 root = base * frames[0];
  const Vector3d g = root.R().transpose() * gravity;
  chain.gravity_x = g.x();
  chain.gravity_y = g.y();
  chain.potential_constant = 0.0;
  const Vector3d normal = frames[0].R().col(2);
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Link& link = robot.links[i];
    const SE3& parent = frames[static_cast<std::size_t>(link.parent + 1)];
    const SE3& frame = frames[i + 1];
    const Vector3d p0 = parent.R().transpose() * (frame.p() - parent.p());
    const Vector3d c = frame.inverse() * link.com.p();
    PlanarLink out{};
    out.parent = link.parent;
    out.prismatic = link.joint.type == JointType::prismatic;
    out.direction = out.prismatic || normal.dot(axis_of(link.joint)) > 0.0 ? 1.0 : -1.0;
    out.offset = angle_about(normal, parent.R().col(0), frame.R().col(0));
    out.p0x = p0.x();
    out.p0y = p0.y();
    out.armature = link.joint.armature;
    out.mass = link.mass_kg;
    out.moment_x = link.mass_kg * c.x();
    out.moment_y = link.mass_kg * c.y();
    out.inertia = inertia_in(frame, link)(2, 2);
    chain.potential_constant -= link.mass_kg * (gravity.dot(root.p()) + g.z() * c.z());
    chain.links.push_back(out);
  }
  return chain;
}

double reach_of(const Robot& robot, const std::vector<SE3>& frames) {
  // The sum of the distances between successive frames bounds the distance from the base for all q.
  double to_frame = frames[1].p().norm(), reach = 0.0;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Link& link = robot.links[i];
    if (i > 0) to_frame += (frames[i + 1].p() - frames[i].p()).norm();
    if (link.joint.type == JointType::prismatic)
      to_frame += std::max(std::abs(link.joint.lower.value_or(-1.0)),
                           std::abs(link.joint.upper.value_or(1.0)));
    const auto farthest = [&](const Vector3d& point_base, double radius) {
      reach = std::max(reach, to_frame + (point_base - frames[i + 1].p()).norm() + radius);
    };
    for (const auto& s : link.spheres) farthest(link.com * s.center_m, s.radius_m);
    for (const auto& s : link.segments) {
      farthest(link.com * s.from_m, s.radius_m);
      farthest(link.com * s.to_m, s.radius_m);
    }
    if (robot.tip.link == static_cast<int>(i)) farthest(robot.tip.pose.p(), 0.0);
  }
  return reach;
}

// FNV-1a over 64-bit words, with a shift because a product carries nothing to lower bits.
class Hash {
 public:
  Hash& add(std::uint64_t word) {
    value_ = (value_ ^ word) * 0x100000001b3U;
    value_ ^= value_ >> 32;
    return *this;
  }
  Hash& add(double number) { return add(std::bit_cast<std::uint64_t>(number + 0.0)); }  // no −0
  Hash& add(const SE3& pose) {
    for (const double x : pose.R().reshaped()) add(x);
    for (const double x : pose.p()) add(x);
    return *this;
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

void add(Hash& hash, const SpatialChain& chain) {
  hash.add(chain.gravity.x).add(chain.gravity.y).add(chain.gravity.z);
  for (const SpatialLink& l : chain.links) {
    hash.add(std::uint64_t{l.prismatic}).add(l.cos_alpha).add(l.sin_alpha).add(l.offset);
    hash.add(l.p0.x).add(l.p0.y).add(l.p0.z).add(l.armature).add(l.mass);
    hash.add(l.moment.x).add(l.moment.y).add(l.moment.z);
    const auto& I = l.inertia;
    hash.add(I.xx).add(I.xy).add(I.xz).add(I.yy).add(I.yz).add(I.zz);
  }
}
void add(Hash& hash, const PlanarChain& chain) {
  hash.add(chain.gravity_x).add(chain.gravity_y);
  for (const PlanarLink& l : chain.links) {
    hash.add(std::uint64_t{l.prismatic}).add(l.direction).add(l.offset).add(l.p0x).add(l.p0y);
    hash.add(l.armature).add(l.mass).add(l.moment_x).add(l.moment_y).add(l.inertia);
  }
}

void check_placement(const std::string& robot, const SE3& base, const Vector3d& gravity) {
  check_pose(base, robot, "the base");
  if (!gravity.allFinite())
    throw Error(ErrorCode::invalid,
                formatted("{}: gravity is ({}, {}, {}), expected finite numbers", robot,
                          gravity.x(), gravity.y(), gravity.z()));
}

template <class List, class NameOf>
int index_of(const char* what, std::string_view name, const std::string& robot, const List& list,
             const NameOf& name_of) {
  constexpr std::size_t listed_max = 30;
  for (std::size_t i = 0; i < list.size(); ++i)
    if (name_of(list[i]) == name) return static_cast<int>(i);
  std::vector<std::string> names;
  names.reserve(list.size());
  for (const auto& each : list) names.push_back(name_of(each));
  const std::string similar = did_you_mean(name, names);
  const std::size_t more = names.size() - std::min(names.size(), listed_max);
  names.resize(names.size() - more);
  throw Error(
      ErrorCode::usage,
      formatted("'{}' has no {} '{}', expected one of {}{}{}", robot, what, name,
                joined(names, ", "), more > 0 ? formatted(" and {} more", more) : "", similar));
}

}  // namespace

Model::Identity::Identity() {
  static std::atomic<std::uint64_t> models{0};
  value = ++models;
}

Model::Model(Robot robot, const SE3& base, const Vector3d& gravity)
    : robot_(std::move(robot)), base_(base), gravity_(gravity) {
  check(robot_, robot_.name);
  check_placement(robot_.name, base_, gravity_);
  for (Link& link : robot_.links) link.inertia_kg_m2 = symmetric_part(link.inertia_kg_m2);
  std::vector<SE3> frames;
  if (const auto normal = plane_normal(robot_)) {
    frames = planar_frames(robot_, *normal);
    chain_ = planar_chain(robot_, frames, base_, gravity_);
  } else {
    frames = spatial_frames(robot_);
    chain_ = spatial_chain(robot_, frames, base_, gravity_);
  }
  root_ = base_ * frames[0];
  has_prismatic_or_rotor_ =
      std::any_of(robot_.links.begin(), robot_.links.end(), [](const Link& link) {
        return link.joint.type == JointType::prismatic || link.joint.armature != 0.0;
      });
  for (std::size_t i = 0; i < robot_.links.size(); ++i) {
    const Link& link = robot_.links[i];
    com_in_frame_.push_back(frames[i + 1].inverse() * link.com);
    const SE3& com = com_in_frame_.back();
    for (std::size_t s = 0; s < link.spheres.size(); ++s)
      shapes_.push_back({static_cast<int>(i), static_cast<int>(s), false,
                         com * link.spheres[s].center_m, Vector3d::Zero(),
                         link.spheres[s].radius_m});
    for (std::size_t s = 0; s < link.segments.size(); ++s) {
      const Segment& segment = link.segments[s];
      if (!segment.is_capsule()) continue;
      has_capsules_ = true;
      shapes_.push_back({static_cast<int>(i), static_cast<int>(s), true,
                         com * (0.5 * (segment.from_m + segment.to_m)),
                         com.R() * (0.5 * (segment.to_m - segment.from_m)), segment.radius_m});
    }
  }
  const auto add_frame = [&](const Frame& frame) {
    const SE3 in_link =
        frame.link < 0 ? base_ * frame.pose
                       : frames[static_cast<std::size_t>(frame.link) + 1].inverse() * frame.pose;
    frames_.push_back({frame.name, frame.link, in_link});
  };
  add_frame(robot_.tip);
  for (const Frame& frame : robot_.frames) add_frame(frame);
  reach_ = reach_of(robot_, frames);
  Hash hash;
  hash.add(std::uint64_t{chain_.index()}).add(root_);
  std::visit(
      [&](const auto& chain) {
        hash.add(chain.potential_constant);
        add(hash, chain);
      },
      chain_);
  for (const SE3& com : com_in_frame_) hash.add(com);
  fingerprint_ = hash.value();
}

int Model::frame(std::string_view name) const {
  return index_of("frame", name, robot_.name, frames_,
                  [](const NamedFrame& frame) -> const std::string& { return frame.name; });
}

int Model::link(std::string_view name) const {
  return index_of("link", name, robot_.name, robot_.links,
                  [](const Link& link) -> const std::string& { return link.name; });
}

int Model::joint(std::string_view name) const {
  return index_of("joint", name, robot_.name, robot_.links,
                  [](const Link& link) -> const std::string& { return link.joint.name; });
}

std::string Model::describe(const Shape& shape) const {
  const auto& links = robot_.links;
  const auto body = static_cast<std::size_t>(shape.link),
             index = static_cast<std::size_t>(shape.index_in_link);
  if (body >= links.size() ||
      index >= (shape.is_capsule ? links[body].segments.size() : links[body].spheres.size()))
    throw Error(ErrorCode::usage,
                formatted("describe: '{}' has no shape {} on link {}, expected one of its shapes",
                          robot_.name, shape.index_in_link, shape.link));
  const Link& link = links[body];
  const std::string& part = shape.is_capsule ? link.segments[index].part : link.spheres[index].part;
  return formatted("{} {} of {} '{}'", shape.is_capsule ? "capsule" : "sphere", index,
                   part.empty() ? "link" : "part", part.empty() ? link.name : part);
}

}  // namespace hamelin::model
