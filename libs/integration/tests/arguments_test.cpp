#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>
#include <type_traits>

#include "hamelin/core/error.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "hamelin/test/errors.hpp"
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
  for (const double x : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    nan[2] = x;
    CHECK_THROWS_WITH(integrator->kick(state, nan),
                      "kick: dp: a number is not finite, expected finite numbers");
    CHECK_THROWS_WITH(integrator->set_velocity(state, nan),
                      "set_velocity: v: a number is not finite, expected finite numbers");
  }
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
  // These would feed energy in.
  VectorXd negative = good;
  negative[3] = -1e-3;
  refuses("step: channels.damping: -0.001 given for a joint, expected numbers of at least 0",
          [&](Channels& c) { c.damping = negative; });
  refuses("step: channels.coulomb: -0.001 given for a joint, expected numbers of at least 0",
          [&](Channels& c) { c.coulomb = negative; });
  for (const double speed : {-0.01, 0.0, std::nan(""), HUGE_VAL})
    refuses("step: channels.coulomb_speed: ", [&](Channels& c) {
      c.coulomb = good;
      c.coulomb_speed = speed;
    });
  CHECK(test::same_state(state, before));
  Channels frictionless;
  frictionless.coulomb_speed = -1.0;  // of no dry friction
  frictionless.damping = VectorXd::Zero(n);
  CHECK(integrator->step(state, frictionless, 1e-4).converged);
}

namespace {

// f(name of the function, call of a new integrator with the state)
template <class F>
void each_call(const std::string& name, const Model& model, const State& state, F&& f) {
  const auto integrator = make_integrator(name, model);
  const VectorXd x = VectorXd::Constant(model.dof(), 0.1);
  VectorXd v(model.dof());
  State used = state;
  f("velocity", [&] { integrator->velocity(state, v); });
  f("energy", [&] { (void)integrator->energy(state); });
  f("energy", [&] { (void)integrator->energy(state, x); });
  f("kick", [&] { integrator->kick(used, x); });
  f("set_velocity", [&] { integrator->set_velocity(used, x); });
  f("step", [&] { (void)integrator->step(used, {}, 1e-4); });
  f("advance", [&] { (void)integrator->advance(used, {}, 1e-4); });
  if (name == "hamel-variational" || name.starts_with("gauss")) {
    const auto differentiator = make_step_differentiator(model, make_options(name));
    StepDerivatives out(model.dof());
    f("differentiate", [&] { differentiator->differentiate(state, {}, out); });
  }
  CHECK(test::same_state(used, state));
}

}  // namespace

TEST_CASE("a new integrator refuses the states of every other scheme", "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  const Model model(test::random_robot(4, n, 3));
  const VectorXd x = VectorXd::Constant(n, 0.1);
  for (const std::string& other : integrator_names()) {
    if (other == name) continue;
    CAPTURE(name, other);
    State state = make_integrator(other, model)->start(x, x);
    for (const bool fresh : {true, false}) {
      if (!fresh) REQUIRE(make_integrator(other, model)->step(state, {}, 1e-4).converged);
      each_call(name, model, state, [&](const std::string& function, auto&& call) {
        CAPTURE(function, fresh);
        CHECK_THROWS_WITH(call(), Contains(function + ": state: belongs to " + other) &&
                                      Contains(", expected a state of " + name));
      });
    }
  }
}

