#include "loads.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::report {

using Eigen::Vector3d;

namespace {

// Largest spacing, in radii, and largest number of the balls that a capsule is drawn as.
constexpr double ball_spacing_share = 0.4, balls_max = 60.0;

Json array_of(const Vector3d& p) {
  return {p.x(), p.y(), p.z()};
}

}  // namespace

std::vector<Vector3d> balls_along(const Vector3d& from, const Vector3d& to, double radius) {
  const Vector3d axis = to - from;
  const double parts =
      std::clamp(std::ceil(axis.norm() / (ball_spacing_share * radius)), 1.0, balls_max);
  std::vector<Vector3d> out;
  for (double part = 0.0; part <= parts; part += 1.0)
    out.emplace_back(from + (part / parts) * axis);
  return out;
}

Loads::Loads(const scene::Scene& scene, const geometry::SE3& tip) : tip_(tip) {
  for (const auto& event : scene.events) {
    if (!event.attach) continue;
    known_.push_back(*event.attach);
    if (!event.obstacle.empty()) obstacles_[event.attach->name] = event.obstacle;
  }
  if (!scene.model.payload) return;
  known_.push_back(*scene.model.payload);
  attach(scene.model.payload->name, 0.0);
}

Json Loads::balls_of(const std::string& name) const {
  Json out = Json::array();
  const auto found =
      std::find_if(known_.begin(), known_.end(), [&](const auto& one) { return one.name == name; });
  if (found == known_.end()) return out;
  const auto add = [&](const Vector3d& center, double radius) {
    out.push_back({{"center_m", array_of(tip_ * center)}, {"radius_m", radius}});
  };
  for (const auto& sphere : found->spheres) add(sphere.center_m, sphere.radius_m);
  for (const auto& capsule : found->capsules)
    for (const Vector3d& center : balls_along(capsule.from_m, capsule.to_m, capsule.radius_m))
      add(center, capsule.radius_m);
  return out;
}

void Loads::take_up(const Json& obstacle, double time_s) {
  for (Json& load : loads_)
    if (!obstacle.is_null() && load["obstacle"] == obstacle && load["gone"].is_null())
      load["gone"] = time_s;
}

void Loads::attach(const std::string& name, double time_s) {
  const auto found = obstacles_.find(name);
  const Json obstacle = found != obstacles_.end() ? Json(found->second) : Json(nullptr);
  take_up(obstacle, time_s);
  loads_.push_back({{"name", name},
                    {"obstacle", obstacle},
                    {"t", time_s},
                    {"until", nullptr},
                    {"gone", nullptr},
                    {"q_end", nullptr},
                    {"balls", balls_of(name)}});
}

void Loads::detach(const std::string& name, double time_s, const Eigen::VectorXd& q) {
  for (Json& load : loads_) {
    if (load["name"] != name || !load["until"].is_null()) continue;
    load["until"] = time_s;
    load["q_end"] = std::vector<double>(q.begin(), q.end());
  }
}

}  // namespace hamelin::report
