#include "schemes/gauss_tableau.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/isa.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/test/chains.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

State run(const Model& model, const Parameters& options, const VectorXd& q0, const VectorXd& v0,
          double h, int steps, const Channels& channels = {}) {
  const auto integrator = make_integrator("gauss", model, options);
  State state = integrator->start(q0, v0);
  for (int k = 0; k < steps; ++k) REQUIRE(integrator->step(state, channels, h).converged);
  return state;
}

}  // namespace

TEST_CASE("Gauss steps have the order of twice their stages", "[integration][gauss][order]") {
  const double tolerance = GENERATE(1e-12, 2e-12);  // of momenta, and of velocities
  // A slow swing, so that the errors are in the asymptotic range and well above rounding.
  const Model model(test::random_robot(20, 3, GENERATE(0, 2)));
  const VectorXd q0 = (VectorXd(3) << 0.3, -0.25, 0.4).finished(), v0 = VectorXd::Constant(3, 0.5);
  const VectorXd truth = run(model, test::of_order(16), q0, v0, 1e-3, 800).q;
  const auto rk4 = make_integrator("rk4", model);
  State peer = rk4->start(q0, v0);
  for (int k = 0; k < 16000; ++k) REQUIRE(rk4->step(peer, {}, 0.8 / 16000).converged);
  REQUIRE((truth - peer.q).norm() < 1e-10);
  for (const int order : {4, 6, 8}) {
    auto options = test::of_order(order);
    options.tolerance = tolerance;
    const auto error = [&](int n) {
      return (run(model, options, q0, v0, 0.8 / n, n).q - truth).norm();
    };
    int steps = 2;
    while (error(steps) > 1e-5) ++steps;  // the coarse end of the asymptotic range
    CAPTURE(order, tolerance, steps, error(steps), error(2 * steps));
    const double observed = std::log2(error(steps) / error(2 * steps));
    CHECK(observed > order - 0.7);
  }
  for (const int order : {10, 12, 14, 16})  // errors at the level of rounding
    CHECK((run(model, test::of_order(order), q0, v0, 0.05, 16).q - truth).norm() < 1e-10);
}

TEST_CASE("the tableau meets the simplifying assumptions B(2s), C(s) and D(s), and is symplectic",
          "[integration][gauss][order]") {
  // Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7: with C(s) and D(s),
  // B(2s) gives order 2s.
  for (std::size_t s = 2; s <= kernel::max_stages; ++s) {
    CAPTURE(s);
    const auto t = gauss_tableau(s);
    REQUIRE(t.stages == s);
    const auto a = [&](std::size_t i, std::size_t j) { return t.mu_column[j][i] * t.b[j]; };
    const auto power = [](double c, std::size_t k) { return std::pow(c, static_cast<double>(k)); };
    const auto sum_b = [&](std::size_t k) {
      double sum = 0.0;
      for (std::size_t j = 0; j < s; ++j) sum += t.b[j] * power(t.c[j], k - 1);
      return sum;
    };
    for (std::size_t k = 1; k <= 2 * s; ++k)
      CHECK(std::abs(sum_b(k) - 1.0 / static_cast<double>(k)) < 5e-16);
    // and not B(2s + 1): the error of Gauss quadrature for x^2s is (s!)⁴/((2s+1) (2s)!²)
    const auto stages = static_cast<double>(s);
    const double some = std::tgamma(stages + 1.0), all = std::tgamma(2.0 * stages + 1.0);
    const double missed = std::pow(some * some / all, 2) / (2.0 * stages + 1.0);
    CHECK(1.0 / (2.0 * stages + 1.0) - sum_b(2 * s + 1) == Approx(missed).epsilon(1e-4));
    for (std::size_t i = 0; i < s; ++i) {
      for (std::size_t k = 1; k <= s; ++k) {
        double c = 0.0, d = 0.0;
        for (std::size_t j = 0; j < s; ++j) {
          c += a(i, j) * power(t.c[j], k - 1);
          d += t.b[j] * power(t.c[j], k - 1) * a(j, i);
        }
        const auto degree = static_cast<double>(k);
        CHECK(std::abs(c - power(t.c[i], k) / degree) < 5e-16);
        CHECK(std::abs(d - t.b[i] * (1.0 - power(t.c[i], k)) / degree) < 5e-16);
      }
      for (std::size_t j = 0; j < s; ++j) {
        CHECK(std::abs(t.b[i] * a(i, j) + t.b[j] * a(j, i) - t.b[i] * t.b[j]) < 5e-17);
        CHECK(t.mu_column[j][i] + t.mu_column[i][j] == 1.0);  // exactly
        double square = 0.0;
        for (std::size_t m = 0; m < s; ++m) square += a(i, m) * a(m, j);
        CHECK(std::abs(t.nu_column[j][i] * t.b[j] - square) < 1e-16);
      }
    }
    for (std::size_t i = s; i < kernel::max_stages; ++i) {  // lanes without a stage
      CHECK(t.c[i] == t.c[0]);
      CHECK(t.b[i] == t.b[0]);
      for (std::size_t j = 0; j < s; ++j) CHECK(a(i, j) == a(0, j));
    }
  }
}

