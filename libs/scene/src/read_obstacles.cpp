#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "read_scene.hpp"

namespace hamelin::scene {

namespace {

Shape shape_of(const std::string& type) {
  for (const Shape shape : {Shape::box, Shape::cylinder, Shape::capsule, Shape::frame})
    if (type == to_string(shape)) return shape;
  return Shape::sphere;
}

void read_prediction(const Reader& in, Obstacle& o) {
  const Json* given = in.find("prediction");
  if (given == nullptr) return;
  if (given->is_object()) {
    o.prediction = Prediction::speed_bound;
    o.speed_max_m_s = given->at("speed_max").get<double>();
    return;
  }
  for (const Prediction kind : {Prediction::path, Prediction::constant_velocity})
    if (*given == to_string(kind)) o.prediction = kind;
}

Obstacle read_obstacle(const Reader& in, const std::filesystem::path& folder) {
  Obstacle o;
  o.name = in.get<std::string>("name", "");
  const auto type = in.get<std::string>("type", "");
  o.shape = shape_of(type);
  const bool box = o.shape == Shape::box, frame = o.shape == Shape::frame,
             has_length = o.shape == Shape::cylinder || o.shape == Shape::capsule;
  box ? in.require("size_m", type) : in.refuse("size_m", type);
  box || frame ? in.refuse("radius_m", type) : in.require("radius_m", type);
  has_length ? in.require("length_m", type) : in.refuse("length_m", type);
  o.radius_m = in.get("radius_m", 0.0);
  o.length_m = in.get("length_m", 0.0);
  o.size_m = in.vector("size_m", Eigen::Vector3d::Zero());
  o.attached_to = in.get<std::string>("attached_to", "");
  if (in.find("motion") != nullptr) o.motion = read_motion(in.child("motion"), folder);
  const bool has_place = frame || !o.attached_to.empty() ||
                         (o.motion && std::holds_alternative<WaypointMotion>(*o.motion));
  if (!has_place) in.require("position_m", type);
  o.pose = in.pose();
  o.quaternion_wxyz = in.quaternion();
  read_prediction(in, o);
  o.known = in.get("known", true);
  o.visible_within_m = in.maybe<double>("visible_within_m");
  o.appears_s = in.get("appears_s", 0.0);
  o.judge_only = in.get("judge_only", false);
  return o;
}

}  // namespace

// Obstacles may be attached to later ones, so that speeds are known after all were read.
std::vector<Obstacle> read_obstacles(const Reader& in, const std::filesystem::path& folder) {
  std::vector<Obstacle> out;
  in.each("obstacles",
          [&](const Reader& obstacle) { out.push_back(read_obstacle(obstacle, folder)); });
  const std::string place = in.place_of("obstacles");
  attach(out, place);
  for (std::size_t i = 0; i < out.size(); ++i) check(out[i], fmt::format("{}/{}", place, i));
  return out;
}

Obstacle obstacle_from_json(const Json& document, const std::string& where) {
  Obstacle obstacle = read_obstacle({document, where}, {});
  if (!obstacle.attached_to.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}/attached_to: is '{}', expected none for an obstacle that is alone",
                            where, obstacle.attached_to));
  return obstacle;
}

}  // namespace hamelin::scene
