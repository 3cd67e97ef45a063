// A plugin and a host that were built with headers of different versions work together.
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/test/robots.hpp"
#include "plugins/later_host.h"

using namespace hamelin;
using namespace hamelin::planning;

namespace {

std::string plugin_file(const std::string& name) {
  return HAMELIN_TEST_BINARY_DIR "/lib/hamelin/test_plugins/" + name + ".hamelin.so";
}

later_answer in_later_host(const std::string& plugin, const Json& params = Json::object()) {
  const model::Model arm(test::random_robot(7, 3));
  later_answer answer;
  later_host_tick(plugin_file(plugin).c_str(),
                  description::robot_to_json(arm.robot()).dump().c_str(), params.dump().c_str(),
                  &answer);
  return answer;
}

struct NearHost : HostServices {
  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             ArrayOut<hamelin_contact> out) override {
    for (std::size_t i = 0; i < std::min<std::size_t>(2, out.size()); ++i) {
      hamelin_contact contact{};
      contact.distance_m = 4.0 + static_cast<double>(i);
      out.set(i, contact);
    }
    return 2;
  }
};

}  // namespace

TEST_CASE("a plugin of version 4 works in a host of a later version", "[planning][plugin]") {
  const bool cpp = GENERATE(false, true);
  const later_answer answer =
      cpp ? in_later_host("awkward", {{"fault", "sum"}, {"gain", 2}, {"nested", {{"depth", 3}}}})
          : in_later_host("plain_c");
  CAPTURE(cpp);
  CHECK(std::string(answer.error).empty());
  CHECK(answer.held_torque[0] == 6.0);
  CHECK(answer.held_torque[1] == 9.0);
  CHECK(answer.held_torque[2] == 2.5);
  CHECK(answer.damping[2] == (cpp ? 2.0 : 1.0));
  CHECK(answer.gyroscopic_link == (cpp ? 2.0 : -1.0));
  CHECK(answer.overwritten == 0);
  if (cpp) return;
  CHECK(answer.series[0] == 7.0);
  CHECK(answer.series[1] == 0.0);
}

TEST_CASE("a plugin of a later version finds its own fields in its own host",
          "[planning][plugin]") {
  const later_answer answer = in_later_host("later");
  CHECK(std::string(answer.error).empty());
  CHECK(answer.held_torque[0] == 6.0);
  CHECK(answer.held_torque[1] == 9.0);
  CHECK(answer.series[1] == 1.0);
  CHECK(answer.overwritten == 0);
}

TEST_CASE("a plugin of a later version that still supports this one works here",
          "[planning][plugin]") {
  const Plugin plugin = Plugin::load(plugin_file("later"));
  CHECK(plugin.abi_version() == 4);
  NearHost services;
  const model::Model arm(test::random_robot(7, 3));
  SetupData data(arm);
  double expected = 0.0;
  for (const auto& shape : data.shapes) expected += shape.radius_m;
  hamelin_goal goal{};
  goal.type = HAMELIN_GOAL_POSITION;
  goal.tolerance_m = 0.25;
  data.add_goal(goal);
  data.add_goal(goal);
  auto planner = plugin.create(std::move(data), services, Json::object());
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  std::vector<hamelin_contact> contacts(3);
  for (std::size_t i = 0; i < contacts.size(); ++i)
    contacts[i].distance_m = 1.0 + static_cast<double>(i);
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.q = tick.v = zero.data();
  tick.contacts = contacts.data();
  tick.contact_count = contacts.size();
  tick.contact_stride = sizeof(hamelin_contact);
  tick.goal = &goal;
  CommandBuffers out(3, 4, planner.series().size());
  REQUIRE(planner.tick(tick, out));
  CHECK(out.held_torque()[0] == 6.0);
  CHECK(out.held_torque()[1] == 9.0);
  CHECK(out.held_torque()[2] == Approx(0.5 + expected));
  CHECK(out.series()[1] == 0.0);  // its own field is not there, and it noticed
}

TEST_CASE("arrays are read and written by their stride", "[planning][unit]") {
  struct Longer : hamelin_box {
    double more;
  };
  std::vector<Longer> longer(3);
  for (std::size_t i = 0; i < longer.size(); ++i) {
    longer[i].obstacle = static_cast<std::int32_t>(i);
    longer[i].more = 1.0;
  }
  const StridedArray<hamelin_box> view(longer.data(), longer.size(), sizeof(Longer));
  std::int32_t next = 0;
  for (const auto& box : view) CHECK(box.obstacle == next++);
  CHECK(next == 3);
  CHECK(view.has_field(offsetof(hamelin_box, quaternion_wxyz), sizeof(double[4])));
  CHECK_FALSE(view.has_field(sizeof(Longer), sizeof(double)));

  hamelin_box box{};
  box.obstacle = 9;
  const ArrayOut<hamelin_box> out(longer.data(), longer.size(), sizeof(Longer));
  out.set(1, box);
  CHECK(longer[1].obstacle == 9);
  CHECK(longer[1].more == 0.0);  // what the writer does not know is zero
  CHECK(longer[2].more == 1.0);

  std::vector<std::int32_t> shorter{1, 2, 3};  // structs that end after `obstacle`
  const ArrayOut<hamelin_box> narrow(reinterpret_cast<hamelin_box*>(shorter.data()), 3,
                                     sizeof(std::int32_t));
  narrow.set(1, box);
  CHECK(shorter == std::vector<std::int32_t>{1, 9, 3});
}

