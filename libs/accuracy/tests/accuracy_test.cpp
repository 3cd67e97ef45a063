#include "hamelin/accuracy/accuracy.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/model/make_chain.hpp"

using namespace hamelin;
using namespace hamelin::accuracy;
using Eigen::VectorXd;

namespace {

model::Model chain(int links, const std::string& axes = "x,z,x") {
  model::ChainOptions options;
  options.links = links;
  options.axes = axes;
  return model::Model(model::make_chain(options));
}

model::Model planar3() {
  return model::Model(description::read_robot(
      std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots/planar3.json", {}));
}

Options free_fall(const std::string& schemes, const VectorXd& q0, double duration_s) {
  Options options;
  options.name = "test";
  options.q0 = q0;
  options.v0 = VectorXd::Zero(q0.size());
  options.duration_s = duration_s;
  options.schemes = read_schemes(schemes);
  options.timing_s = 0.0;
  return options;
}

VectorXd numbers(const std::vector<double>& x) {
  return Eigen::Map<const VectorXd>(x.data(), static_cast<long>(x.size()));
}

/// A rod that swings about one end in closed form: with φ the angle from hanging, φ'' = −ω² sin φ
/// and rest at φ0, sin(φ/2) = k cd(ωt, k), k = sin(φ0/2) (Whittaker, Analytical Dynamics, §44).
/// Jacobi's functions by descending Landen transforms (Abramowitz and Stegun, 16.4): amplitudes
/// from the arithmetic-geometric mean.
struct Pendulum {
  double q, v;
};
Pendulum pendulum(double phi0, double omega, double t) {
  const double k = std::sin(0.5 * phi0), u = omega * t;
  std::vector<double> a{1.0}, c{k};
  double b = std::sqrt(1.0 - k * k);
  while (std::abs(c.back()) > 1e-16) {
    const double mean = 0.5 * (a.back() + b);
    c.push_back(0.5 * (a.back() - b));
    b = std::sqrt(a.back() * b);
    a.push_back(mean);
  }
  double amplitude = std::ldexp(a.back() * u, static_cast<int>(a.size()) - 1);
  for (std::size_t n = a.size() - 1; n > 0; --n)
    amplitude = 0.5 * (amplitude + std::asin(c[n] / a[n] * std::sin(amplitude)));
  const double sn = std::sin(amplitude), cn = std::cos(amplitude),
               dn = std::sqrt(1.0 - k * k * sn * sn);
  const double phi = 2.0 * std::asin(k * cn / dn);
  const double half_period = 2.0 * std::comp_ellint_1(k);
  const bool falling = std::fmod(u, 2.0 * half_period) < half_period;
  const double speed = omega * std::sqrt(2.0 * (std::cos(phi) - std::cos(phi0)));
  return {phi - std::numbers::pi / 2.0, falling ? -speed : speed};
}

Json without_timing(Json document) {
  for (auto& row : document["rows"]) row.erase("cpu_us");
  return document;
}

}  // namespace

TEST_CASE("the reference of a pendulum agrees with the closed form, within its own error",
          "[accuracy]") {
  // one link along y about x, gravity along -z: q = 0 is level, φ = q + π/2
  const double length = 0.2, radius = 0.03, com = 0.5 * length;
  const double inertia = length * length / 12.0 + radius * radius / 4.0 + com * com;
  const double omega = std::sqrt(9.81 * com / inertia);
  const auto model = chain(1);
  for (const double q0 : {-1.2, 0.0, 1.1})
    for (const double duration_s : {0.3, 2.0}) {
      CAPTURE(q0, duration_s);
      auto options = free_fall("rk4,hamel-variational", numbers({q0}), duration_s);
      options.steps_s = {0.01, 0.005};
      const Pendulum exact = pendulum(q0 + std::numbers::pi / 2.0, omega, duration_s);
      const Measurement found = measure(model, options);
      REQUIRE(found.reference.has_value());
      CHECK(found.reference->error_q < 1e-11);
      CHECK(std::abs(found.reference->q[0] - exact.q) < 3e-12);
      CHECK(std::abs(found.reference->v[0] - exact.v) < 3e-11);
      for (const auto& row : found.rows) {
        auto integrator = integration::make_integrator(row.integrator, model);
        auto state = integrator->start(options.q0, options.v0);
        for (long k = 0; k < row.steps; ++k)
          REQUIRE(
              integrator->step(state, {}, duration_s / static_cast<double>(row.steps)).converged);
        CHECK(std::abs(*row.error_q - std::abs(state.q[0] - exact.q)) < 3e-12);
      }
    }
}

TEST_CASE("the reference of spatial chains agrees with an independent program's", "[accuracy]") {
  // RK4 with 40 000 steps by an independent program, T = 0.5 s: q(T) from this project's reference
  // data.
  struct Case {
    std::vector<double> q0, q;
  };
  const std::vector<Case> cases{
      {{0.3, -0.25, 0.4}, {-2.34194673151142, 0.223630086085084, 0.160257721060387}},
      {{0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6},
       {-1.19333714080065, 0.0531078097491988, 0.226574331425119, 0.0265211887336785,
        -0.325661532073833, 0.330097906158339, 1.29168507184085}}};
  for (const auto& [q0, q] : cases) {
    CAPTURE(q0.size());
    const auto reference =
        find_reference(chain(static_cast<int>(q0.size())), free_fall("rk4", numbers(q0), 0.5));
    CHECK(reference.error_q < 1e-10);
    CHECK((reference.q - numbers(q)).lpNorm<Eigen::Infinity>() < 1e-10);
  }
}

TEST_CASE("the reference of a long chain, whose coarse steps find no root, has a small error",
          "[accuracy]") {
  VectorXd q0(20);
  for (int i = 0; i < 20; ++i)
    q0[i] = std::vector<double>{
        0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6}[static_cast<std::size_t>(i % 7)];
  const auto reference = find_reference(chain(20), free_fall("rk4", q0, 1.0));
  CHECK(reference.error_q < 1e-9);
}

TEST_CASE("errors of rows fall with the order of their schemes", "[accuracy]") {
  auto options = free_fall("semi-implicit-euler,hamel-midpoint,hamel-variational,rk4",
                           numbers({0.3, -0.25, 0.4}), 0.5);
  options.steps_s = {0.002, 0.001, 0.0005};
  const Measurement found = measure(chain(3), options);
  REQUIRE(found.rows.size() == 12);
  for (std::size_t i = 0; i < found.rows.size(); ++i) {
    const auto& row = found.rows[i];
    if (i % 3 == 0) continue;
    CAPTURE(row.integrator, *row.step_s);
    const double expected_order = row.integrator == "semi-implicit-euler" ? 1.0
                                  : row.integrator == "rk4"               ? 4.0
                                                                          : 2.0;
    CHECK(row.order == static_cast<int>(expected_order));
    CHECK(std::log2(*found.rows[i - 1].error_q / *row.error_q) ==
          Approx(expected_order).margin(0.15));
    CHECK(row.steps == std::lround(0.5 / *row.step_s));
  }
  CHECK(found.rows[0].tolerance == std::nullopt);
  CHECK(found.rows[3].tolerance == 1e-8);   // of the feedback
  CHECK(found.rows[6].tolerance == 1e-12);  // of Newton
}

TEST_CASE("under step control errors fall with the tolerance", "[accuracy]") {
  auto options = free_fall("dop853", numbers({0.3, -0.25, 0.4}), 1.0);
  options.rtols = {1e-4, 1e-7, 1e-10};
  const Measurement found = measure(chain(3), options);
  REQUIRE(found.rows.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK_FALSE(found.rows[i].step_s.has_value());
    CHECK(found.rows[i].atol == found.rows[i].rtol);
    CHECK(*found.rows[i].error_q < 1e2 * options.rtols[i]);
    if (i > 0) {
      CHECK(*found.rows[i].error_q < 0.1 * *found.rows[i - 1].error_q);
      CHECK(found.rows[i].evaluations > found.rows[i - 1].evaluations);
    }
  }
}

TEST_CASE("drift: a line is found, exactly without and within the interval with an oscillation",
          "[accuracy]") {
  Drift line, swinging;
  for (int i = 0; i <= 10000; ++i) {
    const double t = 0.01 * i;
    line.add(t, 3.0 - 0.25 * t);
    swinging.add(t, 1e-3 * t + 0.5 * std::sin(40.0 * t));
  }
  CHECK(line.samples() == 10001);
  CHECK(line.slope()->value == Approx(-0.25).epsilon(1e-12));
  CHECK(line.slope()->half_width < 1e-12);
  CHECK(std::abs(swinging.slope()->value - 1e-3) < swinging.slope()->half_width);
  CHECK(swinging.slope()->half_width < 2e-4);
  Drift few;
  for (int i = 0; i < 15; ++i) few.add(i, 1.0);
  CHECK_FALSE(few.slope().has_value());
  few.add(15.0, 1.0);
  CHECK(few.slope()->value == Approx(0.0).margin(1e-15));
}

TEST_CASE(
    "drift: the interval contains the true slope as often as stated for autocorrelated samples",
    "[accuracy]") {
  // x_k = 0.98 x_{k-1} + noise: a hundred neighbours hardly say more than one. A regression that
  // takes samples for independent has an interval that is too narrow by √((1 + 0.98)/(1 − 0.98)) ≈
  // 10.
  constexpr int series = 300, count = 20000;
  constexpr double slope = 2e-3;
  int contained = 0, naive = 0;
  for (std::uint64_t seed = 1; seed <= series; ++seed) {
    Rng rng(seed);
    Drift drift;
    double x = 0.0, tt = 0.0, te = 0.0, ee = 0.0, mean = 0.0;
    std::vector<double> values;
    for (int i = 0; i < count; ++i) {
      x = 0.98 * x + rng.normal();
      values.push_back(x + slope * 0.01 * i);
      drift.add(0.01 * i, values.back());
      mean += values.back() / count;
    }
    for (int i = 0; i < count; ++i) {
      const double t = 0.01 * (i - 0.5 * (count - 1)),
                   e = values[static_cast<std::size_t>(i)] - mean;
      tt += t * t;
      te += t * e;
      ee += e * e;
    }
    const double plain = te / tt, width = 1.96 * std::sqrt((ee - te * plain) / (count - 2) / tt);
    naive += std::abs(plain - slope) < width ? 1 : 0;
    contained += std::abs(drift.slope()->value - slope) < drift.slope()->half_width ? 1 : 0;
    CHECK(std::abs(drift.slope()->value - plain) < 0.2 * drift.slope()->half_width);
  }
  CHECK(contained >= 0.93 * series);
  CHECK(naive < 0.3 * series);
}

TEST_CASE("energy: the published scheme drifts by the known rate, the variational one does not",
          "[accuracy]") {
  // Example 5.1 of Shen, Wang, Shi (2021) over 100 s: the energy error of hamel (α = ½) grows
  // linearly to 0.08 J, that of the variational scheme stays below 1.76e-4 J.
  auto options = free_fall("hamel,hamel-variational", VectorXd::Zero(3), 100.0);
  options.steps_s = {0.01};
  options.reference = false;
  const Measurement found = measure(planar3(), options);
  const auto &hamel = found.rows[0], &variational = found.rows[1];
  CHECK(std::abs(*hamel.drift_J_per_s) > 10.0 * *hamel.drift_ci_J_per_s);
  CHECK(std::abs(*hamel.drift_J_per_s) == Approx(8.5e-4).epsilon(0.15));
  CHECK(*variational.energy_error_max_J < 1.8e-4);
  CHECK(std::abs(*variational.drift_J_per_s) < *variational.drift_ci_J_per_s);
  CHECK(*variational.drift_ci_J_per_s < 1e-6);
  CHECK(variational.energy_samples == 10001);
  CHECK_FALSE(variational.error_q.has_value());
  CHECK_FALSE(variational.reference_error.has_value());
}

TEST_CASE("energy is sampled at the requested interval, and always at the last node",
          "[accuracy]") {
  auto options = free_fall("rk4", VectorXd::Zero(3), 1.0);
  options.steps_s = {0.01};
  options.reference = false;
  options.every = 7;
  CHECK(measure(planar3(), options).rows[0].energy_samples == 1 + 14 + 1);
}

TEST_CASE("energy dissipated by damping is booked and is not an error", "[accuracy]") {
  auto options = free_fall("rk4", numbers({0.3, -0.25, 0.4}), 2.0);
  options.channels.damping = VectorXd::Constant(3, 0.05);
  options.steps_s = {0.002};
  const auto row = measure(chain(3), options).rows[0];
  CHECK(*row.error_q < 1e-6);
  CHECK(*row.energy_error_max_J < 1e-5);
}

TEST_CASE("a run that diverges gives a row that says so, and other runs are not affected",
          "[accuracy]") {
  auto options = free_fall("rk4,hamel-variational,dop853",
                           numbers({0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6}), 20.0);
  options.steps_s = {5.0, 20.0};
  options.rtols = {1e-3};
  options.reference = false;
  const Measurement found = measure(chain(7), options);
  REQUIRE(found.rows.size() == 7);
  const auto& row = found.rows[0];
  CHECK_FALSE(row.completed);
  CHECK(row.cause.has_value());
  for (const auto& value : {row.error_q, row.energy_error_max_J, row.drift_J_per_s, row.cpu_us})
    CHECK_FALSE(value.has_value());
  CHECK(found.rows.back().completed);
  CHECK_NOTHROW(check_shipped_schema(to_json(found), "accuracy", "test"));
  CHECK_THAT(to_table(found), Catch::Contains("diverged"));
}

TEST_CASE("the same inputs give the same bytes except for times, and JSON keeps every field",
          "[accuracy]") {
  auto options = free_fall("hamel-variational,rk4,dop853", numbers({0.3, -0.25, 0.4}), 0.5);
  options.steps_s = {0.01, 0.005};
  options.rtols = {1e-6};
  options.tolerances = {1e-8, 1e-12};
  std::size_t reported = 0;
  options.progress = [&](std::size_t done, std::size_t all) {
    CHECK(done == ++reported);
    CHECK(all == 4 + 2 + 2 + 1);
  };
  const Measurement first = measure(chain(3), options);
  reported = 0;
  const Json document = to_json(first), again = to_json(measure(chain(3), options));
  CHECK(reported == 9);
  CHECK(without_timing(document).dump() == without_timing(again).dump());
  CHECK_NOTHROW(check_shipped_schema(document, "accuracy", "test"));
  CHECK(to_json(measurement_from_json(document, "test")).dump() == document.dump());
  for (const auto& row : document["rows"]) CHECK(row["cpu_us"] > 0.0);
  Json wrong = document;
  wrong["rows"][0].erase("mode");
  CHECK_THROWS_AS(measurement_from_json(wrong, "test"), Error);
}

namespace {

Row row_of(const std::string& integrator, double step_s, double error_q, double cpu_us) {
  Row row;
  row.integrator = integrator;
  row.order = 2;
  row.step_s = step_s;
  row.error_q = row.error_v = error_q;
  row.reference_error = row.reference_error_v = 2e-7;
  row.reference_limited = error_q <= 2e-7;
  row.energy_error_max_J = 0.0;
  row.cpu_us = cpu_us;
  row.isa = "x86-64";
  row.mode = integrator == "gauss" ? "structure" : "accurate";
  if (integrator == "gauss") row.tolerance = 1e-12;
  return row;
}

Measurement hand_made() {
  Measurement all;
  all.name = "<arm> & 'co'";
  all.dof = 3;
  all.duration_s = 1.0;
  all.reference = Reference{numbers({1, 2, 3}), numbers({1, 2, 3}), 2e-7, 4e-7, "a", "b", 10};
  all.rows = {row_of("gauss", 0.1, 5e-3, 8.0), row_of("gauss", 0.05, 3e-6, 20.0),
              row_of("gauss", 0.04, 2e-6, 16.0), row_of("rk4", 0.1, 9e-3, 10.0),
              row_of("rk4", 0.01, 0.0, 100.0)};
  all.notes = {"a <note>"};
  return all;
}

}  // namespace

TEST_CASE("each row names the instruction set that it ran on", "[accuracy]") {
  Options options = free_fall("hamel,hamel-midpoint,hamel-variational,lie-exact,rk4",
                              VectorXd::Constant(3, 0.3), 0.02);
  options.steps_s = {0.01};
  options.reference = false;
  const Measurement measured = measure(chain(3), options);
  REQUIRE(measured.rows.size() == 5);
  const std::string best(name_of(default_isa())), baseline(name_of(Isa::baseline));
  for (const auto& row : measured.rows) {
    CAPTURE(row.integrator);
    const bool compiled_once = row.integrator == "hamel" || row.integrator == "hamel-midpoint" ||
                               row.integrator == "lie-exact";
    CHECK(row.isa == (compiled_once ? baseline : best));
  }
  Measurement shown = hand_made();
  shown.rows[3].isa = "v3";
  CHECK_THAT(to_markdown(shown), Catch::Contains("Instruction set: x86-64; v3 for rk4."));
}

TEST_CASE(
    "the cost of an error is that of the cheapest row whose error plus the reference's own is "
    "below it",
    "[accuracy]") {
  const auto all = cheapest(hand_made());
  REQUIRE(all.size() == 2);
  REQUIRE(error_targets().size() == 9);
  CHECK(all[0].settings == "gauss, tolerance 1e-12, structure");
  CHECK(all[0].rows[0] == 0);  // 1e-2
  CHECK(all[0].rows[1] == 2);  // 1e-3
  CHECK(all[0].rows[3] == 2);  // 1e-5
  CHECK_FALSE(all[0].rows[4].has_value());
  CHECK(all[1].settings == "rk4");
  CHECK(all[1].rows[4] == 4);  // 1e-6
  // 1e-7: the row has no difference, but the reference's own error is larger
  CHECK_FALSE(all[1].rows[5].has_value());
  const std::string table = to_table(hand_made());
  CHECK_THAT(table, Catch::Contains("best of hamelin over rk4            0.80   0.16"));
  CHECK_THAT(table, Catch::Contains("rk4 takes less time for an error of 1e-06.\n"));
  CHECK_THAT(table, Catch::Contains("<=2.0e-07"));
  const std::string markdown = to_markdown(hand_made());
  CHECK_THAT(markdown, Catch::Contains("| ≤ 2.0e-07 |"));
  CHECK_THAT(markdown, Catch::Contains("4 of 5 rows measured"));
}

TEST_CASE(
    "the page's JSON has each row with its label and error bound, and the same tables as the text",
    "[accuracy]") {
  const Json page = page_json({hand_made(), hand_made()});
  CHECK(page["format"] == "hamelin.accuracy-page/1");
  REQUIRE(page["measurements"].size() == 2);
  const Json& shown = page["measurements"][0];
  CHECK(shown["name"] == "<arm> & 'co'");  // the page shows it as text, never as HTML
  CHECK(shown["notes"] == Json{"a <note>"});
  CHECK(shown["reference_error"] == 2e-7);
  REQUIRE(shown["rows"].size() == 5);
  const Json document = to_json(hand_made());
  for (std::size_t i = 0; i < 5; ++i) {
    Json row = shown["rows"][i];
    CHECK(row["label"] == hand_made().rows[i].label());
    CHECK(row["error_bound"] == *hand_made().rows[i].error_bound());
    row.erase("label");
    row.erase("error_bound");
    CHECK(row == document["rows"][i]);
  }
  CHECK(shown["rows"][4]["reference_limited"] == true);
  CHECK(shown["costs"]["rows"].size() == 3);  // gauss, rk4, and the best of hamelin over rk4
  CHECK(shown["costs"]["comparisons_from"] == 2);
  CHECK(shown["costs"]["rows"][2][0] == "best of hamelin over rk4");
  CHECK(shown["costs"]["head"].size() == 1 + error_targets().size());
  CHECK(shown["cheaper_peers"] == "rk4 takes less time for an error of 1e-06.");
  CHECK(shown["table"]["rows"].size() == 5);
  for (const Json& row : shown["table"]["rows"]) CHECK(row.size() == shown["table"]["head"].size());
}

TEST_CASE("the page's JSON of a diverged run without a reference has null for unknown values",
          "[accuracy]") {
  Measurement lone = hand_made();
  lone.reference.reset();
  lone.rows.resize(1);
  lone.rows[0].completed = false;
  for (auto* value : {&lone.rows[0].error_q, &lone.rows[0].reference_error, &lone.rows[0].cpu_us})
    value->reset();
  const Json shown = page_json({lone})["measurements"][0];
  CHECK(shown["reference_error"].is_null());
  CHECK(shown["costs"].is_null());
  CHECK(shown["rows"][0]["error_bound"].is_null());
  CHECK(shown["rows"][0]["cpu_us"].is_null());
  CHECK(shown["table"]["rows"][0][6] == "diverged");
}

TEST_CASE("lists of integrators are read, or refused with what was expected", "[accuracy]") {
  const auto schemes = read_schemes("hamel-variational,gauss:8,gauss:12");
  REQUIRE(schemes.size() == 3);
  CHECK(schemes[0].order == 0);
  CHECK(schemes[2].integrator == "gauss");
  CHECK(schemes[2].order == 12);
  for (const char* wrong :
       {"", "rk4,", ",rk4", "rk4:", "rk4:x", "rk4:-2", "rk4:8.5", ":4", "rk4,rk4"}) {
    CAPTURE(wrong);
    CHECK_THROWS_WITH(read_schemes(wrong), Catch::StartsWith("--integrators: "));
  }
}

TEST_CASE("options that cannot be measured are refused before any work", "[accuracy]") {
  const auto model = chain(3);
  const auto refused = [&](const auto& change, const char* words) {
    auto options = free_fall("rk4", VectorXd::Zero(3), 1.0);
    options.steps_s = {0.1};
    change(options);
    CHECK_THROWS_WITH(measure(model, options), Catch::Contains(words));
  };
  refused([](auto& o) { o.schemes = {{"rk5", 0}}; }, "did you mean 'rk4'?");
  refused([](auto& o) { o.schemes = {{"rk4", 6}}; }, "'rk4'");
  refused([](auto& o) { o.schemes.clear(); }, "--integrators");
  refused([](auto& o) { o.steps_s = {0.3}; }, "not an integer multiple of the step 0.3 s");
  refused([](auto& o) { o.steps_s = {-0.1}; }, "-0.1 s is not a step");
  refused([](auto& o) { o.steps_s = {2.0}; }, "not an integer multiple of the step 2 s");
  refused([](auto& o) { o.steps_s = {1e-12}; }, "too many");
  refused([](auto& o) { o.steps_s.clear(); }, "neither --steps nor --rtol");
  refused(
      [](auto& o) {
        o.steps_s.clear();
        o.rtols = {1e-6};
      },
      "'rk4' has no step control, expected --steps");
  refused([](auto& o) { o.rtols = {0.0}; }, "--rtol: 0 given");
  refused([](auto& o) { o.tolerances = {-1.0}; }, "--tolerance: -1 given");
  refused([](auto& o) { o.atol = std::nan(""); }, "--atol: nan given");
  refused([](auto& o) { o.duration_s = 0.0; }, "--duration: 0 given");
  refused([](auto& o) { o.q0 = VectorXd::Zero(2); }, "--q0: 2 values given, expected 3");
}
