#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"
#include "hamelin/integration/integrator.hpp"
#include "kernel/forces.hpp"
#include "wrench_forces.hpp"

namespace hamelin::integration {

/// The data of a channel, or null if the channel is empty.
inline const double* data_or_null(const Eigen::VectorXd& x) noexcept {
  return x.size() > 0 ? x.data() : nullptr;
}

/// Memory for this number of gyroscopic terms is reserved, so that steps do not allocate. More
/// terms are possible and allocate.
inline constexpr std::size_t reserved_spins = 256;

/// Converts gyroscopic terms to the frames of the sweeps: points in joint-aligned frames, w in the
/// axes of the root.
inline void to_spins(const model::Model& model, std::span<const dynamics::GyroscopicTerm> terms,
                     std::vector<dynamics::kernel::Spin>& spins) {
  spins.clear();
  for (const auto& term : terms) {
    const Eigen::Vector3d point = model.com_in_frame(term.link) * term.point_link;
    const Eigen::Vector3d w = model.root().R().transpose() * term.w_world;
    spins.push_back({static_cast<std::size_t>(term.link),
                     {point.x(), point.y(), point.z()},
                     {w.x(), w.y(), w.z()}});
  }
}

/// The forces of each joint on its own in the form of the kernels: held torque, damping and dry
/// friction.
inline kernel::Forces joint_forces(const Channels& channels) noexcept {
  return {data_or_null(channels.damping),
          data_or_null(channels.coulomb),
          data_or_null(channels.held_torque),
          channels.coulomb_speed,
          nullptr,
          0};
}

/// The channels of a step in the form of the kernels. `spins` holds the gyroscopic terms, and
/// `wrenches` those of this step; both must outlive the result.
inline kernel::Forces to_forces(const model::Model& model, const Channels& channels,
                                std::vector<dynamics::kernel::Spin>& spins,
                                WrenchForces& wrenches) {
  to_spins(model, channels.gyroscopic, spins);
  kernel::Forces forces = joint_forces(channels);
  forces.spins = spins.data();
  forces.spin_count = spins.size();
  forces.external = wrenches.for_kernels();
  return forces;
}

inline void report_work(const kernel::Work& work, StepReport& report) noexcept {
  report.held_work_J = work.held;
  report.dissipated_J = work.dissipated;
  report.gyroscopic_work_J = work.gyroscopic;
  report.external_work_J = work.external;
}

}  // namespace hamelin::integration