TEST_CASE("the guess continues polynomials through the steps before exactly",
          "[integration][gauss]") {
  for (const double ratio : {1.0, 0.3, 2.5}) {
    for (const double ratio_before : {0.0, 1.0, 0.4}) {  // 0: no step before that
      const std::size_t s = GENERATE(2U, 4U, 8U);
      CAPTURE(s, ratio, ratio_before);
      const auto t = gauss_tableau(s);
      const double older_at = ratio_before > 0.0 ? (t.c[s - 1] - 1.0) / ratio_before : 0.0;
      const auto guess = gauss_guess(t, ratio, older_at);
      REQUIRE(guess.nodes == (ratio_before > 0.0 ? s + 1 : s));
      // slopes x^degree, with the step before from x = 0 to 1
      for (std::size_t degree = 0; degree < guess.nodes; ++degree) {
        const auto slope = [&](double x) { return std::pow(x, static_cast<double>(degree)); };
        const auto check = [&](const auto& weight, double expected) {
          double sum = 0.0, size = 0.0;
          for (std::size_t j = 0; j < guess.nodes; ++j) {
            const double term =
                weight(j) * t.b[j < s ? j : s - 1] * slope(j < s ? t.c[j] : older_at);
            sum += term;
            size += std::abs(term);
          }
          CHECK(std::abs(sum - expected) < 2e-14 * size);
        };
        check([&](std::size_t j) { return guess.end[j]; }, 1.0);
        for (std::size_t i = 0; i < s; ++i)
          check([&](std::size_t j) { return guess.column[j][i]; },
                ratio * t.b[i] * slope(1.0 + ratio * t.c[i]));
      }
    }
  }
}

TEST_CASE("Gauss steps are symmetric: integrating back with reversed momentum returns to the start",
          "[integration][gauss]") {
  const Model model(test::random_robot(21, 5, 3));
  Rng rng(21);
  const VectorXd q0 = test::random_joints(rng, 5), v0 = test::random_joints(rng, 5);
  for (const int order : {4, 8, 16}) {
    const auto integrator = make_integrator("gauss", model, test::of_order(order));
    State state = integrator->start(q0, v0);
    const VectorXd p0 = state.p;
    for (int k = 0; k < 20; ++k) REQUIRE(integrator->step(state, {}, 0.02).converged);
    VectorXd back;
    back.resize(5);
    integrator->velocity(state, back);
    State returned = integrator->start(state.q, -back);
    for (int k = 0; k < 20; ++k) REQUIRE(integrator->step(returned, {}, 0.02).converged);
    CHECK((returned.q - q0).norm() < 1e-10);
    CHECK((returned.p + p0).norm() < 1e-9 * (1.0 + p0.norm()));
  }
}

