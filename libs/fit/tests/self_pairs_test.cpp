#include "hamelin/fit/self_pairs.hpp"

#include <catch2/catch.hpp>
#include <string>

#include "hamelin/core/error.hpp"
#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;

namespace {

const char* const row_inertial =
    "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" "
    "izz=\"1\"/></inertial>";

std::string row_link(const std::string& name) {
  return "<link name=\"" + name + "\">" + row_inertial + "</link>\n";
}

// Each joint turns about x, 1 m along y from the one before.
std::string row_joint(const std::string& parent, const std::string& child,
                      const std::string& type = "revolute") {
  return "<joint name=\"to_" + child + "\" type=\"" + type +
         "\"><origin xyz=\"0 1 0\"/><parent link=\"" + parent + "\"/><child link=\"" + child +
         "\"/><axis xyz=\"1 0 0\"/><limit lower=\"-2\" upper=\"2\" effort=\"1\" "
         "velocity=\"1\"/></joint>\n";
}

// base, a, b, c, d in a row, each by a joint; a fork after d: left and right.
std::string row_arm(const std::string& more = "") {
  std::string text = "<robot name=\"r\">";
  for (const char* name : {"base", "a", "b", "c", "d", "left", "right"}) text += row_link(name);
  return text + row_joint("base", "a") + row_joint("a", "b") + row_joint("b", "c") +
         row_joint("c", "d") + row_joint("d", "left") + row_joint("d", "right") + more + "</robot>";
}

Json row_ball(double y, double radius) {
  return {{{"center", {0, y, 0}}, {"radius", radius}}};
}

std::string reason_of(const SelfPairs& self, const std::string& a, const std::string& b) {
  for (const auto& pair : self.pairs)
    if (pair.link_a == a && pair.link_b == b) return pair.reason;
  return "none";
}

}  // namespace

TEST_CASE(
    "links with shapes are adjacent across links without shapes, and distant ones are not listed",
    "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf = scratch.put("r.urdf", row_arm());
  // no pair ever touches; a and d have no shapes
  const Json sidecar = {
      {"links",
       {{"base", row_ball(0, 0.1)},
        {"b", row_ball(0, 0.1)},
        {"c", row_ball(0, 0.1)},
        {"a", Json::array()}}},
      {"capsules",
       {{"left", {{{"from", {0, 0, 0}}, {"to", {0, 0.2, 0}}, {"radius", 0.1}}}},
        {"right", {{{"from", {0.3, 0, 0}}, {"to", {0.3, 0.2, 0}}, {"radius", 0.1}}}}}}};
  const SelfPairs self = pairs_to_disable(urdf, sidecar, std::nullopt, {200, 1});
  CHECK(self.notes.empty());
  CHECK(self.pairs.size() == 5);
  CHECK(reason_of(self, "base", "b") == "Adjacent");
  CHECK(reason_of(self, "b", "c") == "Adjacent");
  CHECK(reason_of(self, "c", "left") == "Adjacent");
  CHECK(reason_of(self, "c", "right") == "Adjacent");
  CHECK(reason_of(self, "left", "right") == "Adjacent");  // d between them has none
}

TEST_CASE("pairs that touch always or at rest are listed, pairs that touch sometimes are not",
          "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf = scratch.put("r.urdf", row_arm());
  const auto with = [&](const Json& of_a, const Json& of_c, const std::optional<std::string>& tip) {
    const Json sidecar = {{"links", {{"a", of_a}, {"b", row_ball(0.5, 0.1)}, {"c", of_c}}}};
    return reason_of(pairs_to_disable(urdf, sidecar, tip, {2000, 1}), "a", "c");
  };
  // the centres are both 1 m from b's joint, so 2 cos(q/2) apart, with q in [-2, 2]
  CHECK(with(row_ball(0, 1.1), row_ball(0, 1.0), "left") == "Always");
  CHECK(with(row_ball(0, 1.1), row_ball(0, 0.3), "left") == "none");
  CHECK(with(row_ball(0, 1.1), row_ball(0, 0.3), std::nullopt) == "none");
  // a ball that touches c at rest only
  CHECK(with(row_ball(2, 0.1), row_ball(0, 0.1), "left") == "Default");
  CHECK(with(row_ball(2, 0.1), row_ball(0, 0.1), std::nullopt) == "Default");
}

TEST_CASE("chains to leaves that cannot be read are noted, and refused for an explicit tip",
          "[fit][unit]") {
  const test::TemporaryFolder scratch;
  std::string text = row_arm();
  const std::string mimicking = "<child link=\"right\"/>";
  text.replace(text.find(mimicking), mimicking.size(), mimicking + "<mimic joint=\"to_left\"/>");
  const auto urdf = scratch.put("r.urdf", text);
  const Json sidecar = {{"links", {{"a", row_ball(0, 0.1)}, {"b", row_ball(0, 0.1)}}}};
  const SelfPairs self = pairs_to_disable(urdf, sidecar, std::nullopt, {10, 1});
  CHECK(reason_of(self, "a", "b") == "Adjacent");
  REQUIRE(self.notes.size() == 1);
  CHECK_THAT(self.notes[0],
             Catch::Contains("in the chain to 'right'") && Catch::Contains("mimics 'to_left'"));
  CHECK_THROWS_WITH(pairs_to_disable(urdf, sidecar, "right", {10, 1}),
                    Catch::Contains("mimics 'to_left'"));
}