TEST_CASE("a state belongs to the options that give its numbers their meaning",
          "[integration][unit]") {
  const Model model(test::random_robot(4, n));
  const VectorXd x = VectorXd::Constant(n, 0.1);
  const auto accepts = [&](const Options& of_state, const Options& of_integrator) {
    State state = make_integrator(model, of_state)->start(x, x);
    const auto integrator = make_integrator(model, of_integrator);
    return test::error_of([&] { (void)integrator->step(state, {}, 1e-3); });
  };
  using Variational = VariationalOptions;
  CHECK(accepts(GaussOptions{.order = 4}, GaussOptions{.order = 8}) ==
        "step: state: belongs to gauss:4 (structure), expected a state of gauss:8 (structure)");
  CHECK(accepts(GaussOptions{}, GaussOptions{.tolerance = 1e-8}) ==
        "step: state: belongs to gauss:8 (structure), expected a state of gauss:8 (accurate)");
  CHECK(accepts(CompositionOptions{.order = 6}, CompositionOptions{}) ==
        "step: state: belongs to composition:6, expected a state of composition:4");
  CHECK(accepts(HamelOptions{.alpha = 0.25}, HamelOptions{}) ==
        "step: state: belongs to hamel (alpha 0.25), expected a state of hamel (alpha 0.5)");
  for (const auto& [of_state, of_integrator] : std::vector<std::pair<Options, Options>>{
           {GaussOptions{.tolerance = 1e-8}, GaussOptions{.rtol = 1e-6}},
           {GaussOptions{}, GaussOptions{.tolerance = 1e-13, .max_halvings = 2}},
           {Variational{}, Variational{.solver = Variational::Solver::feedback}},
           {Variational{}, Variational{.tolerance = 1e-6, .isa = Isa::baseline}},
           {LieExactOptions{}, LieExactOptions{.solver = LieExactOptions::Solver::riqn}},
           {HamelOptions{}, HamelOptions{.start = Start::published, .max_updates = 50}},
           {HamelOptions{.alpha = 0.0}, HamelOptions{.alpha = -0.0}},
           {NewmarkOptions{}, NewmarkOptions{.newmark_gamma = 0.6}},
           {Dop853Options{}, Dop853Options{.rtol = 1e-6}}})
    CHECK(accepts(of_state, of_integrator) == "no error");
}

TEST_CASE("a state belongs to all models of equal numbers", "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const model::Robot robot = test::random_robot(4, n, 3);
  const Model model(robot), equal(robot), copy(model);
  model::Robot loaded = robot;
  loaded.links.back().mass_kg += 0.1;
  const VectorXd x = VectorXd::Constant(n, 0.1);
  State state = make_integrator(name, model)->start(x, x);
  REQUIRE(make_integrator(name, model)->step(state, {}, 1e-3).converged);
  State ends[] = {state, state, state};
  const Model* const models[] = {&model, &equal, &copy};
  for (int k = 0; k < 3; ++k)
    REQUIRE(make_integrator(name, *models[k])->step(ends[k], {}, 1e-3).converged);
  CHECK(test::same_state(ends[1], ends[0]));
  CHECK(test::same_state(ends[2], ends[0]));
  for (const Model& other : {Model(loaded), Model(test::random_robot(5, n, 3)),
                             Model(robot, geometry::SE3{}, Eigen::Vector3d::Zero())})
    each_call(name, other, state, [&](const std::string& function, auto&& call) {
      CAPTURE(function);
      CHECK_THROWS_WITH(
          call(),
          Contains(function +
                   ": state: belongs to another model (of 5 joints), expected a state of this '"));
    });
}

TEST_CASE("a state that was moved from or resized is refused", "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::random_robot(4, n, 3));
  const VectorXd x = VectorXd::Constant(n, 0.1);
  const auto integrator = make_integrator(name, model);
  State moved = integrator->start(x, x);
  const State kept(std::move(moved));
  std::vector<State> bad(7, kept);
  bad[0] = moved;  // NOLINT(bugprone-use-after-move)
  bad[1].q.resize(n + 1);
  bad[2].v.setZero(n + 1);
  bad[3].p.setZero(n + 1);
  bad[4].memory.setZero(1);
  bad[5].force_previous.setZero(1);
  bad[6].history.assign(3, StepHistory(n));
  for (const State& state : bad)
    each_call(name, model, state, [&](const std::string& function, auto&& call) {
      if (function == "differentiate") return;  // not after a step
      CAPTURE(function);
      CHECK_THROWS_WITH(call(), Contains(function + ": state"));
    });
}

