#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::integration {

/// Gyroscopic terms in the frames of the sweeps: points in joint-aligned frames, w in the root's axes.
inline void to_spins(const model::Model& model, std::span<const dynamics::GyroscopicTerm> terms,
                     std::vector<dynamics::kernel::Spin>& spins) {
  spins.clear();
  for (const auto& term : terms) {
    const Eigen::Vector3d point = model.com_in_frame(term.link) * term.point_link;
    const Eigen::Vector3d w = model.root().R().transpose() * term.w_world;
    spins.push_back({static_cast<std::size_t>(term.link), {point.x(), point.y(), point.z()}, {w.x(), w.y(), w.z()}});
  }
}

}  // namespace hamelin::integration
