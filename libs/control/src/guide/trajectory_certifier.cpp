#include "guide/trajectory_certifier.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Nodes are at most so far apart [s].
constexpr double nodes_spacing_s = 0.01;
// A motion may begin and end with this velocity [rad/s or m/s].
constexpr double rests_below = 1e-6;
// One that takes so many times as long is not followed as it was meant; one by so much does not
// count as slower.
constexpr double slowest = 4.0, as_meant = 1.001;
// Shares of the margin that are tried, from the largest on.
constexpr std::array margin_shares{1.0, 0.6, 0.4, 0.25, 0.15, 0.1, 0.06, 0.03};
constexpr double wanted_margin_m = 0.02;

}  // namespace

TrajectoryCertifier::TrajectoryCertifier(const scene::Scene& scene, const model::Model& model,
                                         const scene::SelfField* self, const MotionBounds& bounds)
    : stop_acceleration_(bounds.changes.acceleration_max),
      enough_m_(std::max(wanted_margin_m, enough_margin_m(bounds.reserve))),
      law_(model, motion_limits(scene, model, bounds), {1, nodes_spacing_s}),
      levers_(model, self),
      edges_(model, self),
      certifier_(model, levers_, modelled_limits(scene, model.robot()), enough_m_) {
  from_ = to_ = stray_ = VectorXd::Zero(model.dof());
}

TrajectoryCertifier::Result TrajectoryCertifier::certify(const scene::JointTrajectory& trajectory,
                                                         const WorldSnapshot& world) {
  Result out;
  const auto fail = [&](std::string cause) {
    out.cause = std::move(cause);
    return std::move(out);
  };
  if (law_.limits().have_rates()) return fail("rates of torque or acceleration are bounded");
  if (std::max(trajectory.v.leftCols<1>().cwiseAbs().maxCoeff(),
               trajectory.v.rightCols<1>().cwiseAbs().maxCoeff()) > rests_below)
    return fail("it begins or ends in motion");
  auto path = std::make_unique<CertifiedPath>();
  path->motion.curve = timing::Curve(trajectory);
  path->limits = law_.limits();
  path->stop_acceleration = stop_acceleration_;
  path->standing = world.standing;
  if (!law_.slow_down(path->motion)) return fail(std::string(law_.cause()));
  const double slower = path->motion.duration_s() / trajectory.duration_s();
  if (slower > as_meant)
    out.cause = fmt::format("within the limits it takes {:.4g} s, not {:.4g} s",
                            path->motion.duration_s(), trajectory.duration_s());
  if (slower > slowest) return fail(out.cause);
  edges_.set_environment(world.environment, 0.0, false);
  if (const Index open = set_margins(*path); open >= 0)
    return fail(fmt::format("it is not proved to be clear at {:.4g} s", path->motion.place[open]));
  certifier_.complete(*path);
  out.motion = std::move(path);
  return out;
}

bool TrajectoryCertifier::keeps(double of_obstacles_m, double of_self_m) {
  const double stray = levers_.reach(stray_);
  edges_.set_self_most(of_self_m + stray);
  return edges_.motion_clear(from_, to_, of_obstacles_m + stray);
}

// docs/theory.md (14.30): both margins together, then that from obstacles alone.
Index TrajectoryCertifier::set_margins(CertifiedPath& path) {
  const Index n = path.motion.nodes() - 1;
  path.clearance_m.resize(n);
  path.self_m.resize(n);
  for (Index k = 0; k < n; ++k) {
    path.motion.chord(k, from_, to_, stray_);
    const auto both = std::find_if(margin_shares.begin(), margin_shares.end(), [&](double share) {
      return keeps(share * enough_m_, share * enough_m_);
    });
    if (both == margin_shares.end()) return k;
    path.self_m[k] = *both * enough_m_;
    const auto most = std::find_if(margin_shares.begin(), both, [&](double share) {
      return keeps(share * enough_m_, path.self_m[k]);
    });
    path.clearance_m[k] = *most * enough_m_;
  }
  return -1;
}

}  // namespace hamelin::control
