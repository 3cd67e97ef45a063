#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::integration {

/// A channel as the kernels take it: null where there is none.
inline const double* data_or_null(const Eigen::VectorXd& x) noexcept {
  return x.size() > 0 ? x.data() : nullptr;
}

/// Room for as many terms is made beforehand, so that steps do not allocate; more are taken too.
inline constexpr std::size_t most_spins = 256;

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