TEST_CASE("Gauss under step control follows its tolerance", "[integration][gauss][step-control]") {
  const Model model(test::spatial_chain(7));
  const VectorXd q0 = VectorXd::Constant(7, 0.3);
  const auto truth = run(model, test::of_order(16), q0, VectorXd::Zero(7), 1e-3, 500);
  for (const int order : {8, 12, 16}) {
    double before = 1.0;
    for (const double rtol : {1e-4, 1e-6, 1e-8}) {
      CAPTURE(order, rtol);
      Parameters options = test::of_order(order);
      options.rtol = options.atol = rtol;
      const auto integrator = make_integrator("gauss", model, options);
      State state = integrator->start(q0, VectorXd::Zero(7));
      state.step_next = 1e-3;
      int steps = 0;
      while (state.time_s < 0.5) {
        const auto report = integrator->advance(state, {}, 0.5 - state.time_s);
        REQUIRE(report.converged);
        REQUIRE(report.step_s > 0.0);
        ++steps;
      }
      const double error = (state.q - truth.q).lpNorm<Eigen::Infinity>();
      CHECK(error < 100.0 * rtol);
      CHECK(error < before);
      CHECK(steps < 500);
      before = error;
    }
  }
}

TEST_CASE("forces act at the stages: Gauss agrees with rk4 under all channels and books their work",
          "[integration][gauss][channels]") {
  const bool planar = GENERATE(false, true);
  const double tolerance = GENERATE(1e-12, 2e-12);  // of momenta, and of velocities
  const Model model(test::random_robot(7, 4, 3, planar));
  Rng rng(7);
  const VectorXd q0 = test::random_joints(rng, 4), v0 = test::random_joints(rng, 4);
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.3);
  channels.coulomb = VectorXd::Constant(4, 0.2);
  channels.coulomb_speed = 0.5;
  channels.held_torque = test::random_joints(rng, 4, 2.0);
  const Eigen::Vector3d normal = model.robot().links[0].joint.screw.head<3>();
  channels.gyroscopic = {
      {1, test::random_vector(rng, 0.2), 2.0 * normal + test::random_vector(rng, 1.0)},
      {3, test::random_vector(rng, 0.2), -1.0 * normal}};
  const auto rk4 = make_integrator("rk4", model);
  State truth = rk4->start(q0, v0);
  for (int k = 0; k < 8000; ++k) REQUIRE(rk4->step(truth, channels, 0.5 / 8000).converged);
  const auto gauss = make_integrator(model, GaussOptions{.order = 8, .tolerance = tolerance});
  State state = gauss->start(q0, v0);
  const double start = gauss->energy(state).total();
  double booked = 0.0;
  for (int k = 0; k < 100; ++k) {
    const auto report = gauss->step(state, channels, 0.005);
    REQUIRE(report.converged);
    CHECK(std::abs(report.gyroscopic_work_J) < 1e-14);
    CHECK(report.dissipated_J > 0.0);
    booked += report.held_work_J - report.dissipated_J;
  }
  CHECK((state.q - truth.q).lpNorm<Eigen::Infinity>() < 1e-9);
  CHECK(std::abs(gauss->energy(state).total() - start - booked) < 1e-8);
}

TEST_CASE("Gauss keeps the energy over long runs at fixed steps iterated to rounding",
          "[integration][gauss]") {
  const Model model(test::planar3());
  const auto gauss = make_integrator("gauss", model, test::of_order(8));
  State state = gauss->start(VectorXd::Zero(3), VectorXd::Zero(3));
  const double start = gauss->energy(state).total();
  double early = 0.0, late = 0.0;
  for (int k = 0; k < 20000; ++k) {
    REQUIRE(gauss->step(state, {}, 0.02).converged);
    if (k % 10 != 0) continue;
    const double error = std::abs(gauss->energy(state).total() - start);
    (k < 10000 ? early : late) = std::max(k < 10000 ? early : late, error);
  }
  CHECK(late < 1e-9);
  CHECK(late < 1.5 * early + 1e-10);
}

