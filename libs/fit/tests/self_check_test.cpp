#include "hamelin/fit/self_check.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/model/make_chain.hpp"
#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;

namespace {

// Four links of 1 m along +y that turn about x, a ball at each link's far end.
model::Robot chain() {
  model::ChainOptions options;
  options.links = 4;
  options.axes = "x";
  options.length_m = 1.0;
  model::Robot robot = model::make_chain(options);
  for (auto& link : robot.links) {
    link.segments.clear();
    link.spheres = {{Eigen::Vector3d(0.0, 0.5, 0.0), 0.1}};
  }
  return robot;
}

const PartPair& pair_of(const SelfCheck& check, const std::string& a, const std::string& b) {
  const auto at = std::find_if(check.pairs.begin(), check.pairs.end(),
                               [&](const PartPair& p) { return p.part_a == a && p.part_b == b; });
  REQUIRE(at != check.pairs.end());
  return *at;
}

}  // namespace

TEST_CASE("distances at rest are those of a stretched chain", "[fit][unit]") {
  const model::Robot robot = chain();
  const SelfCheck check = check_self(robot, {}, {0, 1});
  REQUIRE(check.pairs.size() == 6);
  CHECK(check.rest_q == std::vector<double>{0.0, 0.0, 0.0, 0.0});
  CHECK(pair_of(check, "link1", "link2").rest_m == Approx(0.8));
  CHECK(pair_of(check, "link1", "link4").rest_m == Approx(2.8));
  // without a list, neighbours are left out
  CHECK_FALSE(pair_of(check, "link1", "link2").checked);
  CHECK(pair_of(check, "link1", "link3").checked);
  CHECK(check.contacts_at_rest().empty());
}

TEST_CASE("a rest pose follows the limits, and its distances the product of exponentials",
          "[fit][unit]") {
  model::Robot robot = chain();
  // the second and third joint at a right angle: the square nearly closes, link 4's end comes 1 m
  // beside link 1's
  for (const std::size_t i : {1U, 2U}) {
    robot.links[i].joint.lower = 0.5 * M_PI - 0.1;
    robot.links[i].joint.upper = 0.5 * M_PI + 0.1;
  }
  const SelfCheck check = check_self(robot, {}, {0, 1});
  CHECK(check.rest_q[1] == Approx(0.5 * M_PI));
  CHECK(pair_of(check, "link1", "link3").rest_m == Approx(std::sqrt(2.0) - 0.2));
  CHECK(pair_of(check, "link1", "link4").rest_m == Approx(std::sqrt(5.0) - 0.2));
  CHECK(std::count_if(check.suspicious_limits.begin(), check.suspicious_limits.end(),
                      [](const std::string& line) {
                        return line.find("0 is outside") != std::string::npos;
                      }) == 2);
}

TEST_CASE("pairs are in contact always, sometimes or never", "[fit][unit]") {
  model::Robot robot = chain();
  robot.links[1].spheres[0].radius_m = 0.95;  // reaches link 1's ball at every joint angle
  for (auto& link : robot.links) {
    link.joint.lower = -0.1;
    link.joint.upper = 0.1;
  }
  robot.links[3].joint.lower = -3.1;
  robot.links[3].joint.upper = 3.1;
  const SelfCheck check = check_self(robot, {}, {2000, 5});
  CHECK(pair_of(check, "link1", "link2").contacts == 2000);
  CHECK(pair_of(check, "link1", "link3").contacts == 0);
  const PartPair& some = pair_of(check, "link2", "link4");
  CHECK(some.contacts > 0);
  CHECK(some.contacts < 2000);
  CHECK(some.least_m < 0.0);
  const auto listed = check.disabled(false);
  REQUIRE(listed.size() == 3);  // the neighbours
  for (const auto& pair : listed) CHECK(pair.reason == "Adjacent");
  const auto with_never = check.disabled(true);
  CHECK(std::count_if(with_never.begin(), with_never.end(),
                      [](const description::DisabledPair& p) { return p.reason == "Never"; }) >= 1);
}

