#include "lane_chain.hpp"

#include <cmath>
#include <variant>

namespace hamelin::search {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

kernel::Joint joint_of(const model::SpatialLink& link) {
  kernel::Joint joint{};
  joint.cos_alpha = static_cast<float>(link.cos_alpha);
  joint.sin_alpha = static_cast<float>(link.sin_alpha);
  to_floats({link.p0.x, link.p0.y, link.p0.z}, joint.p);
  joint.turn = link.prismatic ? 0.0F : 1.0F;
  if (link.prismatic) to_floats({0.0, -link.sin_alpha, link.cos_alpha}, joint.slide);
  joint.sine = static_cast<float>(std::sin(link.offset));
  joint.cosine = static_cast<float>(std::cos(link.offset));
  return joint;
}

kernel::Joint joint_of(const model::PlanarLink& link) {
  kernel::Joint joint{};
  joint.cos_alpha = 1.0F;
  to_floats({link.p0x, link.p0y, 0.0}, joint.p);
  joint.turn = link.prismatic ? 0.0F : static_cast<float>(link.direction);
  joint.sine = static_cast<float>(std::sin(link.offset));
  joint.cosine = static_cast<float>(std::cos(link.offset));
  if (link.prismatic) to_floats({std::cos(link.offset), std::sin(link.offset), 0.0}, joint.slide);
  return joint;
}

}  // namespace

void to_floats(const Vector3d& from, float* to) {
  for (Index i = 0; i < 3; ++i) to[i] = static_cast<float>(from[i]);
}

std::vector<kernel::Joint> lane_joints(const model::Model& model) {
  std::vector<kernel::Joint> out;
  std::visit(
      [&](const auto& chain) {
        for (const auto& link : chain.links) out.push_back(joint_of(link));
      },
      model.chain());
  return out;
}

void place_chain(const model::Model& model, const geometry::SE3& frame, kernel::Chain& chain) {
  const geometry::SE3 root = frame.inverse() * model.root();
  to_floats(root.p(), chain.root_p);
  to_floats(root.R().col(0), chain.root_x);
  to_floats(root.R().col(1), chain.root_y);
  to_floats(root.R().col(2), chain.root_z);
}

double joint_offset(const model::Model& model, std::size_t joint) {
  return std::visit([&](const auto& chain) { return chain.links[joint].offset; }, model.chain());
}

}  // namespace hamelin::search