TEST_CASE("in hosts without a future of obstacles, all obstacles stand", "[planning][plugin]") {
  struct OldHost {
    static std::size_t closest_points(void*, const double*, double influence_m,
                                      hamelin_contact* out, std::size_t capacity, std::size_t) {
      if (capacity > 0) out[0].distance_m = influence_m;
      return 1;
    }
    static std::size_t obstacles(void*, hamelin_obstacle_state* out, std::size_t capacity,
                                 std::size_t) {
      if (capacity > 0) out[0].id = 7;
      return 1;
    }
    static std::size_t closest_ahead(void*, const double*, double, std::int32_t, double,
                                     hamelin_contact*, std::size_t, std::size_t) {
      return 100;
    }
    static std::size_t obstacles_ahead(void*, double, std::int32_t, hamelin_obstacle_state*,
                                       std::size_t, std::size_t) {
      return 200;
    }
  };
  hamelin_host raw{};
  raw.closest_points = &OldHost::closest_points;
  raw.obstacles = &OldHost::obstacles;
  // Must not be called: an old host ends before these fields.
  raw.closest_ahead = &OldHost::closest_ahead;
  raw.obstacles_ahead = &OldHost::obstacles_ahead;
  const Host host(raw);
  const std::vector<double> q(3, 0.0);
  std::vector<hamelin_contact> contacts(2);
  std::vector<hamelin_obstacle_state> states(2);

  raw.struct_size = offsetof(hamelin_host, closest_ahead);
  for (const std::int32_t kinds : {+HAMELIN_STANDING, HAMELIN_STANDING + HAMELIN_MOVING}) {
    CHECK(host.closest_ahead(q, 0.5, kinds, 0.3, contacts) == 1);
    CHECK(contacts[0].distance_m == 0.3);
    CHECK(host.obstacles_ahead(0.5, kinds, states) == 1);
    CHECK(states[0].id == 7);
  }
  for (const std::int32_t kinds : {0, +HAMELIN_MOVING}) {
    CHECK(host.closest_ahead(q, 0.5, kinds, 0.3, contacts) == 0);
    CHECK(host.obstacles_ahead(0.5, kinds, states) == 0);
  }
  // A host that has only the first of both functions.
  raw.struct_size = offsetof(hamelin_host, obstacles_ahead);
  CHECK(host.closest_ahead(q, 0.5, HAMELIN_MOVING, 0.3, contacts) == 100);
  CHECK(host.obstacles_ahead(0.5, HAMELIN_MOVING, states) == 0);
  raw.struct_size = sizeof raw;
  CHECK(host.obstacles_ahead(0.5, HAMELIN_MOVING, states) == 200);

  static int drawn = 0;
  raw.draw_path = [](void*, const double* points, std::size_t count) {
    drawn += static_cast<int>(count) + static_cast<int>(points[3]);
  };
  const std::vector<Eigen::Vector3d> line{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}};
  raw.struct_size = offsetof(hamelin_host, draw_path);
  host.draw_path(line);
  CHECK(drawn == 0);
  raw.struct_size = sizeof raw;
  host.draw_path(line);
  CHECK(drawn == 6);

  raw.request_path = [](void*) { return 1; };
  raw.struct_size = offsetof(hamelin_host, request_path);
  CHECK_FALSE(host.request_path());
  raw.struct_size = sizeof raw;
  CHECK(host.request_path());

  hamelin_tick tick{};
  tick.moving_count = 5;
  tick.struct_size = offsetof(hamelin_tick, moving_count);
  CHECK(Tick(tick, 3).moving_count() == 0);
  tick.struct_size = sizeof tick;
  CHECK(Tick(tick, 3).moving_count() == 5);

  CHECK_FALSE(Tick(tick, 3).disturbance());  // null
  CHECK(Tick(tick, 3).kept().slack.size() == 0);
  const std::array<double, 2> slack{0.1, -0.2};
  const std::array<double, 6> gradient{1, 2, 3, 4, 5, 6};
  tick.kept_count = 2;
  tick.kept_slack = slack.data();
  tick.kept_gradient = gradient.data();
  CHECK(Tick(tick, 3).kept().slack[1] == -0.2);
  CHECK(Tick(tick, 3).kept().gradient(0, 1) == 4.0);
  tick.struct_size = offsetof(hamelin_tick, kept_count);
  CHECK(Tick(tick, 3).kept().slack.size() == 0);
  const std::array<double, 3> disturbance{0.1, 0.2, 0.3};
  tick.disturbance = disturbance.data();
  tick.struct_size = offsetof(hamelin_tick, disturbance);
  CHECK_FALSE(Tick(tick, 3).disturbance());
  tick.struct_size = sizeof tick;
  REQUIRE(Tick(tick, 3).disturbance());
  CHECK((*Tick(tick, 3).disturbance())[2] == 0.3);
}

TEST_CASE("in services that do not move obstacles, none moves", "[planning][plugin]") {
  NearHost services;
  std::vector<hamelin_contact> contacts(2);
  std::vector<hamelin_obstacle_state> states(2);
  const std::vector<double> q(3, 0.0);
  HostServices& host = services;
  CHECK(host.closest_ahead(q, 0.5, HAMELIN_STANDING, 0.3, std::span(contacts)) == 2);
  CHECK(contacts[0].distance_m == 4.0);
  CHECK(host.closest_ahead(q, 0.5, HAMELIN_MOVING, 0.3, std::span(contacts)) == 0);
  CHECK(host.obstacles_ahead(0.5, HAMELIN_STANDING + HAMELIN_MOVING, std::span(states)) == 0);
}
