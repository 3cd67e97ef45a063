#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/test/chains.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

VectorXd vector_of(const Json& numbers) {
  VectorXd x(static_cast<Eigen::Index>(numbers.size()));
  for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = numbers[static_cast<std::size_t>(i)];
  return x;
}

// The end of a run and its largest counts; a step that does not converge fails the test.
struct Run {
  State state;
  int updates_max = 0, factorizations_max = 0;
  double energy_error_max = 0.0;
};

Run run(Integrator& integrator, const VectorXd& q0, const VectorXd& v0, double h, long steps,
        const Channels& channels = {}) {
  Run out;
  out.state = integrator.start(q0, v0);
  const double energy = integrator.energy(out.state).total();
  for (long k = 0; k < steps; ++k) {
    const auto report = integrator.step(out.state, channels, h);
    REQUIRE(report.converged);
    out.updates_max = std::max(out.updates_max, report.updates);
    out.factorizations_max = std::max(out.factorizations_max, report.factorizations);
    out.energy_error_max =
        std::max(out.energy_error_max, std::abs(integrator.energy(out.state).total() - energy));
  }
  return out;
}

// Motions from an implementation that shares no code with this one.
const Json& golden() {
  static const Json motions = read_json(HAMELIN_SOURCE_DIR "/data/golden/integration/motions.json");
  return motions;
}

// q(0.5 s) and v(0.5 s) of chains of cylinders that start at rest, by RK4 with 40000 steps.
struct Reference {
  int n;
  VectorXd q0, q, v;
};
const std::vector<Reference>& references() {
  static const std::vector<Reference> all = [] {
    std::vector<Reference> read;
    for (const auto& r : golden()["rk4_reference"])
      read.push_back({r["n"], vector_of(r["q0"]), vector_of(r["qT"]), vector_of(r["vT"])});
    return read;
  }();
  return all;
}

}  // namespace

TEST_CASE("example 5.1 gives the published schemes' reference figures", "[integration][golden]") {
  const Model model(test::planar3());
  REQUIRE(model.planar());
  REQUIRE(golden()["schemes"].size() == 6);
  for (const auto& scheme : golden()["schemes"]) {
    const std::string name = scheme["scheme"];
    Parameters options;
    options.start = Start::published;
    options.alpha = scheme.contains("alpha") && scheme["alpha"].is_number()
                        ? scheme["alpha"].get<double>()
                        : 0.5;
    for (const bool feedback : {true, false}) {
      if (name == "hamel-variational") {
        options.solver = feedback ? Solver::feedback : Solver::newton;
      } else if (!feedback) {
        continue;
      }
      CAPTURE(name, options.alpha, feedback);
      const auto integrator = make_integrator(name, model, options);
      State state = integrator->start(VectorXd::Zero(3), VectorXd::Zero(3));
      const double energy = integrator->energy(state).total();
      double energy_error = 0.0;
      for (long k = 1; k <= 10000; ++k) {
        const auto report = integrator->step(state, {}, 0.01);
        REQUIRE(report.converged);
        REQUIRE(report.updates <= 4);
        energy_error = std::max(energy_error, std::abs(integrator->energy(state).total() - energy));
        for (const auto& sample : scheme["samples"])
          if (sample["k"] == k && k <= 1000)
            CHECK((state.q - vector_of(sample["q"])).lpNorm<Eigen::Infinity>() < 1e-8);
      }
      CHECK(energy_error == Approx(scheme["max_energy_error_J"].get<double>()).epsilon(1e-4));
      if (name == "hamel-variational") CHECK(energy_error <= 1.8e-4);
    }
  }
}

