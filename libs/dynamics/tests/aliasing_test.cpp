// Results that share memory with arguments: bit for bit those of separate memory, for every public
// function, kind of chain and instruction set.
#include <catch2/catch.hpp>
#include <functional>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

constexpr int chain_dof = 6;

// Kinds of chains that have sweeps of their own.
struct Kind {
  bool planar, prismatic, rotors;
};
constexpr Kind kinds[] = {{false, false, false}, {false, false, true}, {false, true, true},
                          {true, false, false},  {true, false, true},  {true, true, true}};

Model make_model(const Kind& kind, int joints = chain_dof) {
  model::Robot robot = test::random_robot(17, joints, kind.prismatic ? 3 : 0, kind.planar);
  if (kind.rotors)
    for (auto& link : robot.links) link.joint.armature = 0.3;
  return Model(std::move(robot));
}

// f(model, instruction set)
template <class F>
void each_kind(F&& f) {
  for (const Kind& kind : kinds)
    for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
      if (!is_available(isa)) continue;
      CAPTURE(kind.planar, kind.prismatic, kind.rotors, name_of(isa));
      f(make_model(kind), isa);
    }
}

VectorXd joints(std::uint64_t seed) {
  Rng rng(seed);
  return test::random_joints(rng, chain_dof);
}

// A function of vectors with one result. Arguments it does not have are not read.
using Function = std::function<void(const ConstVectorRef& q, const ConstVectorRef& v,
                                    const ConstVectorRef& x, VectorRef out)>;
struct Named {
  std::string name;
  Function call;
};

// The result of `function` in a vector that overlaps its argument number `argument` in all but
// |shift| numbers.
VectorXd in_shared_memory(const Function& function, int argument, Index shift) {
  VectorXd given[] = {joints(1), joints(2), joints(3)};
  VectorXd memory = VectorXd::Zero(3 * chain_dof);
  auto shared = memory.segment(chain_dof, chain_dof);
  shared = given[argument];
  const auto at = [&](int k) -> ConstVectorRef {
    return k == argument ? ConstVectorRef(shared) : ConstVectorRef(given[k]);
  };
  function(at(0), at(1), at(2), memory.segment(chain_dof + shift, chain_dof));
  return memory.segment(chain_dof + shift, chain_dof);
}

}  // namespace

TEST_CASE("a joint vector that is written may share memory with those that are read",
          "[dynamics][aliasing]") {
  each_kind([](const Model& model, Isa isa) {
    Workspace ws(model, isa);
    DerivativesWorkspace dws(model, isa);
    MatrixXd A(chain_dof, chain_dof), B(chain_dof, chain_dof), C(chain_dof, chain_dof);
    const std::vector<GyroscopicTerm> terms{
        {chain_dof - 1, Vector3d(0.1, 0.2, 0.3), Vector3d(3.0, -1.0, 2.0)}};
    const std::vector<Named> functions{
        {"inverse_dynamics",
         [&](auto& q, auto& v, auto& x, auto out) { inverse_dynamics(model, ws, q, v, x, out); }},
        {"forward_dynamics",
         [&](auto& q, auto& v, auto& x, auto out) { forward_dynamics(model, ws, q, v, x, out); }},
        {"bias_torque",
         [&](auto& q, auto& v, auto&, auto out) { bias_torque(model, ws, q, v, out); }},
        {"gravity_torque",
         [&](auto& q, auto&, auto&, auto out) { gravity_torque(model, ws, q, out); }},
        {"solve_mass",
         [&](auto& q, auto&, auto& x, auto out) { solve_mass(model, ws, q, x, out); }},
        {"momentum", [&](auto& q, auto& v, auto&, auto out) { momentum(model, ws, q, v, out); }},
        {"gyroscopic_torque", [&](auto& q, auto& v, auto&,
                                  auto out) { gyroscopic_torque(model, ws, q, v, terms, out); }},
        {"forward_dynamics_derivatives", [&](auto& q, auto& v, auto& x, auto out) {
           forward_dynamics_derivatives(model, dws, q, v, x, out, A, B, C);
         }}};
    for (const Named& function : functions) {
      VectorXd apart(chain_dof);
      function.call(joints(1), joints(2), joints(3), apart);
      for (const int argument : {0, 1, 2})
        for (const Index shift : {0, 1, -1, 3, -3}) {
          CAPTURE(function.name, argument, shift);
          CHECK(in_shared_memory(function.call, argument, shift) == apart);
        }
    }
  });
}

