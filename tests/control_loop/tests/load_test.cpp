// What is attached to an arm while it is controlled.
#include <atomic>
#include <catch2/catch.hpp>
#include <limits>
#include <thread>

#include "../loop.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::VectorXd;
using test::Loop;
using test::refusal;
using test::sampled;
using test::with_room;

namespace {

scene::Payload box_of(double mass_kg) {
  scene::Payload box;
  box.name = "box";
  box.mass_kg = mass_kg;
  box.position_m = {0.0, 0.0, 0.1};
  box.inertia_kg_m2 = 0.001 * mass_kg * Eigen::Matrix3d::Identity();
  box.spheres = {{{0.0, 0.0, 0.1}, 0.05}};
  return box;
}

}  // namespace

TEST_CASE("a controller holds what is attached to its arm", "[control][load]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene, with_room());
  const auto move = [&](int ticks) {
    for (int k = 0; k < ticks; ++k) loop.step(VectorXd(loop.tick().torque));
  };
  move(20);
  const VectorXd holding = loop.controller.answer().torque;
  const scene::Payload box = box_of(2.0);
  const std::uint64_t number = loop.controller.attach(box, loop.state.q);
  CHECK(loop.controller.answer().load != number);
  // the arm itself gets the body at the same time
  const VectorXd q = loop.state.q, v = loop.v;
  loop.arm = scene::carrying(loop.arm, {&box, 1}, false, 0.0, q);
  loop.integrator = integration::make_integrator("hamel-variational", loop.arm);
  const long k = loop.state.k;
  loop.state = loop.integrator->start(q, v);
  loop.state.k = k;
  loop.state.time_s = 0.001 * static_cast<double>(k);
  move(1);
  CHECK(loop.controller.answer().load == number);
  CHECK(loop.controller.attached() == std::vector<std::string>{"box"});
  CHECK(loop.controller.model().shapes().size() == control::load_model(scene).shapes().size() + 1);
  double fastest = 0.0;
  control::ControlState state = control::ControlState::running;
  for (int i = 0; i < 20000 && state == control::ControlState::running; ++i) {
    const control::Answer& answer = loop.tick();
    state = answer.state;
    fastest = std::max(fastest, loop.controller.view().clearance_m() <= 0.0 ? 1.0 : 0.0);
    loop.step(VectorXd(answer.torque));
  }
  CHECK(state == control::ControlState::reached);
  CHECK(fastest == 0.0);
  CHECK((loop.controller.answer().torque - holding).lpNorm<Eigen::Infinity>() > 1.0);
}

TEST_CASE("what cannot be attached is refused by attach() or by the tick, and nothing changes",
          "[control][load]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene, with_room());
  const VectorXd q = scene.start_q;
  control::Controller& controller = loop.controller;
  scene::Payload box = box_of(1.0);
  CHECK(refusal([&] { controller.detach("box", q); }) ==
        "payload 'box': is not attached, expected one of the 0 that are");
  CHECK_THAT(refusal([&] { controller.attach(box, q.head(3)); }), Contains("3 values given"));
  box.mass_kg = std::numeric_limits<double>::infinity();
  CHECK_THAT(refusal([&] { controller.attach(box, q); }), Contains("its mass is inf kg"));
  box = box_of(1.0);
  box.spheres[0].center_m.z() = 5.0;
  CHECK_THAT(refusal([&] { controller.attach(box, q); }), Contains("payload_reach_m"));
  box.spheres.assign(9, {{0.0, 0.0, 0.1}, 0.02});
  CHECK_THAT(refusal([&] { controller.attach(box, q); }), Contains("payload_shapes_max"));
  box = box_of(1.0);
  box.name = "link2";
  CHECK_THAT(refusal([&] { controller.attach(box, q); }), Contains("expected another name"));
  CHECK(controller.attached().empty());

  loop.step(VectorXd(loop.tick().torque));
  // in the way of an obstacle at once
  box = box_of(1.0);
  scene::Obstacle post;
  post.name = "post";
  post.radius_m = 0.02;
  post.pose = {Eigen::Matrix3d::Identity(),
               dynamics::tip_pose(controller.model(), controller.view().poses()) *
                   Eigen::Vector3d(0.0, 0.0, 0.14)};
  controller.world().set_obstacle(post);
  const std::uint64_t refused = controller.attach(box, loop.state.q);
  loop.step(VectorXd(loop.tick().torque));
  CHECK(controller.answer().load == 0);
  CHECK(controller.answer().refused_load == refused);
  CHECK_THAT(std::string(controller.answer().load_refusal), Contains("sphere 5 of part 'box'"));
  CHECK(controller.attached().empty());
  controller.world().remove_obstacle("post");
  const std::uint64_t number = controller.attach(box, loop.state.q);
  CHECK_THAT(refusal([&] { controller.attach(box, q); }),
             Contains("payload 'box': is attached already"));
  loop.step(VectorXd(loop.tick().torque));
  CHECK(controller.answer().load == number);
  // too heavy for a stop within the torque limits
  scene::Payload anvil = box_of(30.0);
  anvil.name = "anvil";
  const std::uint64_t heavy = controller.attach(anvil, loop.state.q);
  loop.step(VectorXd(loop.tick().torque));
  CHECK(controller.answer().refused_load == heavy);
  CHECK_THAT(std::string(controller.answer().load_refusal), Contains("torque limits"));
  CHECK(controller.attached() == std::vector<std::string>{"box"});
  controller.detach("box", loop.state.q);
  loop.step(VectorXd(loop.tick().torque));
  CHECK(controller.attached().empty());
  CHECK(controller.model().shapes().size() == loop.arm.shapes().size());
}

