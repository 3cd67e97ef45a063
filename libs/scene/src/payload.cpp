#include "hamelin/scene/payload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/error.hpp"

namespace hamelin::scene {

using Eigen::Vector3d;

namespace {

[[noreturn]] void refuse_payload(const std::string& where, const std::string& what) {
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", where, what));
}

Eigen::Matrix3d about_other_point(double mass, const Vector3d& offset) {
  return mass * (offset.squaredNorm() * Eigen::Matrix3d::Identity() - offset * offset.transpose());
}

bool has_part(const model::Robot& robot, const std::string& name) {
  const auto named = [&](const auto& shapes) {
    return std::any_of(shapes.begin(), shapes.end(),
                       [&](const auto& shape) { return shape.part == name; });
  };
  return named(robot.base_spheres) || named(robot.base_segments) ||
         std::any_of(robot.links.begin(), robot.links.end(), [&](const model::Link& link) {
           return link.name == name || named(link.spheres) || named(link.segments);
         });
}

// The parallel-axis theorem, docs/theory.md (2.23).
void add_payload(model::Robot& robot, const Payload& payload) {
  if (has_part(robot, payload.name))
    refuse_payload(
        fmt::format("payload '{}'", payload.name),
        fmt::format("'{}' has a link or part of this name, expected another name", robot.name));
  model::Link& link = robot.links[static_cast<std::size_t>(robot.tip.link)];
  const geometry::SE3 tip_in_com = link.com.inverse() * robot.tip.pose;
  const Vector3d at = tip_in_com * payload.position_m;
  const double mass = link.mass_kg + payload.mass_kg;
  // of both, in the old COM frame
  const Vector3d com = mass > 0.0 ? Vector3d(payload.mass_kg / mass * at) : Vector3d::Zero();
  link.inertia_kg_m2 += about_other_point(link.mass_kg, com) +
                        about_other_point(payload.mass_kg, at - com) +
                        tip_in_com.R() * payload.inertia_kg_m2 * tip_in_com.R().transpose();
  link.mass_kg = mass;
  link.com = link.com * geometry::SE3{Eigen::Matrix3d::Identity(), com};
  for (const model::Sphere& sphere : payload.spheres)
    link.spheres.push_back({tip_in_com * sphere.center_m, sphere.radius_m, payload.name});
  for (const model::Segment& capsule : payload.capsules)
    link.segments.push_back(
        {tip_in_com * capsule.from_m, tip_in_com * capsule.to_m, capsule.radius_m, payload.name});
  for (model::Sphere& sphere : link.spheres) sphere.center_m -= com;
  for (model::Segment& segment : link.segments) {
    segment.from_m -= com;
    segment.to_m -= com;
  }
}

}  // namespace

void check(const Payload& payload, const std::string& where) {
  if (payload.name.empty()) refuse_payload(where, "has no name, expected one to refer to it");
  if (!(std::isfinite(payload.mass_kg) && payload.mass_kg >= 0.0))
    refuse_payload(where, fmt::format("its mass is {} kg, expected zero or more", payload.mass_kg));
  if (!payload.position_m.allFinite() || !payload.inertia_kg_m2.allFinite())
    refuse_payload(where, "its centre of mass or inertia is not finite, expected finite numbers");
  if (const std::string fault = model::inertia_fault(payload.inertia_kg_m2, false); !fault.empty())
    refuse_payload(where, fmt::format("its inertia {}", fault));
  const auto check_radius = [&](const char* shape, std::size_t i, double radius, bool finite) {
    if (!finite || !std::isfinite(radius) || radius <= 0.0)
      refuse_payload(where, fmt::format("its {} {} has a radius that is not positive or a position "
                                        "that is not finite, expected both",
                                        shape, i));
  };
  for (std::size_t i = 0; i < payload.spheres.size(); ++i)
    check_radius("sphere", i, payload.spheres[i].radius_m, payload.spheres[i].center_m.allFinite());
  for (std::size_t i = 0; i < payload.capsules.size(); ++i)
    check_radius("capsule", i, payload.capsules[i].radius_m,
                 payload.capsules[i].from_m.allFinite() && payload.capsules[i].to_m.allFinite());
}

model::Robot with_payloads(model::Robot robot, std::span<const Payload> payloads) {
  for (const Payload& payload : payloads) add_payload(robot, payload);
  return robot;
}

double reach_beyond_tip(const Payload& payload) {
  double reach = 0.0;
  for (const model::Sphere& sphere : payload.spheres)
    reach = std::max(reach, sphere.center_m.norm() + sphere.radius_m);
  for (const model::Segment& capsule : payload.capsules)
    reach =
        std::max(reach, std::max(capsule.from_m.norm(), capsule.to_m.norm()) + capsule.radius_m);
  return reach;
}

PayloadBounds payload_bounds(std::span<const Event> events, const model::Model& arm,
                             const std::string& where) {
  PayloadBounds out;
  std::vector<Payload> carried;
  for (std::size_t i = 0; i < events.size(); ++i) {
    const Event& event = events[i];
    if (event.detach)
      std::erase_if(carried, [&](const Payload& one) { return one.name == *event.detach; });
    if (!event.attach) continue;
    carried.push_back(*event.attach);
    try {
      const model::Model loaded(with_payloads(arm.robot(), carried), arm.base(), arm.gravity());
      out.reach_m = std::max(out.reach_m, reach_beyond_tip(*event.attach));
      out.shapes = std::max(out.shapes, loaded.shapes().size() - arm.shapes().size());
    } catch (const Error& e) {
      throw Error(e.code(), fmt::format("{}/{}/attach: {}", where, i, e.what()));
    }
  }
  return out;
}

}  // namespace hamelin::scene