TEST_CASE("observed orders against an independent RK4 reference", "[integration][order]") {
  struct Expected {
    std::string name;
    double order;
  };
  const auto expected = GENERATE(Expected{"hamel", 1.0}, Expected{"hamel-midpoint", 2.0},
                                 Expected{"hamel-variational", 2.0}, Expected{"lie-exact", 2.0},
                                 Expected{"newmark", 2.0}, Expected{"semi-implicit-euler", 1.0},
                                 Expected{"rk4", 4.0}, Expected{"energy-attractor", 4.0});
  for (const auto& reference : references()) {
    CAPTURE(expected.name, reference.n);
    const Model model(test::spatial_chain(reference.n));
    std::vector<double> errors;
    for (const int steps : {250, 500, 1000, 2000}) {
      const auto integrator = make_integrator(expected.name, model);
      const auto out =
          run(*integrator, reference.q0, VectorXd::Zero(reference.n), 0.5 / steps, steps);
      VectorXd v(reference.n);
      integrator->velocity(out.state, v);
      errors.push_back((out.state.q - reference.q).norm() + 0.1 * (v - reference.v).norm());
    }
    for (std::size_t i = 1; i < errors.size(); ++i)
      CHECK(std::log2(errors[i - 1] / errors[i]) == Approx(expected.order).margin(0.2));
  }
}

TEST_CASE("the published start costs hamel-midpoint its second order", "[integration][order]") {
  const auto& reference = references()[0];
  const Model model(test::spatial_chain(3));
  Parameters options;
  options.start = Start::published;
  std::vector<double> errors;
  for (const int steps : {500, 1000, 2000})
    errors.push_back((run(*make_integrator("hamel-midpoint", model, options), reference.q0,
                          VectorXd::Zero(3), 0.5 / steps, steps)
                          .state.q -
                      reference.q)
                         .norm());
  for (std::size_t i = 1; i < errors.size(); ++i)
    CHECK(std::log2(errors[i - 1] / errors[i]) == Approx(1.0).margin(0.1));
}

TEST_CASE("Newton needs at most three solves per step on chains of 3 to 200 links at 1 ms",
          "[integration][newton]") {
  const int n = GENERATE(3, 20, 100, 200);
  const Model model(test::spatial_chain(n));
  VectorXd q0(n);
  for (int i = 0; i < n; ++i) q0[i] = 0.3 * std::sin(1.0 + i);
  const auto out =
      run(*make_integrator("hamel-variational", model), q0, VectorXd::Zero(n), 1e-3, 300);
  CAPTURE(n);
  CHECK(out.factorizations_max <= 3);
}

TEST_CASE(
    "one variational step solves the discrete Euler-Lagrange equation made of kinetic and "
    "potential energy",
    "[integration][property]") {
  // Independent of the recursion: the values of L_d and its derivatives by differences,
  // docs/theory.md (4.1), (4.2).
  struct Case {
    std::uint64_t seed;
    int n, prismatic_every;
    bool planar;
  };
  const auto c = GENERATE(Case{1, 5, 0, false}, Case{2, 6, 2, false}, Case{3, 4, 3, true});
  CAPTURE(c.seed);
  const Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar));
  dynamics::Workspace ws(model);
  Rng rng(c.seed);
  const VectorXd q0 = test::random_joints(rng, c.n), v0 = test::random_joints(rng, c.n);
  const double h = 0.01;
  const auto integrator = make_integrator("hamel-variational", model);
  State state = integrator->start(q0, v0);
  const VectorXd p0 = state.p;
  REQUIRE(integrator->step(state, {}, h).converged);
  const auto lagrangian = [&](const VectorXd& a, const VectorXd& b) {
    const VectorXd mid = 0.5 * (a + b), rate = (b - a) / h;
    return h * (dynamics::kinetic_energy(model, ws, mid, rate) -
                0.5 * dynamics::potential_energy(model, ws, a) -
                0.5 * dynamics::potential_energy(model, ws, b));
  };
  const double e = 1e-5;
  for (int i = 0; i < c.n; ++i) {
    VectorXd ap = q0, am = q0, bp = state.q, bm = state.q;
    ap[i] += e, am[i] -= e, bp[i] += e, bm[i] -= e;
    CHECK(-(lagrangian(ap, state.q) - lagrangian(am, state.q)) / (2 * e) ==
          Approx(p0[i]).margin(1e-6 * p0.norm()));
    CHECK((lagrangian(q0, bp) - lagrangian(q0, bm)) / (2 * e) ==
          Approx(state.p[i]).margin(1e-6 * p0.norm()));
  }
}

