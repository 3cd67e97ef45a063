#include "foxglove.hpp"

#include <array>

#include "hamelin/geometry/so3.hpp"

namespace hamelin::mcap {

using Eigen::Vector3d;

namespace {

constexpr std::uint64_t ns_per_s = 1000000000;
constexpr double line_pixels = 2.0;
constexpr int line_strip = 0;

Json vector_json(const Vector3d& v) {
  return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}};
}

Json quaternion_json(const Eigen::Matrix3d& R) {
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(R);
  return {{"x", wxyz[1]}, {"y", wxyz[2]}, {"z", wxyz[3]}, {"w", wxyz[0]}};
}

Json pose_json(const geometry::SE3& pose) {
  return {{"position", vector_json(pose.p())}, {"orientation", quaternion_json(pose.R())}};
}

Json color_json(const Color& color) {
  return {{"r", color.r}, {"g", color.g}, {"b", color.b}, {"a", color.a}};
}

}  // namespace

std::string com_frame(const std::string& link) {
  return "com/" + link;
}

std::string obstacle_frame(const std::string& obstacle) {
  return "obstacle/" + obstacle;
}

Json time_json(std::uint64_t time_ns) {
  return {{"sec", time_ns / ns_per_s}, {"nsec", time_ns % ns_per_s}};
}

Json frame_transform(std::uint64_t time_ns, const std::string& parent, const std::string& child,
                     const geometry::SE3& pose) {
  return {{"timestamp", time_json(time_ns)},
          {"parent_frame_id", parent},
          {"child_frame_id", child},
          {"translation", vector_json(pose.p())},
          {"rotation", quaternion_json(pose.R())}};
}

Entity::Entity(std::uint64_t time_ns, const std::string& frame, const std::string& id)
    : json_{{"timestamp", time_json(time_ns)},
            {"frame_id", frame},
            {"id", id},
            {"lifetime", time_json(0)},  // without end
            {"frame_locked", true}} {
  for (const char* kind : {"metadata", "arrows", "cubes", "spheres", "cylinders", "lines",
                           "triangles", "texts", "models"})
    json_[kind] = Json::array();
}

void Entity::add_sphere(const Vector3d& center, double radius, const Color& color) {
  json_["spheres"].push_back({{"pose", pose_json({Eigen::Matrix3d::Identity(), center})},
                              {"size", vector_json(Vector3d::Constant(2.0 * radius))},
                              {"color", color_json(color)}});
}

void Entity::add_box(const geometry::SE3& pose, const Vector3d& size, const Color& color) {
  json_["cubes"].push_back(
      {{"pose", pose_json(pose)}, {"size", vector_json(size)}, {"color", color_json(color)}});
}

void Entity::add_cylinder(const geometry::SE3& pose, double radius, double length,
                          const Color& color) {
  json_["cylinders"].push_back({{"pose", pose_json(pose)},
                                {"size", vector_json({2.0 * radius, 2.0 * radius, length})},
                                {"bottom_scale", 1.0},
                                {"top_scale", 1.0},
                                {"color", color_json(color)}});
}

void Entity::add_capsule(const Vector3d& a, const Vector3d& b, double radius, const Color& color) {
  const Vector3d axis = b - a;
  add_sphere(a, radius, color);
  add_sphere(b, radius, color);
  if (axis.norm() == 0.0) return;
  add_cylinder({geometry::rotation_between(Vector3d::UnitZ(), axis), 0.5 * (a + b)}, radius,
               axis.norm(), color);
}

void Entity::add_axes(const geometry::SE3& pose, double length) {
  constexpr std::array<Color, 3> colors{{{0.9, 0.2, 0.2}, {0.2, 0.7, 0.2}, {0.2, 0.4, 0.9}}};
  for (int axis = 0; axis < 3; ++axis)
    add_path({pose.p(), pose.p() + length * pose.R().col(axis)},
             colors[static_cast<std::size_t>(axis)]);
}

void Entity::add_path(const std::vector<Vector3d>& points, const Color& color) {
  Json line{{"type", line_strip},      {"pose", pose_json({})},   {"thickness", line_pixels},
            {"scale_invariant", true}, {"points", Json::array()}, {"color", color_json(color)},
            {"colors", Json::array()}, {"indices", Json::array()}};
  for (const Vector3d& point : points) line["points"].push_back(vector_json(point));
  json_["lines"].push_back(std::move(line));
}

Json scene_update(std::uint64_t time_ns, const std::vector<Entity>& entities) {
  constexpr int all = 1;
  Json update{{"deletions",
               Json::array({Json{{"timestamp", time_json(time_ns)}, {"type", all}, {"id", ""}}})},
              {"entities", Json::array()}};
  for (const Entity& entity : entities) update["entities"].push_back(entity.json());
  return update;
}

}  // namespace hamelin::mcap