TEST_CASE("what is set or read may share memory with the state", "[integration][unit]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  model::Robot robot = test::random_robot(4, n, 3);
  for (auto& link : robot.links) link.joint.armature = 0.2;
  const Model model(robot);
  const auto integrator = make_integrator(name, model);
  const VectorXd q0 = VectorXd::Constant(n, 0.2), v0 = VectorXd::LinSpaced(n, -0.5, 0.7);
  State start = integrator->start(q0, v0);
  CHECK(test::same_state(integrator->start(q0, q0), integrator->start(q0, VectorXd(q0))));
  for (int k = 0; k < 3; ++k) REQUIRE(integrator->step(start, {}, 1e-3).converged);
  // every vector of dof numbers that a state has
  const auto parts = [](State& s) {
    std::vector<Eigen::Map<VectorXd>> all{VectorXd::Map(s.q.data(), n)};
    for (VectorXd* x : {&s.v, &s.p, &s.memory, &s.force_previous})
      for (Eigen::Index at = 0; at + n <= x->size(); at += n) all.emplace_back(x->data() + at, n);
    return all;
  };
  State sizes = start;
  for (std::size_t part = 0; part < parts(sizes).size(); ++part) {
    CAPTURE(part);
    const auto check = [&](auto&& call) {
      State shared = start, apart = start;
      const Eigen::Map<VectorXd> given = parts(shared)[part];
      const VectorXd copy = given;
      call(shared, given);
      call(apart, copy);
      CHECK(test::same_state(shared, apart));
    };
    check([&](State& s, const auto& x) { integrator->kick(s, x); });
    check([&](State& s, const auto& x) { integrator->set_velocity(s, x); });
    State shared = start;
    VectorXd apart(n);
    integrator->velocity(start, apart);
    Eigen::Map<VectorXd> out = parts(shared)[part];
    integrator->velocity(shared, out);
    CHECK(out == apart);
    State energies = start;
    CHECK(integrator->energy(energies, parts(energies)[part]).total() ==
          integrator->energy(energies, VectorXd(parts(energies)[part])).total());
  }
  for (std::size_t k = 0; k < start.history.size(); ++k) {
    State shared = start, apart = start;
    const VectorXd copy = apart.history[k].last();
    integrator->set_velocity(shared, shared.history[k].last());
    integrator->set_velocity(apart, copy);
    CHECK(test::same_state(shared, apart));
  }
}

TEST_CASE("a state of another robot is refused, a state of the same scheme is accepted",
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
                    Contains("step: state: belongs to another model (of 6 joints), expected"));
  CHECK_THROWS_WITH(integrator->energy(foreign),
                    Contains("energy: state: belongs to another model (of 6 joints), expected"));
  State bare;
  bare.q = zero;
  each_call(name, model, bare, [&](const std::string& function, auto&& call) {
    CAPTURE(function);
    CHECK_THROWS_WITH(call(), Contains(function +
                                       ": state: made by no integrator, expected "
                                       "a state from start() of " +
                                       name));
  });
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
  for (const double tiny : {1e-17, 1e-30, 1e-300}) {
    refuses(Dop853Options{.rtol = tiny}, "are below rounding, expected one of them to be at least");
    refuses(GaussOptions{.rtol = tiny, .atol = tiny}, "integrator 'gauss': rtol");
    refuses(RosenbrockOptions{.atol = tiny}, "integrator 'rosenbrock': rtol 0 and atol");
    CHECK_NOTHROW(make_integrator(model, Dop853Options{.rtol = 1e-6, .atol = tiny}));
  }
  refuses(NewmarkOptions{.newmark_beta = -1.0}, "newmark_beta -1");
  refuses(Rk4Options{.isa = Isa{9}}, "instruction set: this machine or this build does not have");
}