TEST_CASE(
    "all integrators give the same motion under damping, friction, rotors, held torque and "
    "gyroscopic terms",
    "[integration][channels]") {
  const bool planar = GENERATE(false, true);
  auto robot = test::random_robot(7, 4, 0, planar);
  robot.links[1].joint.armature = 0.1;
  robot.links[3].joint.armature = 0.02;
  const Model model(robot);
  Rng rng(7);
  const VectorXd q0 = test::random_joints(rng, 4), v0 = test::random_joints(rng, 4);
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.3);
  channels.coulomb = VectorXd::Constant(4, 0.05);
  channels.coulomb_speed = 2.0;  // smooth enough to observe the orders
  channels.held_torque = test::random_joints(rng, 4, 2.0);
  const Eigen::Vector3d normal = model.robot().links[0].joint.screw.head<3>();
  channels.gyroscopic = {{1, test::random_vector(rng, 0.2), 2.0 * normal},
                         {3, test::random_vector(rng, 0.2), -1.0 * normal}};
  const auto truth = run(*make_integrator("rk4", model), q0, v0, 0.5 / 4000, 4000, channels).state;
  for (const auto& name : integrator_names()) {
    if (name == "rk4") continue;
    CAPTURE(name);
    const auto integrator = make_integrator(name, model);
    if (integrator->adaptive()) {  // the tolerance decides, not the step
      CHECK((run(*integrator, q0, v0, 0.05, 10, channels).state.q - truth.q).norm() < 1e-7);
      continue;
    }
    const double power = std::pow(2.0, integrator->order());
    const bool high = integrator->order() > 2;
    const int steps = high ? 20 : 500;  // high orders: few enough to stay above rounding
    const VectorXd coarse =
        run(*make_integrator(name, model), q0, v0, 0.5 / steps, steps, channels).state.q;
    const VectorXd fine = run(*integrator, q0, v0, 0.25 / steps, 2 * steps, channels).state.q;
    const double coarse_error = (coarse - truth.q).norm(), fine_error = (fine - truth.q).norm();
    if (high) {  // not yet in the asymptotic range at every such step
      CHECK(coarse_error < 1e-4);
      CHECK(fine_error < std::max(4.0 * coarse_error / power, 1e-11));
      continue;
    }
    CHECK(coarse_error / fine_error == Approx(power).epsilon(0.1));
    // Richardson extrapolation removes the leading error
    const VectorXd extrapolated = fine + (fine - coarse) / (power - 1.0);
    CHECK((extrapolated - truth.q).norm() < 0.05 * fine_error);
  }
}

TEST_CASE("the booked work closes the energy account of the variational step",
          "[integration][channels]") {
  const Model model(test::random_robot(8, 4));
  Rng rng(8);
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.5);
  channels.held_torque = test::random_joints(rng, 4, 1.0);
  channels.gyroscopic = {{2, test::random_vector(rng, 0.2), test::random_vector(rng, 3.0)}};
  const auto integrator = make_integrator("hamel-variational", model);
  std::vector<double> errors;
  for (const int steps : {250, 500, 1000}) {
    State state = integrator->start(VectorXd::Constant(4, 0.3), VectorXd::Constant(4, 1.0));
    const double start = integrator->energy(state).total();
    double booked = 0.0, worst = 0.0;
    for (int k = 0; k < steps; ++k) {
      const auto report = integrator->step(state, channels, 1.0 / steps);
      REQUIRE(report.converged);
      CHECK(std::abs(report.gyroscopic_work_J) < 1e-14);
      CHECK(report.dissipated_J >= 0.0);
      booked += report.held_work_J - report.dissipated_J;
      worst = std::max(worst, std::abs(integrator->energy(state).total() - start - booked));
    }
    errors.push_back(worst);
  }
  CHECK(errors[0] / errors[1] == Approx(4.0).epsilon(0.2));
  CHECK(errors[1] / errors[2] == Approx(4.0).epsilon(0.2));
}

