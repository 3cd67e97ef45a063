#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>
#include <type_traits>

#include "hamelin/core/error.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;
using Catch::Contains;

// An integrator of a temporary model must not compile.
namespace must_not_compile {

template <class... Given>
concept makes = requires(Given&&... given) {
  make_integrator(std::forward<Given>(given)...);
};
static_assert(makes<const char*, const Model&> && makes<const char*, Model&> &&
              makes<const Model&, GaussOptions>);
static_assert(!makes<const char*, Model> && !makes<const char*, const Model> &&
              !makes<Model, GaussOptions>);
static_assert(!makes<const char*, Model, Parameters> && !makes<const Model, Options>);

template <class O>
concept has_order = requires(O o) {
  o.order;
};
template <class O>
concept has_step_control = requires(O o) {
  o.rtol;
};
static_assert(has_order<GaussOptions> && !has_order<Rk4Options> &&
              !has_step_control<VariationalOptions>);

}  // namespace must_not_compile

namespace {

constexpr int n = 5;

}  // namespace

TEST_CASE("velocity and energy are const", "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(4, n, 3));
  const auto made = make_integrator(name, model);
  const State state = made->start(VectorXd::Constant(n, 0.2), VectorXd::Constant(n, 0.3));
  const Integrator& integrator = *made;
  VectorXd wide = VectorXd::Zero(n + 2);
  integrator.velocity(state, wide.segment(1, n));
  CHECK((wide.segment(1, n) - VectorXd::Constant(n, 0.3)).norm() < 1e-10);
  CHECK((wide[0] == 0.0 && wide[n + 1] == 0.0));
  dynamics::Workspace ws(model);
  CHECK(integrator.energy(state).total() ==
        Approx(dynamics::kinetic_energy(model, ws, state.q, VectorXd::Constant(n, 0.3)) +
               dynamics::potential_energy(model, ws, state.q)));
}

TEST_CASE("every call checks the sizes of its arguments", "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(4, n, 3));
  const auto integrator = make_integrator(name, model);
  const VectorXd good = VectorXd::Constant(n, 0.1), bad = VectorXd::Constant(n + 1, 0.1);
  CHECK_THROWS_WITH(integrator->start(bad, good),
                    Contains("start: q0: 6 numbers given, expected 5 (one per joint of '"));
  CHECK_THROWS_WITH(integrator->start(good, bad), Contains("start: v0: 6 numbers"));
  VectorXd nan = good;
  nan[2] = std::nan("");
  CHECK_THROWS_WITH(integrator->start(nan, good),
                    "start: q0: a number is not finite, expected finite numbers");
  CHECK_THROWS_WITH(integrator->start(good, nan),
                    "start: v0: a number is not finite, expected finite numbers");
  State state = integrator->start(good, good);
  const State before = state;
  VectorXd short_v(n - 1);
  CHECK_THROWS_WITH(integrator->velocity(state, short_v), Contains("velocity: v: 4 numbers"));
  CHECK_THROWS_WITH(integrator->kick(state, bad), Contains("kick: dp: 6 numbers"));
  CHECK_THROWS_WITH(integrator->set_velocity(state, bad), Contains("set_velocity: v: 6 numbers"));
  for (const double h : {0.0, -1e-3, std::nan(""), HUGE_VAL}) {
    CHECK_THROWS_WITH(integrator->step(state, {}, h), Contains("step: a step of"));
    CHECK_THROWS_WITH(integrator->advance(state, {}, h), Contains("advance: a step of"));
  }
  const auto refuses = [&](const char* message, auto&& change) {
    Channels channels;
    change(channels);
    CHECK_THROWS_WITH(integrator->step(state, channels, 1e-3), Contains(message));
  };
  refuses("step: channels.damping: 6 numbers", [&](Channels& c) { c.damping = bad; });
  refuses("step: channels.coulomb: 6 numbers", [&](Channels& c) { c.coulomb = bad; });
  refuses("step: channels.held_torque: 4 numbers", [&](Channels& c) { c.held_torque = short_v; });
  refuses("step: channels.gyroscopic: link 5 given", [&](Channels& c) {
    c.gyroscopic = {{n, {}, {}}};
  });
  refuses("step: channels.gyroscopic: link -1 given", [&](Channels& c) {
    c.gyroscopic = {{-1, {}, {}}};
  });
  CHECK(test::same_state(state, before));
}

TEST_CASE("a state of another scheme or robot is refused, a state of the same scheme is accepted",
          "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(4, n, 3)), larger(test::random_robot(4, n + 1, 3));
  const auto integrator = make_integrator(name, model), twin = make_integrator(name, model);
  const VectorXd zero = VectorXd::Zero(n);
  State own = twin->start(zero, zero);
  CHECK(integrator->step(own, {}, 1e-4).converged);
  State foreign =
      make_integrator(name, larger)->start(VectorXd::Zero(n + 1), VectorXd::Zero(n + 1));
  CHECK_THROWS_WITH(integrator->step(foreign, {}, 1e-4),
                    Contains("step: state.q: 6 numbers given, expected 5"));
  CHECK_THROWS_WITH(integrator->energy(foreign),
                    Contains("energy: state.q: 6 numbers given, expected 5"));
  State bare;
  bare.q = zero;
  CHECK_THROWS_WITH(integrator->step(bare, {}, 1e-4),
                    Contains("step: state: 0 velocities, 0 momenta"));
  VectorXd v(n);
  CHECK_THROWS_WITH(integrator->velocity(bare, v), Contains("velocity: state: 0 velocities"));
  CHECK_THROWS_WITH(integrator->energy(bare), Contains("energy: state: 0 velocities"));
  CHECK_THROWS_WITH(integrator->kick(bare, v), Contains("kick: state: 0 velocities"));
  CHECK_THROWS_WITH(integrator->set_velocity(bare, v),
                    Contains("set_velocity: state: 0 velocities"));
}

