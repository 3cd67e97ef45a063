#include <fmt/format.h>
#include <Eigen/Geometry>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/dynamics_batch.hpp"
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

namespace {

constexpr int many_joints = 7;
// Blocks stay in the caches. Their rows should not be a power of two apart, where they would
// displace each other.
constexpr Eigen::Index many_states = 100000, states_of_a_block = 136;

dynamics::StatesXd states_of_sines(double step) {
  dynamics::StatesXd x(many_joints, many_states);
  for (Eigen::Index s = 0; s < many_states; ++s)
    for (Eigen::Index i = 0; i < many_joints; ++i)
      x(i, s) = std::sin(step * static_cast<double>(s * many_joints + i));
  return x;
}

// Calls f(first) for all whole blocks.
template <class F>
void for_blocks(const F& f) {
  for (Eigen::Index first = 0; first + states_of_a_block <= many_states; first += states_of_a_block)
    f(first);
}

dynamics::StatesXd new_block(Eigen::Index rows) {
  return dynamics::StatesXd::Zero(rows, states_of_a_block);
}

}  // namespace

// Divide by 100000 for the time of a state. The results of "at once" have 43 MB; what writing as
// many bytes takes without computing anything is the bound that memory sets.
TEST_CASE("time of a pose and a Jacobian at many states", "[!benchmark][dynamics]") {
  const model::Model model(chain(many_joints, false));
  const int tip = model::Model::tip_frame;
  const auto reference = dynamics::Reference::local_world_aligned;
  const dynamics::StatesXd q = states_of_sines(0.1);
  dynamics::StatesXd poses = dynamics::StatesXd::Zero(12, many_states),
                     jacobians = dynamics::StatesXd::Zero(6 * many_joints, many_states);
  const Eigen::MatrixXd columns = q;
  BENCHMARK("100000 states, one by one") {
    dynamics::Workspace ws(model);
    dynamics::Matrix6Xd J(6, many_joints);
    double sum = 0.0;
    for (Eigen::Index s = 0; s < many_states; ++s) {
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
  BENCHMARK("100000 states at once, results in new memory") {
    dynamics::StatesXd new_poses(12, many_states), new_jacobians(6 * many_joints, many_states);
    batch.evaluate(q, new_poses, new_jacobians);
    return new_jacobians(0, 0);
  };
  dynamics::StatesXd some = new_block(many_joints), block_poses = new_block(12),
                     block_jacobians = new_block(6 * many_joints);
  BENCHMARK("100000 states, in blocks that stay in the cache") {
    double sum = 0.0;
    for_blocks([&](Eigen::Index first) {
      some = q.middleCols(first, states_of_a_block);
      batch.evaluate(some, block_poses, block_jacobians);
      sum += block_poses(9, 0) + block_jacobians(0, 0);
    });
    return sum;
  };
}

TEST_CASE("time of a pose and a Jacobian at many states: the bound of memory",
          "[!benchmark][dynamics]") {
  dynamics::StatesXd from = dynamics::StatesXd::Zero(54, many_states), to = from;
  const std::size_t bytes = static_cast<std::size_t>(to.size()) * sizeof(double);
  BENCHMARK("memset of as many bytes") {
    std::memset(to.data(), 1, bytes);
    return to(0, 0);
  };
  BENCHMARK("memcpy of as many bytes") {
    std::memcpy(to.data(), from.data(), bytes);
    return to(0, 0);
  };
}

namespace {

// Arguments and results of matrices at many states, of blocks of them and of one state.
struct MatrixCalls {
  static constexpr Eigen::Index n = many_joints, entries = n * n;
  struct Results {
    explicit Results(Eigen::Index states)
        : a(dynamics::StatesXd::Zero(n, states)),
          A(dynamics::StatesXd::Zero(entries, states)),
          B(A),
          C(A) {}
    dynamics::StatesXd a, A, B, C;
  };
  // f(q, v, x) at one state after the other
  template <class F>
  double one_by_one(const F& f) {
    double sum = 0.0;
    for (Eigen::Index s = 0; s < many_states; ++s) {
      f(q_columns.col(s), v_columns.col(s), x_columns.col(s));
      sum += A(0, 0);
    }
    return sum;
  }
  // f(q, v, x, results) in blocks
  template <class F>
  double in_blocks(const F& f) {
    double sum = 0.0;
    for_blocks([&](Eigen::Index first) {
      some_q = q.middleCols(first, states_of_a_block);
      some_v = v.middleCols(first, states_of_a_block);
      some_x = x.middleCols(first, states_of_a_block);
      f(some_q, some_v, some_x, some);
      sum += some.A(0, 0);
    });
    return sum;
  }

  model::Model model{chain(many_joints, false)};
  dynamics::StatesXd q = states_of_sines(0.1), v = states_of_sines(0.3), x = states_of_sines(0.7),
                     some_q = new_block(n), some_v = some_q, some_x = some_q;
  Results all{many_states}, some{states_of_a_block};
  Eigen::MatrixXd q_columns = q, v_columns = v, x_columns = x, A{n, n}, B{n, n}, C{n, n};
  VectorXd a{n};
  dynamics::DerivativesWorkspace ws{model};
  dynamics::DynamicsBatch batch{model};
};

}  // namespace

TEST_CASE("time of mass matrices at many states", "[!benchmark][dynamics]") {
  MatrixCalls calls;
  BENCHMARK("mass matrix, 100000 states one by one") {
    return calls.one_by_one([&](const auto& q, const auto&, const auto&) {
      dynamics::mass_matrix(calls.model, calls.ws.ws, q, calls.A);
    });
  };
  BENCHMARK("mass matrix, at once") {
    calls.batch.mass_matrix(calls.q, calls.all.A);
    return calls.all.A(0, 0);
  };
  BENCHMARK("mass matrix, in blocks") {
    return calls.in_blocks([&](const auto& q, const auto&, const auto&, auto& out) {
      calls.batch.mass_matrix(q, out.A);
    });
  };
}

TEST_CASE("time of derivatives of RNEA at many states", "[!benchmark][dynamics]") {
  MatrixCalls calls;
  const auto many = [&](const auto& q, const auto& v, const auto& x, auto& out) {
    calls.batch.inverse_dynamics_derivatives(q, v, x, out.A, out.B, out.C);
  };
  BENCHMARK("derivatives of RNEA, 100000 states one by one") {
    return calls.one_by_one([&](const auto& q, const auto& v, const auto& x) {
      dynamics::inverse_dynamics_derivatives(calls.model, calls.ws, q, v, x, calls.A, calls.B,
                                             calls.C);
    });
  };
  BENCHMARK("derivatives of RNEA, at once") {
    many(calls.q, calls.v, calls.x, calls.all);
    return calls.all.A(0, 0);
  };
  BENCHMARK("derivatives of RNEA, in blocks") {
    return calls.in_blocks(many);
  };
}

TEST_CASE("time of derivatives of ABA at many states", "[!benchmark][dynamics]") {
  MatrixCalls calls;
  const auto many = [&](const auto& q, const auto& v, const auto& x, auto& out) {
    calls.batch.forward_dynamics_derivatives(q, v, x, out.a, out.A, out.B, out.C);
  };
  BENCHMARK("derivatives of ABA, 100000 states one by one") {
    return calls.one_by_one([&](const auto& q, const auto& v, const auto& x) {
      dynamics::forward_dynamics_derivatives(calls.model, calls.ws, q, v, x, calls.a, calls.A,
                                             calls.B, calls.C);
    });
  };
  BENCHMARK("derivatives of ABA, at once") {
    many(calls.q, calls.v, calls.x, calls.all);
    return calls.all.A(0, 0);
  };
  BENCHMARK("derivatives of ABA, in blocks") {
    return calls.in_blocks(many);
  };
}