TEST_CASE("with smaller steps every scheme's booked work closes its energy account more exactly",
          "[integration][channels]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(8, 4));
  Rng rng(8);
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.5);
  channels.held_torque = test::random_joints(rng, 4, 1.0);
  channels.gyroscopic = {{2, test::random_vector(rng, 0.2), test::random_vector(rng, 3.0)}};
  std::vector<double> errors;
  for (const int steps : {200, 400}) {
    const auto integrator = make_integrator(name, model);
    State state = integrator->start(VectorXd::Constant(4, 0.3), VectorXd::Constant(4, 1.0));
    const double start = integrator->energy(state).total();
    double booked = 0.0;
    for (int k = 0; k < steps; ++k) {
      const auto report = integrator->step(state, channels, 0.5 / steps);
      REQUIRE(report.converged);
      booked += report.held_work_J - report.dissipated_J + report.gyroscopic_work_J;
    }
    CHECK(std::abs(booked) > 0.1);
    errors.push_back(std::abs(integrator->energy(state).total() - start - booked));
  }
  CHECK(errors[1] < std::max(0.6 * errors[0], 1e-8));
  CHECK(errors[1] < 0.1);
}

TEST_CASE(
    "two runs give the same bits, and a copied state continues with the same bits in another "
    "object",
    "[integration][determinism]") {
  const auto name = GENERATE(from_range(integrator_names()));
  const bool planar = GENERATE(false, true);
  CAPTURE(name, planar);
  const Model model(test::random_robot(11, 4, 3, planar));
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.1);
  const VectorXd q0 = VectorXd::Constant(4, 0.3), v0 = VectorXd::Constant(4, 0.5);
  const auto run_steps = [&](Integrator& integrator, State& state, int steps) {
    for (int k = 0; k < steps; ++k) REQUIRE(integrator.step(state, channels, 2e-3).converged);
  };
  const auto first = make_integrator(name, model), second = make_integrator(name, model);
  State a = first->start(q0, v0), b = second->start(q0, v0);
  run_steps(*first, a, 20);
  run_steps(*second, b, 20);
  CHECK(a.q == b.q);
  State copy = a;
  run_steps(*first, a, 20);
  const auto third = make_integrator(name, model);
  run_steps(*third, copy, 20);
  run_steps(*second, b, 20);
  VectorXd va(4), vb(4), vc(4);
  first->velocity(a, va);
  second->velocity(b, vb);
  third->velocity(copy, vc);
  CHECK(a.q == b.q);
  CHECK(a.q == copy.q);
  CHECK(va == vb);
  CHECK(va == vc);
}

TEST_CASE("node impulses add momentum, node velocities replace it", "[integration][channels]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(9, 4));
  dynamics::Workspace ws(model);
  Rng rng(9);
  const VectorXd q0 = test::random_joints(rng, 4), v0 = test::random_joints(rng, 4),
                 dp = test::random_joints(rng, 4);
  const auto integrator = make_integrator(name, model);
  State state = integrator->start(q0, v0);
  VectorXd v(4), p(4), before(4);
  integrator->velocity(state, v);
  CHECK((v - v0).norm() < 1e-12);
  for (int k = 0; k < 3; ++k) REQUIRE(integrator->step(state, {}, 1e-3).converged);
  integrator->velocity(state, v);
  dynamics::momentum(model, ws, state.q, v, before);
  integrator->kick(state, dp);
  integrator->velocity(state, v);
  dynamics::momentum(model, ws, state.q, v, p);
  CHECK((p - before - dp).norm() < 1e-11);
  integrator->set_velocity(state, v0);
  integrator->velocity(state, v);
  CHECK((v - v0).norm() < 1e-12);
}

TEST_CASE("a state has only the velocity or the momentum of its node", "[integration][state]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(9, 4));
  dynamics::Workspace ws(model);
  const auto integrator = make_integrator(name, model);
  State state = integrator->start(VectorXd::Constant(4, 0.3), VectorXd::Constant(4, 0.5));
  const auto check = [&] {
    const VectorXd v = test::velocity(*integrator, state);
    VectorXd p(4);
    dynamics::momentum(model, ws, state.q, v, p);
    if (state.v.size() > 0) CHECK(state.v == v);
    if (state.p.size() > 0 && name != "hamel" && name != "hamel-midpoint")
      CHECK((state.p - p).norm() < 1e-12 * p.norm());
    CHECK((state.v.size() == 0) != (state.p.size() == 0));
  };
  check();
  for (int k = 0; k < 3; ++k) REQUIRE(integrator->step(state, {}, 1e-2).converged);
  check();
  integrator->kick(state, VectorXd::Constant(4, 0.2));
  check();
  integrator->set_velocity(state, VectorXd::Constant(4, -0.1));
  check();
  REQUIRE(integrator->advance(state, {}, 1e-2).converged);
  check();
}