TEST_CASE("parts that the payload touches when it is attached may go on to touch it",
          "[control][load]") {
  const scene::Scene scene = scene::read_scene(test::data_folder / "scenes" / "clutter.json");
  const model::Model bare = control::load_model(scene);
  scene::Payload long_box = box_of(1.0);
  long_box.spheres = {{{0.0, 0.0, -0.12}, 0.08}};  // back into the wrist
  const auto pairs_of_box = [&](double touching_m) {
    const model::Model loaded =
        scene::carrying(bare, {&long_box, 1}, true, touching_m, scene.start_q);
    const scene::SelfField field(loaded);
    std::vector<std::string> out;
    for (std::size_t i = 0; i < field.pairs().size(); ++i)
      if (field.describe(static_cast<int>(i)).find("'box'") != std::string::npos)
        out.push_back(field.describe(static_cast<int>(i)));
    return out;
  };
  const auto listed = [](const std::vector<std::string>& all, const std::string& pair) {
    return std::find(all.begin(), all.end(), pair) != all.end();
  };
  CHECK_FALSE(listed(pairs_of_box(0.0), "'link6' and 'box'"));
  CHECK_FALSE(listed(pairs_of_box(0.0), "'link5' and 'box'"));
  CHECK(listed(pairs_of_box(0.0), "'link2' and 'box'"));
  // the robot's own pairs stay what they were
  const scene::SelfField before(bare),
      after(scene::carrying(bare, {&long_box, 1}, true, 0.0, scene.start_q));
  std::size_t own = 0;
  for (std::size_t i = 0; i < after.pairs().size(); ++i)
    if (after.describe(static_cast<int>(i)).find("'box'") == std::string::npos) ++own;
  CHECK(own == before.pairs().size());
}

TEST_CASE("a tick that takes over another load does not allocate", "[control][load]") {
  test::require_allocation_count();
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene, with_room());
  for (int k = 0; k < 10; ++k) loop.step(VectorXd(loop.tick().torque));
  const std::uint64_t number = loop.controller.attach(box_of(0.5), loop.state.q);
  const long allocated = test::allocations_in([&] { (void)loop.tick(); });
  CHECK(loop.controller.answer().load == number);
  CHECK(allocated == 0);
}

TEST_CASE("loads change on another thread while the arm is controlled", "[control][load]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene, with_room());
  std::atomic<bool> done{false};
  std::thread writer([&] {
    const VectorXd q = scene.start_q;
    for (int i = 0; i < 20; ++i) {
      // a tick may refuse it, depending on where the arm is by then
      if (loop.controller.attached().empty())
        loop.controller.attach(box_of(0.2), q);
      else
        loop.controller.detach("box", q);
      loop.controller.set_planner_params(Json::object());
    }
    done = true;
  });
  std::uint64_t newest = 0;
  bool finite = true;
  for (int k = 0; k < 20000 && (!done || k < 50); ++k) {
    const control::Answer& answer = loop.tick();
    finite = finite && answer.torque.allFinite();
    CHECK(std::max(answer.load, answer.refused_load) >= newest);
    newest = std::max({newest, answer.load, answer.refused_load});
  }
  writer.join();
  (void)loop.tick();
  CHECK(finite);
  CHECK(std::max(loop.controller.answer().load, loop.controller.answer().refused_load) == 20);
}
