#include "hamelin/scene/map_field.hpp"

namespace hamelin::scene {

namespace {

constexpr double cone_cosine = 0.86602540378443865;  // 30°
constexpr double far_table_edge_m = 0.05;
// Tables are exact this much farther than asked: no sphere of an arm is much larger.
constexpr double far_table_radius_m = 0.2;

std::vector<Box> boxes_of(const std::vector<Cell>& cells, double resolution) {
  std::vector<Box> boxes;
  for (const VoxelBox& box : merge(cells)) boxes.push_back(to_metres(box, resolution));
  return boxes;
}

}  // namespace

MapField::MapField(const std::vector<Cell>& cells, double resolution, const Ball& reachable, double far)
    : boxes_(boxes_of(cells, resolution), reachable.center),
      far_(boxes_, reachable, far_table_edge_m, far + far_table_radius_m) {}

std::size_t MapField::several(const Eigen::Vector3d& p, double limit, Scratch& scratch,
                              std::span<BoxHit, points_max> out) const {
  if (boxes_.empty() || far_.beyond(p, limit)) return 0;
  return boxes_.several(p, limit, cone_cosine, scratch.boxes_, out);
}

}  // namespace hamelin::scene
