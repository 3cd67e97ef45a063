#include "hamelin/scene/modelled.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::scene {

using Eigen::VectorXd;

namespace {

// A start that was written with 9 digits is within a limit that it equals.
constexpr double rounding = 1e-9;

enum class Kind { position, velocity, torque };

bool has_limit(const model::Joint& joint, Kind kind) {
  switch (kind) {
    case Kind::position:
      return joint.lower || joint.upper;
    case Kind::velocity:
      return joint.velocity_max.has_value();
    case Kind::torque:
      return joint.effort_max.has_value();
  }
  return false;
}

long joints_with(const model::Robot& robot, Kind kind) {
  return std::count_if(robot.links.begin(), robot.links.end(),
                       [kind](const model::Link& link) { return has_limit(link.joint, kind); });
}

bool acts(const JointNumbers& numbers, const model::Robot& robot, double model::Joint::*member) {
  const auto nonzero = [](double x) { return x != 0.0; };
  if (!numbers.from_robot)
    return std::any_of(numbers.values.begin(), numbers.values.end(), nonzero);
  return std::any_of(robot.links.begin(), robot.links.end(),
                     [&](const model::Link& link) { return nonzero(link.joint.*member); });
}

// Gravity along the normal of a planar arm does not move it.
bool gravity_acts(const model::Model& arm) {
  const double size = arm.gravity().norm();
  if (size == 0.0 || !arm.planar()) return size > 0.0;
  const auto& chain = std::get<model::PlanarChain>(arm.chain());
  return std::hypot(chain.gravity_x, chain.gravity_y) > 1e-12 * size;
}

std::string gravity_text(const Json& info) {
  const Json& g = info["gravity_m_s2"];
  const auto number = [&](std::size_t i) { return g[i].get<double>() + 0.0; };  // no "-0"
  if (number(0) == 0.0 && number(1) == 0.0 && number(2) == 0.0) return "no gravity";
  return fmt::format("gravity ({:.6g}, {:.6g}, {:.6g}) m/s^2{}", number(0), number(1), number(2),
                     info["gravity_acts"].get<bool>()
                         ? ""
                         : ", normal to the plane of the arm and without effect");
}

std::string limit_text(const char* name, const Json& limit, long dof) {
  const long joints = limit["joints"].get<long>();
  if (!limit["on"].get<bool>()) return fmt::format("{} off", name);
  if (joints == 0) return fmt::format("{} none in the robot file", name);
  if (joints < dof) return fmt::format("{} on ({} of {} joints)", name, joints, dof);
  return fmt::format("{} on", name);
}

const char* on_or_off(const Json& on) {
  return on.get<bool>() ? "on" : "off";
}

VectorXd start_of(const VectorXd& given, const char* key, const model::Model& arm) {
  if (given.size() == 0) return VectorXd::Zero(arm.dof());
  if (given.size() != arm.dof())
    throw Error(ErrorCode::invalid, fmt::format("/start/{}: {} values given, expected {}", key,
                                                given.size(), arm.dof()));
  return given;
}

std::string defect(const char* place, const model::Joint& joint, const std::string& what,
                   const char* key) {
  return fmt::format(
      "/start/{}: joint '{}' {} (\"{}\": false under /model switches the limits off)", place,
      joint.name, what, key);
}

std::string position_defect(const VectorXd& q, const model::Robot& robot) {
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const model::Joint& joint = robot.links[static_cast<std::size_t>(i)].joint;
    const bool low = joint.lower && q[i] < *joint.lower - rounding,
               high = joint.upper && q[i] > *joint.upper + rounding;
    if (!low && !high) continue;
    return defect("q", joint,
                  fmt::format("is at {:.6g}, beyond its limit, expected {} {:.6g}", q[i],
                              low ? "at least" : "at most", low ? *joint.lower : *joint.upper),
                  "joint_limits");
  }
  return {};
}