TEST_CASE("the variational step is reversible", "[integration][property]") {
  const Model model(test::spatial_chain(5));
  const VectorXd q0 = VectorXd::Constant(5, 0.4), v0 = VectorXd::Constant(5, -0.5);
  const auto integrator = make_integrator("hamel-variational", model);
  State state = integrator->start(q0, v0);
  for (int k = 0; k < 500; ++k) REQUIRE(integrator->step(state, {}, 2e-3).converged);
  VectorXd v(5);
  integrator->velocity(state, v);
  State back = integrator->start(state.q, -v);
  for (int k = 0; k < 500; ++k) REQUIRE(integrator->step(back, {}, 2e-3).converged);
  integrator->velocity(back, v);
  CHECK((back.q - q0).lpNorm<Eigen::Infinity>() < 1e-8);
  CHECK((v + v0).lpNorm<Eigen::Infinity>() < 1e-7);
}

TEST_CASE("the planar and the spatial code give the same motion", "[integration][property]") {
  // A joint tilted by 2e-9 rad forbids the planar code without changing the motion noticeably.
  auto robot = test::planar3();
  const Model planar(robot);
  robot.links[2].joint.screw.head<3>() = Eigen::Vector3d(1.0, 0.0, 2e-9).normalized();
  const Model spatial(robot);
  REQUIRE(planar.planar());
  REQUIRE_FALSE(spatial.planar());
  const VectorXd q0 = VectorXd::Constant(3, 0.2), v0 = VectorXd::Constant(3, 0.1);
  for (const auto& name : integrator_names()) {
    CAPTURE(name);
    const auto a = run(*make_integrator(name, planar), q0, v0, 0.01, 200).state.q;
    const auto b = run(*make_integrator(name, spatial), q0, v0, 0.01, 200).state.q;
    CHECK((a - b).lpNorm<Eigen::Infinity>() < 2e-8);
  }
}

TEST_CASE(
    "energy stays bounded without drift over 10^5 steps, and that of semi-implicit Euler is not "
    "small",
    "[integration][hard]") {
  const Model model(test::planar3());
  const auto worst = [&](const std::string& name, long steps) {
    return run(*make_integrator(name, model), VectorXd::Zero(3), VectorXd::Zero(3), 0.01, steps)
        .energy_error_max;
  };
  for (const std::string name : {"hamel-variational", "lie-exact", "composition"}) {
    CAPTURE(name);
    const double early = worst(name, 10000), late = worst(name, 100000);
    CHECK(early < 1.8e-4);
    CHECK(late < 1.3 * early);
    CHECK(worst("semi-implicit-euler", 10000) > 100.0 * early);
    CHECK(worst("hamel", 10000) > 100.0 * early);
  }
  // energy-attractor holds the energy by force; newmark keeps it near its initial value for some
  // time
  CHECK(worst("energy-attractor", 100000) < 1e-6);
  CHECK(worst("newmark", 10000) < 1e-2);
}

TEST_CASE("a step without a root is halved, and an unconverged step is never used",
          "[integration][hard]") {
  const int n = 50;  // with 50 links of 4 cm the feedback fails at 3 ms (measured)
  const Model model(
      test::chain_along_y(n, 0.04, Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal(), "xzx"));
  VectorXd q0(n);
  for (int i = 0; i < n; ++i) q0[i] = 0.3 * std::sin(1.0 + i);
  Parameters options;
  options.solver = Solver::feedback;
  options.max_halvings = 0;
  const double h = 0.02;
  const auto without_halving = make_integrator("hamel-variational", model, options);
  State state = without_halving->start(q0, VectorXd::Constant(n, 0.5));
  const VectorXd q_before = state.q, p_before = state.p;
  const auto refused = without_halving->step(state, {}, h);
  REQUIRE_FALSE(refused.converged);
  CHECK((state.q - q_before).norm() == 0.0);
  CHECK((state.p - p_before).norm() == 0.0);
  CHECK(state.k == 0);

  options.max_halvings = 12;
  const auto with_halving = make_integrator("hamel-variational", model, options);
  state = with_halving->start(q0, VectorXd::Constant(n, 0.5));
  const auto report = with_halving->step(state, {}, h);
  CHECK(report.converged);
  CHECK(report.halvings > 0);
  CHECK(state.k == 1);
}