TEST_CASE("a matrix that is written may hold the joint vectors that are read",
          "[dynamics][aliasing]") {
  each_kind([](const Model& model, Isa isa) {
    Workspace ws(model, isa);
    DerivativesWorkspace dws(model, isa);
    const VectorXd q = joints(1), v = joints(2), x = joints(3);
    MatrixXd M(chain_dof, chain_dof), apart(chain_dof, chain_dof);
    mass_matrix(model, ws, q, apart);
    M.col(2) = q;
    mass_matrix(model, ws, M.col(2), M);
    CHECK(M == apart);

    // Each matrix in turn holds the arguments in its columns.
    VectorXd a(chain_dof), a_shared(chain_dof);
    MatrixXd dq(chain_dof, chain_dof), dv(chain_dof, chain_dof), dx(chain_dof, chain_dof);
    for (const int forward : {0, 1})
      for (const int holder : {0, 1, 2}) {
        CAPTURE(forward, holder);
        MatrixXd out[] = {MatrixXd::Zero(chain_dof, chain_dof),
                          MatrixXd::Zero(chain_dof, chain_dof),
                          MatrixXd::Zero(chain_dof, chain_dof)};
        MatrixXd& held = out[holder];
        held.col(0) = q, held.col(3) = v, held.col(5) = x;
        if (forward == 1) {
          forward_dynamics_derivatives(model, dws, q, v, x, a, dq, dv, dx);
          forward_dynamics_derivatives(model, dws, held.col(0), held.col(3), held.col(5), a_shared,
                                       out[0], out[1], out[2]);
          CHECK(a_shared == a);
        } else {
          inverse_dynamics_derivatives(model, dws, q, v, x, dq, dv, dx);
          inverse_dynamics_derivatives(model, dws, held.col(0), held.col(3), held.col(5), out[0],
                                       out[1], out[2]);
        }
        CHECK(out[0] == dq);
        CHECK(out[1] == dv);
        CHECK(out[2] == dx);
      }

    // The acceleration is computed first, and the derivatives still need its arguments.
    forward_dynamics_derivatives(model, dws, q, v, x, a, dq, dv, dx);
    for (const int argument : {0, 1, 2}) {
      CAPTURE(argument);
      VectorXd given[] = {q, v, x};
      MatrixXd out[] = {MatrixXd::Zero(chain_dof, chain_dof), MatrixXd::Zero(chain_dof, chain_dof),
                        MatrixXd::Zero(chain_dof, chain_dof)};
      forward_dynamics_derivatives(model, dws, given[0], given[1], given[2], given[argument],
                                   out[0], out[1], out[2]);
      CHECK(given[argument] == a);
      CHECK(out[0] == dq);
      CHECK(out[1] == dv);
      CHECK(out[2] == dx);
    }
  });
}

TEST_CASE("derivatives of the energies may hold the joint vectors that are read",
          "[dynamics][aliasing]") {
  each_kind([](const Model& model, Isa isa) {
    DerivativesWorkspace ws(model, isa);
    const VectorXd q = joints(1), v = joints(2);
    KineticDerivatives kinetic(chain_dof), shared(chain_dof);
    PotentialDerivatives potential(chain_dof), shared_potential(chain_dof);
    energy_derivatives(model, ws, q, v, kinetic, potential);
    const auto check = [&] {
      CHECK(shared.p == kinetic.p);
      CHECK(shared.dK_dq == kinetic.dK_dq);
      CHECK(shared.M == kinetic.M);
      CHECK(shared.dp_dq == kinetic.dp_dq);
      CHECK(shared.d2K_dq2 == kinetic.d2K_dq2);
    };
    for (VectorXd* const at_q : {&shared.p, &shared.dK_dq})
      for (VectorXd* const at_v : {&shared.p, &shared.dK_dq}) {
        if (at_q == at_v) continue;
        *at_q = q, *at_v = v;
        kinetic_derivatives(model, ws, *at_q, *at_v, shared);
        check();
        *at_q = q, *at_v = v;
        energy_derivatives(model, ws, *at_q, *at_v, shared, shared_potential);
        check();
        CHECK(shared_potential.d2U_dq2 == potential.d2U_dq2);
      }
    shared.M.col(0) = q, shared.d2K_dq2.col(1) = v;
    kinetic_derivatives(model, ws, shared.M.col(0), shared.d2K_dq2.col(1), shared);
    check();
    shared_potential.dU_dq = q;
    potential_derivatives(model, ws, shared_potential.dU_dq, shared_potential);
    CHECK(shared_potential.dU_dq == potential.dU_dq);
    CHECK(shared_potential.d2U_dq2 == potential.d2U_dq2);
    shared_potential.d2U_dq2.col(4) = q;
    potential_derivatives(model, ws, shared_potential.d2U_dq2.col(4), shared_potential);
    CHECK(shared_potential.d2U_dq2 == potential.d2U_dq2);
  });
}

