#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"
#include "hamelin/integration/integrator.hpp"
#include "kernel/forces.hpp"

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

/// The channels of a step as the kernels take them; `spins` keeps the gyroscopic terms meanwhile.
inline kernel::Forces to_forces(const model::Model& model, const Channels& channels,
                                std::vector<dynamics::kernel::Spin>& spins) {
  to_spins(model, channels.gyroscopic, spins);
  return {data_or_null(channels.damping),
          data_or_null(channels.coulomb),
          data_or_null(channels.held_torque),
          channels.coulomb_speed,
          spins.data(),
          spins.size()};
}

inline void report_work(const kernel::Work& work, StepReport& report) noexcept {
  report.held_work_J = work.held;
  report.dissipated_J = work.dissipated;
  report.gyroscopic_work_J = work.gyroscopic;
}

}  // namespace hamelin::integration