TEST_CASE("Newton takes no far root: a whipping chain at a coarse step keeps its energy bounded",
          "[integration][hard]") {
  // At h = 0.01 the falling 7-link chain whips so fast that some steps have no root near the guess;
  // one far away once multiplied the energy by a million.
  const Model model(test::spatial_chain(7));
  const auto integrator = make_integrator("hamel-variational", model);
  State state = integrator->start(VectorXd::Constant(7, 0.3), VectorXd::Zero(7));
  const double start = integrator->energy(state).total();
  int halvings = 0;
  for (int k = 0; k < 2000; ++k) {
    const auto report = integrator->step(state, {}, 0.01);
    CAPTURE(k);
    REQUIRE(report.converged);
    halvings += report.halvings;
    REQUIRE(std::abs(integrator->energy(state).total() - start) < 100.0);
  }
  CHECK(halvings > 0);
}

TEST_CASE("steps from 1e-6 to 0.01 s converge to the motion, with the error of their order",
          "[integration][hard]") {
  const auto name = GENERATE(from_range(integrator_names()));
  const double h = GENERATE(1e-6, 1e-5, 1e-4, 1e-3, 1e-2);
  CAPTURE(name, h);
  const Model model(test::spatial_chain(7));
  const VectorXd q0 = VectorXd::Constant(7, 0.3), rest = VectorXd::Zero(7);
  const auto integrator = make_integrator(name, model);
  State state = integrator->start(q0, rest);
  for (int k = 0; k < 20; ++k) {
    const auto report = integrator->step(state, {}, h);
    REQUIRE(report.converged);
    CHECK(report.halvings == 0);
    CHECK(report.step_s == h);
  }
  CHECK(state.time_s == Approx(20.0 * h).epsilon(1e-14));
  // a scheme of another kind, exact to rounding at these steps
  const auto peer = name == "dop853"
                        ? make_integrator("gauss", model, test::of_order(16))
                        : make_integrator("dop853", model, test::tolerances(1e-13, 1e-13));
  State truth = peer->start(q0, rest);
  for (int k = 0; k < 20; ++k) REQUIRE(peer->step(truth, {}, h).converged);
  // under step control the tolerance of 1e-10 decides
  const double order = integrator->adaptive() ? 8.0 : integrator->order();
  CHECK((state.q - truth.q).lpNorm<Eigen::Infinity>() < std::pow(5.0 * h, order) + 1e-11);
}

TEST_CASE(
    "steps of 0.1 s, which are too long, are halved or fail: the step is complete or the state is "
    "unchanged",
    "[integration][hard]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const double h = 0.1;
  const Model model(test::spatial_chain(7));
  const auto integrator = make_integrator(name, model);
  State state = integrator->start(VectorXd::Constant(7, 0.3), VectorXd::Zero(7));
  int problems = 0;
  for (int k = 0; k < 20; ++k) {
    CAPTURE(k);
    const State before = state;
    const auto report = integrator->step(state, {}, h);
    problems += report.halvings + report.rejected + (report.converged ? 0 : 1);
    if (!report.converged) {
      CHECK(report.step_s == 0.0);
      CHECK(test::same_state(state, before));
      break;
    }
    CHECK(report.step_s == Approx(h).epsilon(1e-14));
    CHECK(state.time_s == Approx((k + 1) * h).epsilon(1e-14));
    CHECK(test::velocity(*integrator, state).allFinite());
    CHECK(state.q != before.q);
  }
  CHECK(problems > 0);
}

TEST_CASE("errors about unknown names and solvers list the known ones", "[integration][unit]") {
  const Model model(test::planar3());
  CHECK_THROWS_WITH(make_integrator("hamel-variatonal", model),
                    Catch::Contains("did you mean 'hamel-variational'"));
  Parameters options;
  options.solver = Solver::newton;
  CHECK_THROWS_WITH(make_integrator("hamel", model, options), Catch::Contains("feedback"));
  CHECK_THROWS_WITH(make_integrator("rk4", model, options), Catch::Contains("takes no solver"));
}