TEST_CASE("links around a link without shapes are neighbours, but are checked if no pair is listed",
          "[fit][unit]") {
  model::Robot robot = chain();
  robot.links[1].spheres.clear();
  robot.links[2].spheres[0].radius_m = 1.95;  // reaches link 1's ball at rest
  const SelfCheck check = check_self(robot, {}, {100, 1});
  const PartPair& pair = pair_of(check, "link1", "link3");
  CHECK(pair.neighbours);
  CHECK(pair.checked);
  CHECK_FALSE(pair_of(check, "link1", "link4").neighbours);
  REQUIRE(check.contacts_at_rest().size() == 1);
  const auto listed = check.disabled(false);
  CHECK(std::any_of(listed.begin(), listed.end(), [](const description::DisabledPair& p) {
    return p.link_a == "link1" && p.link_b == "link3" && p.reason == "Adjacent";
  }));
}

TEST_CASE("a pair in contact in 95 of 100 samples counts as always, in 94 not", "[fit][unit]") {
  PartPair pair;
  pair.rest_m = 0.1;
  pair.contacts = 95;
  CHECK(contact_reason(pair, 100) == "Always");
  pair.contacts = 94;
  CHECK(contact_reason(pair, 100).empty());
  pair.rest_m = 0.0;
  CHECK(contact_reason(pair, 100) == "Default");
  pair.contacts = 0;
  CHECK(contact_reason(pair, 0) == "Default");
}

TEST_CASE("a checked pair that touches at rest is reported; a listed one is not", "[fit][unit]") {
  model::Robot robot = chain();
  robot.links[0].spheres[0].radius_m = 1.95;
  const SelfCheck check = check_self(robot, {}, {100, 1});
  const auto contacts_at_rest = check.contacts_at_rest();
  REQUIRE(contacts_at_rest.size() == 1);
  CHECK(contacts_at_rest[0].part_b == "link3");
  CHECK(contacts_at_rest[0].rest_m == Approx(-0.05));
  robot.self_collision_disabled = {{"link3", "link1"}};
  const SelfCheck listed = check_self(robot, {{"link1", "link3", "because", 7}}, {100, 1});
  CHECK(pair_of(listed, "link1", "link3").reason == "because");
  // now that there is a list, neighbours count
  REQUIRE(listed.contacts_at_rest().size() == 1);
  CHECK(listed.contacts_at_rest()[0].part_b == "link2");
}

TEST_CASE("capsules are measured by their segments", "[fit][unit]") {
  model::Robot robot = chain();
  for (auto& link : robot.links) {
    link.spheres.clear();
    link.segments = {{Eigen::Vector3d(0.0, -0.3, 0.0), Eigen::Vector3d(0.0, 0.3, 0.0), 0.05}};
  }
  robot.links[1].joint.lower = 0.5 * M_PI;
  robot.links[1].joint.upper = 0.5 * M_PI + 0.2;
  const SelfCheck check = check_self(robot, {}, {0, 1});
  // at π/2 + 0.1: link 1 from 0.2 to 0.8 along y, link 2 begins 0.2 from its joint at y = 1
  const double a = 0.5 * M_PI + 0.1;
  CHECK(pair_of(check, "link1", "link2").rest_m ==
        Approx(std::hypot(0.2 + 0.2 * std::cos(a), 0.2 * std::sin(a)) - 0.1));
}

TEST_CASE("an SRDF written reads back", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const std::vector<description::DisabledPair> pairs = {{"a<b", "c&d", "Adjacent", 0},
                                                        {"e", "f\"g", "Never", 0}};
  const auto read = description::read_srdf(scratch.put("x.srdf", srdf_text("r", pairs)));
  REQUIRE(read.size() == 2);
  CHECK(read[0].link_a == "a<b");
  CHECK(read[0].link_b == "c&d");
  CHECK(read[1].link_b == "f\"g");
  CHECK(read[1].reason == "Never");
}
