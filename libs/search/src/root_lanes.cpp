#include "root_lanes.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/core/isa_kernels.hpp"
#include "lane_chain.hpp"

namespace hamelin::search {

namespace kernel {
HAMELIN_SELECT_KERNELS(RootKernels, root_kernels)
}  // namespace kernel

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

// The largest angle for which the lanes have sines [rad].
constexpr double angle_max = 12.0;
// How near is enough, as a share of the tolerances, and at least [m, rad]: what single precision
// can keep.
constexpr double reach_share = 0.3, reach_least_m = 1e-4, reach_least_rad = 1e-3;
constexpr double reach_most_rad = 1.5;

float upwards(double x) {
  const auto out = static_cast<float>(x);
  return static_cast<double>(out) < x ? std::nextafter(out, 1e9F) : out;
}
float downwards(double x) {
  return -upwards(-x);
}

}  // namespace

RootLanes::RootLanes(const model::Model& model, const dynamics::JointBox& box)
    : model_(model),
      box_(box),
      kernels_(kernel::select_root_kernels(default_isa())),
      joints_(lane_joints(model)),
      targets_(std::make_unique<kernel::RootTargets>()),
      postures_(std::make_unique<kernel::RootPostures>()),
      fits_(model.dof() <= kernel::joints_max) {
  chain_.dof = model.dof();
  chain_.joints = joints_.data();
  place_chain(model, geometry::SE3(), chain_);
  for (std::size_t j = 0; fits_ && j < joints_.size(); ++j) {
    const auto k = static_cast<Index>(j);
    const double turn = static_cast<double>(joints_[j].turn);
    double low = box.lower[k], high = box.upper[k];
    if (turn != 0.0) {
      const double offset = joint_offset(model, j), a = turn * low, b = turn * high;
      low = std::min(a, b) + offset;
      high = std::max(a, b) + offset;
      fits_ = std::max(std::abs(low), std::abs(high)) <= angle_max;
    }
    postures_->lower[j] = upwards(low);
    postures_->upper[j] = downwards(high);
  }
}

void RootLanes::set_targets(const Targets& targets) {
  kernel::RootTargets& out = *targets_;
  const dynamics::TipTarget& first = targets.front();
  for (std::size_t l = 0; l < targets.size(); ++l)
    for (Index i = 0; i < 3; ++i) {
      out.p[i][l] = static_cast<float>(targets[l].position[i]);
      out.x[i][l] = static_cast<float>(targets[l].rotation(i, 0));
      out.y[i][l] = static_cast<float>(targets[l].rotation(i, 1));
      out.z[i][l] = static_cast<float>(targets[l].rotation(i, 2));
    }
  const geometry::SE3& tip = model_.tip_in_frame();
  to_floats(tip.p(), out.tip_p);
  to_floats(tip.R().col(0), out.tip_x);
  to_floats(tip.R().col(1), out.tip_y);
  to_floats(tip.R().col(2), out.tip_z);
  out.tip_link = model_.robot().tip.link;
  out.turns = first.turns;
  double metres = first.tolerance_m, radians = first.tolerance_rad;
  for (const dynamics::TipTarget& target : targets) {
    metres = std::min(metres, target.tolerance_m);
    radians = std::min(radians, target.tolerance_rad);
  }
  out.reach_m = static_cast<float>(std::max(reach_share * metres, reach_least_m));
  out.reach_sine = static_cast<float>(
      std::sin(std::clamp(reach_share * radians, reach_least_rad, reach_most_rad)));
}

double RootLanes::factor(Index joint) const {
  const float turn = joints_[static_cast<std::size_t>(joint)].turn;
  return turn == 0.0F ? 1.0 : static_cast<double>(turn);
}

double RootLanes::offset(Index joint) const {
  const auto j = static_cast<std::size_t>(joint);
  return joints_[j].turn == 0.0F ? 0.0 : joint_offset(model_, j);
}

void RootLanes::begin(const Targets& targets, const MatrixXd& q) {
  set_targets(targets);
  for (Index j = 0; j < q.rows(); ++j)
    for (Index l = 0; l < q.cols(); ++l)
      postures_->q[j][l] = static_cast<float>(factor(j) * q(j, l) + offset(j));
}

unsigned RootLanes::advance(int steps) {
  return kernels_.advance(chain_, *targets_, *postures_, steps);
}

void RootLanes::write(MatrixXd& q) const {
  for (Index j = 0; j <= targets_->tip_link; ++j)
    for (Index l = 0; l < q.cols(); ++l)
      q(j, l) = std::clamp(factor(j) * (static_cast<double>(postures_->q[j][l]) - offset(j)),
                           box_.lower[j], box_.upper[j]);
}

}  // namespace hamelin::search