namespace {

/// Energy of planar3 (example 5.1 of the paper) from joints and momenta in extended precision, from
/// the planar kinematics of its centres of mass alone. Angles are from the stretched pose along y.
long double planar3_energy(const Model& model, const State& state) {
  using Real = long double;
  const auto& links = model.robot().links;
  Real M[3][3]{}, potential = 0.0L, turned = 0.0L;
  Real origin_y = 0.0L, origin_z = 0.0L, joint_y[3], joint_z[3];
  for (std::size_t i = 0; i < 3; ++i) {
    turned += static_cast<Real>(state.q[static_cast<Eigen::Index>(i)]);
    joint_y[i] = origin_y;
    joint_z[i] = origin_z;
    const Real y = std::cos(turned), z = std::sin(turned), m = links[i].mass_kg;
    const Real com_y = origin_y + 0.05L * y, com_z = origin_z + 0.05L * z;
    for (std::size_t a = 0; a <= i; ++a)
      for (std::size_t b = 0; b <= i; ++b)
        M[a][b] += static_cast<Real>(links[i].inertia_kg_m2(0, 0)) +
                   m * ((com_y - joint_y[a]) * (com_y - joint_y[b]) +
                        (com_z - joint_z[a]) * (com_z - joint_z[b]));
    potential += m * -static_cast<Real>(model.gravity().z()) * com_z;
    origin_y += 0.1L * y;
    origin_z += 0.1L * z;
  }
  // ½ pᵀM⁻¹p by Gaussian elimination
  Real p[3], kinetic = 0.0L;
  for (std::size_t i = 0; i < 3; ++i) p[i] = state.p[static_cast<Eigen::Index>(i)];
  for (std::size_t i = 0; i < 3; ++i) {
    kinetic += 0.5L * p[i] * p[i] / M[i][i];
    for (std::size_t j = i + 1; j < 3; ++j) {
      const Real factor = M[j][i] / M[i][i];
      p[j] -= factor * p[i];
      for (std::size_t k = i; k < 3; ++k) M[j][k] -= factor * M[i][k];
    }
  }
  return kinetic + potential;
}

}  // namespace

TEST_CASE("the energy of Gauss steps iterated to rounding has no slope", "[integration][gauss]") {
  const Model model(test::planar3());
  const auto gauss = make_integrator("gauss", model, test::of_order(8));
  constexpr int blocks = 40, steps = 12500;  // 5·10⁵ steps of 10 ms
  for (const double turned : {0.0, 0.3, -0.4}) {
    State state = gauss->start(VectorXd::Constant(3, turned), VectorXd::Zero(3));
    const long double start = planar3_energy(model, state);
    REQUIRE(static_cast<double>(start) ==
            Approx(gauss->energy(state).total()).epsilon(1e-13).margin(1e-13));
    double rise = 0.0;  // least-squares line through the means of the blocks
    for (int block = 0; block < blocks; ++block) {
      double mean = 0.0;
      for (int k = 0; k < steps; ++k) {
        REQUIRE(gauss->step(state, {}, 0.01).converged);
        if (k % 5 == 0) mean += static_cast<double>(planar3_energy(model, state) - start);
      }
      rise += 6.0 * (2.0 * block - blocks + 1.0) / (blocks * blocks - 1.0) * mean / (steps / 5);
    }
    CAPTURE(turned, 1e15 * rise);
    // 4e-12 J and more if the iteration stops at 1e-14, with rounded coefficients and plain sums
    CHECK(std::abs(rise) < 1e-13);
  }
}

TEST_CASE("all instruction sets give the same motion except for rounding",
          "[integration][gauss][isa]") {
  const Model model(test::random_robot(22, 6, 4));
  Rng rng(22);
  const VectorXd q0 = test::random_joints(rng, 6), v0 = test::random_joints(rng, 6);
  const double tolerance = GENERATE(1e-12, 2e-12);  // of momenta, and of velocities
  for (const int order : {4, 6, 8, 10, 16}) {
    Parameters parameters = test::of_order(order);
    parameters.tolerance = tolerance;
    const VectorXd q = run(model, parameters, q0, v0, 0.005, 50).q;
    for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
      CAPTURE(order, name_of(isa));
      if (!is_available(isa)) continue;
      parameters.isa = isa;
      CHECK((run(model, parameters, q0, v0, 0.005, 50).q - q).lpNorm<Eigen::Infinity>() < 1e-10);
    }
  }
}

