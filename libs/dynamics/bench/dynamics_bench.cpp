#include <fmt/format.h>
#include <Eigen/Geometry>

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/frame_batch.hpp"

using namespace hamelin;
using Eigen::VectorXd;

namespace {

// A chain of unit links: joint axes x, z, x, … (spatial) or all x (planar).
model::Robot chain(int n, bool planar) {
  model::Robot robot;
  robot.name = "chain";
  for (int i = 0; i < n; ++i) {
    model::Link link;
    link.name = std::to_string(i);
    link.joint.name = "joint" + link.name;
    link.parent = i - 1;
    const Eigen::Vector3d axis =
        planar || i % 2 == 0 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d at{0.0, 0.2 * i, 0.0};
    link.joint.screw << axis, -axis.cross(at);
    link.com = geometry::SE3{Eigen::Matrix3d::Identity(), at + Eigen::Vector3d{0.0, 0.1, 0.0}};
    link.mass_kg = 1.0;
    link.inertia_kg_m2 = Eigen::Vector3d(4e-3, 5e-4, 4e-3).asDiagonal();
    robot.links.push_back(link);
  }
  robot.tip = {"tip", n - 1, geometry::SE3{}};
  return robot;
}

}  // namespace

TEST_CASE("time of dynamics over the number of links", "[!benchmark][dynamics]") {
  for (const bool planar : {false, true}) {
    for (const int n : {2, 7, 30, 100}) {
      const model::Model model(chain(n, planar));
      dynamics::Workspace ws(model);
      VectorXd q(n), v(n), x(n);
      for (int i = 0; i < n; ++i) q[i] = 0.3 * i, v[i] = 0.1 * i;
      const std::string label = fmt::format("{} {} links", planar ? "SE(2)" : "SE(3)", n);
      BENCHMARK("ABA, " + label) {
        dynamics::forward_dynamics(model, ws, q, v, v, x);
        return x[0];
      };
      BENCHMARK("RNEA, " + label) {
        dynamics::inverse_dynamics(model, ws, q, v, v, x);
        return x[0];
      };
      dynamics::DerivativesWorkspace derivatives(model);
      Eigen::MatrixXd A(n, n), B(n, n), C(n, n);
      BENCHMARK("derivatives of RNEA, " + label) {
        dynamics::inverse_dynamics_derivatives(model, derivatives, q, v, v, A, B, C);
        return A(0, 0);
      };
      BENCHMARK("derivatives of ABA, " + label) {
        dynamics::forward_dynamics_derivatives(model, derivatives, q, v, v, x, A, B, C);
        return A(0, 0);
      };
      dynamics::KineticDerivatives kinetic(n);
      dynamics::PotentialDerivatives potential(n);
      BENCHMARK("second derivatives of the energies, " + label) {
        dynamics::energy_derivatives(model, derivatives, q, v, kinetic, potential);
        return kinetic.M(0, 0);
      };
    }
  }
}

TEST_CASE("time of a pose and a Jacobian at many states", "[!benchmark][dynamics]") {
  constexpr int n = 7, states = 100000, block = 128;
  const model::Model model(chain(n, false));
  const int tip = model::Model::tip_frame;
  const auto reference = dynamics::Reference::local_world_aligned;
  dynamics::StatesXd q(n, states), poses(12, states), jacobians(6 * n, states);
  for (Eigen::Index s = 0; s < states; ++s)
    for (Eigen::Index i = 0; i < n; ++i) q(i, s) = std::sin(0.1 * static_cast<double>(s * n + i));
  const Eigen::MatrixXd columns = q;
  BENCHMARK("100000 states, one by one") {
    dynamics::Workspace ws(model);
    dynamics::Matrix6Xd J(6, n);
    double sum = 0.0;
    for (Eigen::Index s = 0; s < states; ++s) {
      dynamics::forward_kinematics(model, ws, columns.col(s));
      dynamics::frame_jacobian(model, ws, tip, reference, J);
      sum += dynamics::frame_pose(model, ws, tip).p().x() + J(0, 0);
    }
    return sum;
  };
  for (const int threads : {1, 2}) {
    dynamics::FrameBatch batch(model, tip, {.threads = threads});
    BENCHMARK(fmt::format("100000 states at once, {} threads", threads)) {
      batch.evaluate(q, poses, jacobians);
      return jacobians(0, 0);
    };
  }
  dynamics::FrameBatch batch(model, tip);
  dynamics::StatesXd some(n, block), block_poses(12, block), block_jacobians(6 * n, block);
  BENCHMARK("100000 states, in blocks of 128 that stay in the cache") {
    double sum = 0.0;
    for (Eigen::Index s = 0; s + block <= states; s += block) {
      some = q.middleCols(s, block);
      batch.evaluate(some, block_poses, block_jacobians);
      sum += block_poses(9, 0) + block_jacobians(0, 0);
    }
    return sum;
  };
}