std::string velocity_defect(const VectorXd& v, const model::Robot& robot) {
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    const model::Joint& joint = robot.links[static_cast<std::size_t>(i)].joint;
    if (joint.velocity_max && std::abs(v[i]) > *joint.velocity_max + rounding)
      return defect("v", joint,
                    fmt::format("moves at {:.6g}, beyond its limit, expected at most {:.6g}", v[i],
                                *joint.velocity_max),
                    "velocity_limits");
  }
  return {};
}

std::string torque_defect(const VectorXd& q, const model::Model& arm) {
  dynamics::Workspace ws(arm);
  VectorXd torque(arm.dof());
  dynamics::gravity_torque(arm, ws, q, torque);
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const model::Joint& joint = arm.robot().links[static_cast<std::size_t>(i)].joint;
    if (joint.effort_max && std::abs(torque[i]) > *joint.effort_max)
      return defect(
          "q", joint,
          fmt::format("needs {:.4g} to hold the arm against gravity, expected at most its "
                      "limit {:.4g}",
                      std::abs(torque[i]), *joint.effort_max),
          "torque_limits");
  }
  return {};
}

}  // namespace

LimitsInForce limits_in_force(const ModelFlags& flags, const model::Robot& robot) {
  return {flags.joint_limits && joints_with(robot, Kind::position) > 0,
          flags.velocity_limits && joints_with(robot, Kind::velocity) > 0,
          flags.torque_limits && joints_with(robot, Kind::torque) > 0};
}

Json modelled_info(const Scene& scene, const model::Model& arm) {
  const ModelFlags& flags = scene.model;
  const model::Robot& robot = arm.robot();
  const auto limit = [&](bool on, Kind kind) {
    return Json{{"on", on}, {"joints", joints_with(robot, kind)}};
  };
  const Eigen::Vector3d& g = arm.gravity();
  Json info{{"dof", arm.dof()},
            {"gravity_m_s2", {g.x(), g.y(), g.z()}},
            {"gravity_acts", gravity_acts(arm)},
            {"joint_limits", limit(flags.joint_limits, Kind::position)},
            {"velocity_limits", limit(flags.velocity_limits, Kind::velocity)},
            {"torque_limits", limit(flags.torque_limits, Kind::torque)},
            {"self_collision", flags.self_collision},
            {"payload", nullptr},
            {"joint_damping", acts(flags.joint_damping, robot, &model::Joint::damping)},
            {"friction", acts(flags.friction, robot, &model::Joint::friction) ||
                             scene.actuation.coulomb_friction_share > 0.0}};
  if (flags.payload)
    info["payload"] = {{"name", flags.payload->name}, {"mass_kg", flags.payload->mass_kg}};
  return info;
}

std::vector<std::string> describe_modelled(const Json& info) {
  const long dof = info["dof"].get<long>();
  const Json& payload = info["payload"];
  return {fmt::format("{}; limits: {}, {}, {}; self-collision {}", gravity_text(info),
                      limit_text("joint", info["joint_limits"], dof),
                      limit_text("velocity", info["velocity_limits"], dof),
                      limit_text("torque", info["torque_limits"], dof),
                      on_or_off(info["self_collision"])),
          fmt::format("payload {}; damping {}; friction {}",
                      payload.is_null()
                          ? "none"
                          : fmt::format("'{}' of {:.4g} kg", payload["name"].get<std::string>(),
                                        payload["mass_kg"].get<double>()),
                      on_or_off(info["joint_damping"]), on_or_off(info["friction"]))};
}

std::string start_defect(const Scene& scene, const model::Model& arm) {
  const VectorXd q = start_of(scene.start_q, "q", arm), v = start_of(scene.start_v, "v", arm);
  std::string found;
  if (scene.model.joint_limits) found = position_defect(q, arm.robot());
  if (found.empty() && scene.model.velocity_limits) found = velocity_defect(v, arm.robot());
  if (found.empty() && scene.model.torque_limits) found = torque_defect(q, arm);
  return found;
}

}  // namespace hamelin::scene