TEST_CASE("after impulses gauss is as exact as from a new start, and takes fewer sweeps",
          "[integration][gauss][impulse]") {
  const int order = GENERATE(4, 8, 16);
  const bool kicks = GENERATE(false, true);
  CAPTURE(order, kicks);
  const int n = 7;
  const Model model(test::spatial_chain(n));
  dynamics::Workspace ws(model);
  const auto gauss = make_integrator("gauss", model, test::of_order(order)),
             restarted = make_integrator("gauss", model, test::of_order(order));
  State state = gauss->start(VectorXd::Constant(n, 0.3), VectorXd::Zero(n)), other = state;
  Rng rng(static_cast<std::uint64_t>(order));
  VectorXd v(n), dp(n);
  int sweeps = 0, sweeps_restarted = 0;
  for (int k = 0; k < 100; ++k) {
    v = test::velocity(*gauss, state) + test::random_joints(rng, n, 0.01);
    if (kicks) {
      dynamics::momentum(model, ws, state.q, v, dp);
      gauss->kick(state, dp - state.p);
    } else {
      gauss->set_velocity(state, v);
    }
    other = restarted->start(state.q, v);
    const auto report = gauss->step(state, {}, 1e-3),
               report_restarted = restarted->step(other, {}, 1e-3);
    REQUIRE(report.converged);
    REQUIRE(report_restarted.converged);
    CHECK((state.q - other.q).lpNorm<Eigen::Infinity>() < 1e-13);
    CHECK((state.p - other.p).lpNorm<Eigen::Infinity>() < 1e-13);
    sweeps += report.updates;
    sweeps_restarted += report_restarted.updates;
  }
  CAPTURE(sweeps, sweeps_restarted);
  CHECK(sweeps < 500);
  CHECK(sweeps < 0.85 * sweeps_restarted);
}

TEST_CASE("in accurate mode the state has velocities, and a kick changes them by M⁻¹ of it",
          "[integration][gauss][impulse]") {
  const int n = 5;
  const Model model(test::random_robot(23, n, 3));
  Rng rng(23);
  const auto gauss = make_integrator(model, GaussOptions{.tolerance = 1e-10});
  CHECK(gauss->mode() == "accurate");
  State kicked = gauss->start(test::random_joints(rng, n), test::random_joints(rng, n)),
        set = kicked;
  CHECK(kicked.p.size() == 0);
  const VectorXd change = test::random_joints(rng, n);
  dynamics::Workspace ws(model);
  VectorXd dp(n);
  for (int k = 0; k < 3; ++k) {
    dynamics::momentum(model, ws, kicked.q, change, dp);
    gauss->kick(kicked, dp);
    gauss->set_velocity(set, test::velocity(*gauss, set) + change);
    CHECK((kicked.v - set.v).norm() < 1e-12 * set.v.norm());
    REQUIRE(gauss->step(kicked, {}, 1e-3).converged);
    REQUIRE(gauss->step(set, {}, 1e-3).converged);
    CHECK((kicked.q - set.q).norm() < 1e-12);
  }
}

TEST_CASE("an impulse does not disturb step control of the step after it",
          "[integration][gauss][impulse][step-control]") {
  const int order = GENERATE(4, 8, 16);
  CAPTURE(order);
  const int n = 7;
  const Model model(test::spatial_chain(n));
  auto options = test::tolerances(1e-8, 1e-8);
  options.order = order;
  const auto gauss = make_integrator("gauss", model, options),
             peer = make_integrator("dop853", model, test::tolerances(1e-12, 1e-12));
  const VectorXd jump = VectorXd::Unit(n, 2);
  const auto steps_of = [&](Integrator& integrator, bool impulses, State& state) {
    state = integrator.start(VectorXd::Constant(n, 0.3), VectorXd::Zero(n));
    state.step_next = 1e-3;
    int steps = 0, rejected = 0;
    for (int part = 0; part < 10; ++part) {
      if (impulses && part > 0)
        integrator.set_velocity(state, test::velocity(integrator, state) + jump);
      for (double left = 0.05; left > 0.0; ++steps) {
        const auto report = integrator.advance(state, {}, left);
        REQUIRE(report.converged);
        rejected += report.rejected;
        left = report.step_s == left ? 0.0 : left - report.step_s;
      }
    }
    return steps + rejected;
  };
  State state, truth;
  const int smooth = steps_of(*gauss, false, state), kicked = steps_of(*gauss, true, state);
  (void)steps_of(*peer, true, truth);
  CAPTURE(smooth, kicked);
  CHECK(kicked < 1.2 * smooth);
  CHECK((state.q - truth.q).lpNorm<Eigen::Infinity>() < 1e-6);
}