TEST_CASE("a state of gauss of another order is refused", "[integration][gauss][unit]") {
  const Model model(test::random_robot(4, n));
  const auto four = make_integrator("gauss:4", model), eight = make_integrator("gauss:8", model);
  State state = four->start(VectorXd::Zero(n), VectorXd::Zero(n));
  CHECK_THROWS_WITH(eight->step(state, {}, 1e-3), Contains("82 numbers of memory given"));
}

TEST_CASE("an integrator whose model was replaced at its address is refused",
          "[integration][unit]") {
  for (const std::string& name : integrator_names()) {
    CAPTURE(name);
    std::optional<Model> place(std::in_place, test::random_robot(1, n));
    const auto integrator = make_integrator(name, *place);
    State state = integrator->start(VectorXd::Zero(n), VectorXd::Zero(n));
    place.emplace(test::random_robot(2, n));
    CHECK_THROWS_WITH(integrator->step(state, {}, 1e-3), Contains("made for another model"));
    CHECK_THROWS_WITH(integrator->energy(state), Contains("made for another model"));
  }
}

TEST_CASE("a name can include the order", "[integration][unit]") {
  const Model model(test::random_robot(4, n));
  CHECK(make_integrator("gauss:8", model)->order() == 8);
  CHECK(make_integrator("gauss:12", model)->order() == 12);
  CHECK(make_integrator("composition:6", model)->order() == 6);
  CHECK(make_integrator("gauss:8", model)->name() == "gauss");
  CHECK(make_integrator("gauss:6", model, test::of_order(6))->order() == 6);
  CHECK(find_scheme("gauss:8") == find_scheme("gauss"));
  CHECK_THROWS_WITH(make_integrator("gauss:7", model),
                    "integrator 'gauss' has no order 7, expected one of 4, 6, 8, 10, 12, 14, 16");
  CHECK_THROWS_WITH(make_integrator("rk4:4", model),
                    "integrator 'rk4' has one order, expected none");
  CHECK_THROWS_WITH(make_integrator("gaus:8", model), Contains("integrator 'gaus' is not known"));
  for (const char* text : {"gauss:", "gauss:x", "gauss:8x", "gauss:-8", "gauss: 8", "gauss:8:8"})
    CHECK_THROWS_WITH(make_integrator(text, model),
                      Contains("is not an order, expected a name and a number such as gauss:8"));
  CHECK_THROWS_WITH(make_integrator("gauss:8", model, test::of_order(6)),
                    Contains("order 6 is also given"));
}

TEST_CASE("a scheme made from options equals the scheme made by name", "[integration][unit]") {
  const Model model(test::random_robot(4, n));
  const VectorXd q0 = VectorXd::Constant(n, 0.2);
  const auto end = [&](Integrator& integrator) {
    State state = integrator.start(q0, VectorXd::Zero(n));
    for (int k = 0; k < 20; ++k) REQUIRE(integrator.step(state, {}, 0.01).converged);
    return state.q;
  };
  for (const auto& name : integrator_names()) {
    CAPTURE(name);
    const Options options = make_options(name);
    const auto by_name = make_integrator(name, model), by_options = make_integrator(model, options);
    CHECK(by_options->name() == name);
    CHECK(end(*by_name) == end(*by_options));
  }
  CHECK(end(*make_integrator(model, GaussOptions{.order = 6})) ==
        end(*make_integrator("gauss:6", model)));
  Parameters riqn;
  riqn.solver = Solver::riqn;
  CHECK(end(*make_integrator(model, LieExactOptions{.solver = LieExactOptions::Solver::riqn})) ==
        end(*make_integrator("lie-exact", model, riqn)));
  Parameters published;
  published.alpha = 0.25;
  published.start = Start::published;
  CHECK(end(*make_integrator(model, HamelOptions{.alpha = 0.25, .start = Start::published})) ==
        end(*make_integrator("hamel", model, published)));
  CHECK(make_integrator(model, Dop853Options{.rtol = 1e-6})->tolerance() == 1e-6);
  CHECK(make_integrator(model, Dop853Options{.rtol = 1e-6})->adaptive());
  CHECK(make_integrator(model, VariationalOptions{.solver = VariationalOptions::Solver::feedback})
            ->tolerance() == 1e-8);
}

TEST_CASE("options out of range are refused", "[integration][unit]") {
  const Model model(test::random_robot(4, n));
  const auto refuses = [&](const Options& options, const char* message) {
    CHECK_THROWS_WITH(make_integrator(model, options), Contains(message));
  };
  refuses(GaussOptions{.order = 5}, "integrator 'gauss' has no order 5");
  refuses(CompositionOptions{.order = 10}, "integrator 'composition' has no order 10");
  refuses(HamelOptions{.alpha = 1.5},
          "integrator 'hamel': alpha 1.5, expected a number from 0 to 1");
  refuses(VariationalOptions{.tolerance = std::nan("")},
          "integrator 'hamel-variational': tolerance nan");
  refuses(VariationalOptions{.max_halvings = 31},
          "max_halvings 31, expected a number from 0 to 30");
  refuses(LieExactOptions{.max_updates = -1}, "max_updates -1");
  refuses(Dop853Options{.rtol = -1.0}, "integrator 'dop853': rtol -1");
  refuses(NewmarkOptions{.newmark_beta = -1.0}, "newmark_beta -1");
  refuses(Rk4Options{.isa = Isa{9}}, "instruction set: this machine does not have");
}
