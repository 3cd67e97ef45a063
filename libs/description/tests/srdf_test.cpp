#include "hamelin/description/srdf.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
namespace fs = std::filesystem;

namespace {

const fs::path robots = fs::path(HAMELIN_SOURCE_DIR) / "data" / "robots";

}  // namespace

TEST_CASE("disabled pairs are read with their reasons and lines, other elements are skipped",
          "[description][unit]") {
  const test::TemporaryFolder folder;
  const auto file = folder.put("a.srdf", R"(<?xml version="1.0"?>
<!-- a comment -->
<robot name="r">
  <group name="g"><joint name="j"/></group>
  <disable_collisions link1="a" link2="b" reason="Adjacent"/>
  <disable_collisions link1="b" link2="c &amp; d"/>
  <virtual_joint name="v" type="fixed" parent_frame="w" child_link="a"/>
</robot>)");
  const auto pairs = description::read_srdf(file);
  REQUIRE(pairs.size() == 2);
  CHECK(pairs[0].link_a == "a");
  CHECK(pairs[0].link_b == "b");
  CHECK(pairs[0].reason == "Adjacent");
  CHECK(pairs[0].line == 5);
  CHECK(pairs[1].link_b == "c & d");
  CHECK(pairs[1].reason.empty());
}

TEST_CASE("a broken SRDF ends in one line with file, line and what was expected",
          "[description][unit]") {
  const test::TemporaryFolder folder;
  const auto of = [&](const std::string& text) {
    return test::error_of([&] { (void)description::read_srdf(folder.put("x.srdf", text)); });
  };
  CHECK_THAT(of(""), Catch::Contains("x.srdf") && Catch::Contains("empty"));
  CHECK_THAT(of("<robot>\n<disable_collisions link1=\"a\"/></robot>"),
             Catch::Contains("x.srdf: line 2") && Catch::Contains("no link2"));
  CHECK_THAT(of("<robot>\n\n<disable_collisions link1=\"a\" link2=\"a\"/></robot>"),
             Catch::Contains("line 3"));
  CHECK_THAT(of("<robot><disable_collisions</robot>"), Catch::Contains("not XML"));
  CHECK_THAT(of("<model/>"), Catch::Contains("expected <robot>"));
  CHECK_THAT(of("<robot>\n<link name=\"a\"/></robot>"),
             Catch::Contains("line 2") && Catch::Contains("URDF"));
  CHECK_THAT(of("<robot>\n<xacro:if/></robot>"),
             Catch::Contains("line 2") && Catch::Contains("xacro"));
  CHECK_THAT(of("<robot>\n<disable_default_collisions link=\"a\"/></robot>"),
             Catch::Contains("line 2"));
  std::string deep;
  for (int i = 0; i < 5000; ++i) deep += "<a>";
  CHECK_THAT(of(deep), Catch::Contains("nest"));
}

TEST_CASE("an SRDF's pairs are added to those of the sidecar, each once, with a note",
          "[description][unit]") {
  const test::TemporaryFolder folder;
  const auto srdf = folder.put(
      "x.srdf",
      "<robot name=\"arm7\"><disable_collisions link1=\"link2\" link2=\"link1\"/>"
      "<disable_collisions link1=\"link2\" link2=\"link3\" reason=\"Adjacent\"/></robot>");
  const auto spheres =
      folder.put("s.json", R"({"links": {"link1": [{"center": [0, 0, 0], "radius": 0.1}],
      "link2": [{"center": [0, 0, 0], "radius": 0.1}], "link3": [{"center": [0, 0, 0], "radius": 0.1}]},
      "self_collision_disabled": [["link1", "link2"]]})");
  const auto robot = description::read_robot(robots / "arm7.urdf", {{}, spheres, srdf});
  CHECK(robot.self_collision_disabled ==
        std::vector<std::pair<std::string, std::string>>{{"link1", "link2"}, {"link2", "link3"}});
  CHECK(std::any_of(robot.notes.begin(), robot.notes.end(), [](const std::string& note) {
    return note.find("x.srdf: 2 pairs") == 0 && note.find("1 of them new") != std::string::npos;
  }));
}

TEST_CASE("a link that is not in the URDF is an error with the nearest name",
          "[description][unit]") {
  const test::TemporaryFolder folder;
  const auto srdf = folder.put(
      "x.srdf", "<robot>\n<disable_collisions link1=\"link1\" link2=\"linc2\"/></robot>");
  const std::string message = test::error_of([&] {
    (void)description::read_robot(robots / "arm7.urdf", {{}, {}, srdf});
  });
  CHECK_THAT(message, Catch::Contains("x.srdf: line 2") && Catch::Contains("no link 'linc2'") &&
                          Catch::Contains("did you mean 'link2'"));
}

TEST_CASE("a JSON robot uses the pairs of links that it has and notes the others",
          "[description][unit]") {
  const test::TemporaryFolder folder;
  const auto urdf =
      description::read_robot(robots / "arm7.urdf", {{}, robots / "arm7.spheres.json"});
  const auto json = folder.put("r.json", description::robot_to_json(urdf).dump());
  const auto srdf = folder.put("x.srdf",
                               "<robot><disable_collisions link1=\"link1\" link2=\"link2\"/>"
                               "<disable_collisions link1=\"link1\" link2=\"gripper\"/></robot>");
  const auto robot = description::read_robot(json, {{}, {}, srdf});
  CHECK(robot.self_collision_disabled ==
        std::vector<std::pair<std::string, std::string>>{{"link1", "link2"}});
  CHECK(std::any_of(robot.notes.begin(), robot.notes.end(), [](const std::string& note) {
    return note.find("1 more name links") != std::string::npos;
  }));
}