TEST_CASE("the result of many states may be one of their arguments, but not overlap it in part",
          "[dynamics][aliasing]") {
  const Index states = 11;  // whole packets of lanes and a part of one
  each_kind([&](const Model& model, Isa isa) {
    BatchWorkspace ws(model, isa);
    for (const bool forward : {false, true}) {
      const auto call = [&](const ConstStatesRef& q, const ConstStatesRef& v,
                            const ConstStatesRef& x, StatesRef out) {
        forward ? forward_dynamics(model, ws, q, v, x, out)
                : inverse_dynamics(model, ws, q, v, x, out);
      };
      StatesXd given[3], apart(chain_dof, states);
      for (int k = 0; k < 3; ++k) {
        given[k].resize(chain_dof, states);
        for (Index s = 0; s < states; ++s)
          given[k].col(s) = joints(static_cast<std::uint64_t>(10 * s + k));
      }
      call(given[0], given[1], given[2], apart);
      for (const int argument : {0, 1, 2}) {
        CAPTURE(forward, argument);
        StatesXd shared[] = {given[0], given[1], given[2]};
        call(shared[0], shared[1], shared[2], shared[argument]);
        CHECK(shared[argument] == apart);

        // one block of a wide matrix, and its neighbours
        StatesXd wide = StatesXd::Zero(chain_dof, 3 * states),
                 separate = StatesXd::Zero(chain_dof, 3 * states);
        wide.middleCols(states, states) = given[argument];
        const auto block = [&](int k) -> ConstStatesRef {
          if (k == argument) return wide.middleCols(states, states);
          separate.middleCols(k * states, states) = given[k];
          return separate.middleCols(k * states, states);
        };
        const auto into = [&](Index first) {
          return test::error_of(
              [&] { call(block(0), block(1), block(2), wide.middleCols(first, states)); });
        };
        CHECK(into(0) == "no error");
        CHECK(wide.leftCols(states) == apart);
        CHECK(into(2 * states) == "no error");
        CHECK(wide.rightCols(states) == apart);
        for (const Index shift : {1, -1, 10, -10}) {
          CAPTURE(shift);
          CHECK_THAT(into(states + shift), Catch::Contains("overlaps ") &&
                                               Catch::Contains(" in part, expected the same"));
        }
        CHECK(wide.middleCols(states, states) == given[argument]);
        // rows further down
        StatesXd tall = StatesXd::Zero(2 * chain_dof, states);
        tall.middleRows(1, chain_dof) = given[argument];
        const auto rows = [&](int k) -> ConstStatesRef {
          return k == argument ? ConstStatesRef(tall.middleRows(1, chain_dof))
                               : ConstStatesRef(given[k]);
        };
        CHECK_THAT(test::error_of([&] {
                     call(rows(0), rows(1), rows(2), tall.middleRows(chain_dof, chain_dof));
                   }),
                   Catch::Contains("in part"));
      }
    }
  });
}

TEST_CASE("a row of a Jacobian may be the point or the direction that is given",
          "[dynamics][aliasing]") {
  const Model model = make_model({false, true, false}, 3);
  Workspace ws(model);
  forward_kinematics(model, ws, joints(1).head(3));
  const Vector3d point(0.3, -0.2, 0.5), direction(0.1, 0.7, -0.4);
  VectorXd apart(3);
  point_jacobian_transpose(model, ws, 2, point, direction, apart);
  Vector3d shared = point;
  point_jacobian_transpose(model, ws, 2, shared, direction, shared);
  CHECK(shared == apart);
  shared = direction;
  point_jacobian_transpose(model, ws, 2, point, shared, shared);
  CHECK(shared == apart);
  // the vector of a gyroscopic term
  std::vector<GyroscopicTerm> terms{{2, point, direction}};
  const VectorXd q = joints(1).head(3), v = joints(2).head(3);
  gyroscopic_torque(model, ws, q, v, terms, apart);
  gyroscopic_torque(model, ws, q, v, terms, terms[0].w_world);
  CHECK(terms[0].w_world == apart);
}
