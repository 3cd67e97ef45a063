#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/simulation/plant.hpp"

namespace hamelin::mujoco {

/// The largest number of contacts that MuJoCo keeps at a time.
inline constexpr int contacts_max = 100;

/// What a shape in MuJoCo stands for. Its name is kind and index: "obstacle 3".
enum class Kind : std::int32_t {
  link,      ///< Model::shapes()
  base,      ///< Robot::base_spheres, then base_segments
  obstacle,  ///< Environment::obstacles()
  map,       ///< any box of the map
};

[[nodiscard]] std::string name_of(Kind kind, int index);

/// A shape's kind and index from its name.
struct ShapeId {
  Kind kind = Kind::link;
  int index = 0;
};
[[nodiscard]] ShapeId id_of(const char* name);

/// Name of the body of the map.
inline constexpr const char* map_body_name = "map";
/// Name of the body of a link, and of a moving obstacle.
[[nodiscard]] std::string link_name(int link);
[[nodiscard]] std::string obstacle_body_name(int obstacle);

/// Principal moments of a link's inertia about its centre of mass, and their axes in the axes of
/// the base at q = 0. MuJoCo's own search for the axes ends at 1e-8.
struct PrincipalInertia {
  Eigen::Vector3d moments = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
};
[[nodiscard]] PrincipalInertia principal_inertia(const model::Link& link);

/// The model in MuJoCo's format. Masses and moments of inertia are placeholders: MuJoCo's compiler
/// refuses values that the dynamics allow, such as those of planar arms, so they are set
/// afterwards.
/// @param self pairs of parts of the arm that count as contact; null: none
/// @param map_boxes the largest number of boxes of the map that are shapes at a time
[[nodiscard]] std::string mjcf(const simulation::PlantSetup& setup,
                               const scene::Environment& environment, const scene::SelfField* self,
                               int map_boxes);

}  // namespace hamelin::mujoco
