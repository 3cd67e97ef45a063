#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::description;
using namespace hamelin::model;
using Eigen::Matrix3d;
using Eigen::Vector3d;
namespace fs = std::filesystem;

namespace {

const fs::path data = fs::path(HAMELIN_SOURCE_DIR) / "data" / "robots";

/// A file that lives as long as the value.
class Scratch {
 public:
  Scratch(const std::string& name, const std::string& text) : file_(folder_.put(name, text)) {}
  const fs::path& file() const { return file_; }

 private:
  test::TemporaryFolder folder_;
  fs::path file_;
};

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  if (at == std::string::npos) throw std::logic_error("nothing to replace: " + what);
  return text.replace(at, what.size(), by);
}

std::string repeated(const std::string& what, int times) {
  std::string text;
  for (int i = 0; i < times; ++i) text += what;
  return text;
}

std::string message_of(const std::string& name, const std::string& text,
                       const RobotOptions& options = {}) {
  const Scratch scratch(name, text);
  try {
    (void)read_robot(scratch.file(), options);
  } catch (const Error& e) {
    std::string what = e.what();
    // The message begins with the file's name.
    REQUIRE(what.rfind(scratch.file().string() + ":", 0) == 0);
    return what.substr(scratch.file().string().size());
  }
  return "no error";
}

Robot read_text(const std::string& name, const std::string& text,
                const RobotOptions& options = {}) {
  const Scratch scratch(name, text);
  return read_robot(scratch.file(), options);
}

bool any_has(const std::vector<std::string>& lines, const std::string& text) {
  return std::any_of(lines.begin(), lines.end(),
                     [&](const std::string& line) { return line.find(text) != std::string::npos; });
}

bool noted(const Robot& robot, const std::string& text) {
  return any_has(robot.notes, text);
}

const std::string inertial = R"(<inertial><origin xyz="0 0 0.1"/><mass value="2"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>)";

/// Two joints, a fixed tip.
const std::string arm = R"(<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper">)" +
                        inertial + R"(
  </link>
  <link name="lower">)" +
                        inertial + R"(
    <collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="50" velocity="3"/><dynamics damping="0.5" friction="0.1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.2" effort="20" velocity="1"/>
  </joint>
  <joint name="mount" type="fixed">
    <parent link="lower"/><child link="tool"/><origin xyz="0 0 0.25" rpy="0 0 1"/>
  </joint>
</robot>
)";

void check_same(const Robot& a, const Robot& b) {
  REQUIRE(a.dof() == b.dof());
  CHECK(a.name == b.name);
  CHECK(a.notes == b.notes);
  CHECK(a.warnings == b.warnings);
  CHECK(a.self_collision_disabled == b.self_collision_disabled);
  const auto check_spheres = [](const std::vector<Sphere>& x, const std::vector<Sphere>& y) {
    REQUIRE(x.size() == y.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      CHECK(x[i].center_m == y[i].center_m);
      CHECK(x[i].radius_m == y[i].radius_m);
      CHECK(x[i].part == y[i].part);
    }
  };
  const auto check_segments = [](const std::vector<Segment>& x, const std::vector<Segment>& y) {
    REQUIRE(x.size() == y.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      CHECK(x[i].from_m == y[i].from_m);
      CHECK(x[i].to_m == y[i].to_m);
      CHECK(x[i].radius_m == y[i].radius_m);
      CHECK(x[i].part == y[i].part);
    }
  };
  check_segments(a.base_segments, b.base_segments);
  check_spheres(a.base_spheres, b.base_spheres);
  for (std::size_t i = 0; i < a.links.size(); ++i)
    check_spheres(a.links[i].spheres, b.links[i].spheres);
  CHECK(a.tip.name == b.tip.name);
  CHECK(a.tip.link == b.tip.link);
  CHECK(a.tip.pose == b.tip.pose);
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    const Link &x = a.links[i], &y = b.links[i];
    CHECK(x.name == y.name);
    CHECK(x.parent == y.parent);
    CHECK(x.joint.name == y.joint.name);
    CHECK(x.joint.type == y.joint.type);
    CHECK(x.joint.screw == y.joint.screw);
    CHECK(x.joint.lower == y.joint.lower);
    CHECK(x.joint.upper == y.joint.upper);
    CHECK(x.joint.velocity_max == y.joint.velocity_max);
    CHECK(x.joint.effort_max == y.joint.effort_max);
    CHECK(x.joint.damping == y.joint.damping);
    CHECK(x.joint.friction == y.joint.friction);
    CHECK(x.joint.armature == y.joint.armature);
    CHECK(x.com == y.com);
    CHECK(x.mass_kg == y.mass_kg);
    CHECK(x.inertia_kg_m2 == y.inertia_kg_m2);
    REQUIRE(x.spheres.size() == y.spheres.size());
    for (std::size_t k = 0; k < x.spheres.size(); ++k) {
      CHECK(x.spheres[k].center_m == y.spheres[k].center_m);
      CHECK(x.spheres[k].radius_m == y.spheres[k].radius_m);
    }
    check_segments(x.segments, y.segments);
  }
}

}  // namespace

TEST_CASE("a URDF's joints, limits, spheres and tip come out in the base frame at q = 0",
          "[description][robot]") {
  const Robot robot = read_text("arm.urdf", arm);
  REQUIRE(robot.dof() == 2);
  CHECK(robot.name == "arm");
  // v = −ω × (0, 0, 0.3)
  CHECK(robot.links[0].joint.screw == (Vector6d() << 0, 1, 0, -0.3, 0, 0).finished());
  CHECK(robot.links[1].joint.type == JointType::prismatic);
  CHECK(robot.links[1].joint.screw == (Vector6d() << 0, 0, 0, 0, 0, 1).finished());
  CHECK(robot.links[0].joint.lower == -1.0);
  CHECK(robot.links[0].joint.upper == 2.0);
  CHECK(robot.links[0].joint.effort_max == 50.0);
  CHECK(robot.links[0].joint.velocity_max == 3.0);
  CHECK(robot.links[0].joint.damping == 0.5);
  CHECK(robot.links[0].joint.friction == 0.1);
  CHECK(robot.links[1].joint.friction == 0.0);
  CHECK(robot.links[0].joint.armature == 0.0);  // URDF has none
  CHECK((robot.links[1].com.p() - Vector3d(0, 0, 0.8)).norm() < 1e-15);
  REQUIRE(robot.links[1].spheres.size() == 1);
  CHECK(robot.links[1].spheres[0].center_m.norm() < 1e-15);  // at the COM
  CHECK(robot.tip.name == "tool");
  CHECK(robot.tip.link == 1);
  CHECK((robot.tip.pose.p() - Vector3d(0, 0, 0.95)).norm() < 1e-15);
  CHECK(robot.tip.pose.R()(1, 0) == Approx(std::sin(1.0)));
  CHECK(noted(robot, "lumped into link 'lower': tool"));
  CHECK(noted(robot, "base: base (does not move"));
}

TEST_CASE("the inertial frame's rotation is honoured", "[description][robot]") {
  const Robot robot =
      read_text("arm.urdf", replaced(arm, R"(<origin xyz="0 0 0.1"/><mass)",
                                     R"(<origin xyz="0 0 0.1" rpy="0 0 0.5"/><mass)"));
  const Matrix3d& R = robot.links[0].com.R();
  CHECK(R(0, 0) == Approx(std::cos(0.5)));
  CHECK(R(1, 0) == Approx(std::sin(0.5)));
  CHECK(robot.links[0].inertia_kg_m2 == Matrix3d(Vector3d(0.02, 0.02, 0.01).asDiagonal()));
}

TEST_CASE("lumping keeps mass, COM, inertia and spheres, compared with a cloud of points",
          "[description][robot]") {
  // Two bodies of point masses; the second is attached to the first by a fixed joint and a locked
  // one. The reference sums the points, the reader has only each body's mass, COM and inertia.
  Rng rng(7);
  const auto cloud = [&] {
    std::vector<std::pair<double, Vector3d>> points;
    for (int i = 0; i < 5; ++i)
      points.emplace_back(
          rng.uniform(0.1, 1.0),
          Vector3d(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2)));
    return points;
  };
  struct Sum {
    double mass = 0.0;
    Vector3d center = Vector3d::Zero();
    Matrix3d inertia = Matrix3d::Zero();
  };
  const auto sum_of = [](const std::vector<std::pair<double, Vector3d>>& points) {
    Sum sum;
    for (const auto& point : points) {
      sum.mass += point.first;
      sum.center += point.first * point.second;
    }
    sum.center /= sum.mass;
    for (const auto& point : points) {
      const Vector3d r = point.second - sum.center;
      sum.inertia += point.first * (r.dot(r) * Matrix3d::Identity() - r * r.transpose());
    }
    return sum;
  };
  const auto first = cloud(), second = cloud();
  const auto text_of = [&](const std::vector<std::pair<double, Vector3d>>& points) {
    const Sum s = sum_of(points);
    const auto number = [](double x) { return Json(x).dump(); };
    const Matrix3d& I = s.inertia;
    return "<inertial><origin xyz=\"" + number(s.center.x()) + " " + number(s.center.y()) + " " +
           number(s.center.z()) + "\"/><mass value=\"" + number(s.mass) + "\"/><inertia ixx=\"" +
           number(I(0, 0)) + "\" ixy=\"" + number(I(0, 1)) + "\" ixz=\"" + number(I(0, 2)) +
           "\" iyy=\"" + number(I(1, 1)) + "\" iyz=\"" + number(I(1, 2)) + "\" izz=\"" +
           number(I(2, 2)) + "\"/></inertial>";
  };
  const std::string text = R"(<robot name="lump"><link name="base"/><link name="arm">)" +
                           text_of(first) + R"(</link>
    <link name="plate"/><link name="hand">)" +
                           text_of(second) + R"(<collision><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/>
    <geometry><sphere radius="0.01"/></geometry></collision></link><link name="tip"/>
    <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 1" rpy="0 0 0.3"/><axis xyz="0 1 0"/></joint>
    <joint name="glue" type="fixed"><parent link="arm"/><child link="plate"/><origin xyz="0.1 0 0" rpy="0.4 0 0"/></joint>
    <joint name="finger" type="prismatic"><parent link="plate"/><child link="hand"/><origin xyz="0 0.2 0" rpy="0 -0.7 0"/>
      <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
    <joint name="end" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="0 0 1"/></joint></robot>)";
  RobotOptions options;
  options.tip = "tip";
  const Robot robot = read_text("lump.urdf", text, options);
  REQUIRE(robot.dof() == 1);
  const Link& link = robot.links[0];

  // Positions of the two bodies in the base frame, from elementary rotations.
  const Matrix3d R_arm = Eigen::AngleAxisd(0.3, Vector3d::UnitZ()).toRotationMatrix();
  const Matrix3d R_plate = R_arm * Eigen::AngleAxisd(0.4, Vector3d::UnitX()).toRotationMatrix();
  const Matrix3d R_hand = R_plate * Eigen::AngleAxisd(-0.7, Vector3d::UnitY()).toRotationMatrix();
  const Vector3d p_arm(0, 0, 1), p_plate = p_arm + R_arm * Vector3d(0.1, 0, 0),
                                 p_hand = p_plate + R_plate * Vector3d(0, 0.2, 0);
  std::vector<std::pair<double, Vector3d>> all;
  for (const auto& point : first) all.emplace_back(point.first, p_arm + R_arm * point.second);
  for (const auto& point : second) all.emplace_back(point.first, p_hand + R_hand * point.second);
  const Sum expected = sum_of(all);
  CHECK(link.mass_kg == Approx(expected.mass).epsilon(1e-14));
  CHECK((link.com.p() - expected.center).norm() < 1e-14);
  CHECK((link.com.R() - R_arm).norm() < 1e-14);  // axes of the moving link's URDF frame
  CHECK((link.com.R() * link.inertia_kg_m2 * link.com.R().transpose() - expected.inertia).norm() <
        1e-13);
  REQUIRE(link.spheres.size() == 1);
  CHECK((link.com * link.spheres[0].center_m - (p_hand + R_hand * Vector3d(0.1, 0.2, 0.3))).norm() <
        1e-14);
  CHECK(noted(robot, "locked at 0: finger (prismatic)"));
  CHECK(noted(robot, "lumped into link 'arm': tip, plate, hand"));
  CHECK_FALSE(link.joint.lower.has_value());  // continuous
}

TEST_CASE("content of a URDF that is not used is noted", "[description][robot]") {
  SECTION("no spheres") {
    const Robot robot =
        read_text("arm.urdf", replaced(arm, "<sphere radius=\"0.05\"/>", "<box size=\"1 1 1\"/>"));
    CHECK(noted(robot, "no collision spheres"));
    CHECK(noted(robot, "1 <collision><box>"));
  }
  SECTION("visuals, transmissions") {
    std::string text = replaced(
        arm, "<link name=\"tool\"/>",
        "<link name=\"tool\"><visual><geometry><box size=\"1 1 1\"/></geometry></visual></link>");
    text = replaced(text, "</robot>", "<transmission name=\"t\"/><gazebo/></robot>");
    const Robot robot = read_text("arm.urdf", text);
    CHECK(noted(robot, "1 <visual>"));
    CHECK(noted(robot, "1 <transmission>"));
    CHECK(noted(robot, "1 <gazebo>"));
  }
  SECTION("zero effort and velocity") {
    const Robot robot = read_text(
        "arm.urdf", replaced(arm, "effort=\"50\" velocity=\"3\"", "effort=\"0\" velocity=\"0\""));
    CHECK(noted(robot, "joint 'shoulder': effort=\"0\""));
    CHECK(noted(robot, "joint 'shoulder': velocity=\"0\""));
    CHECK_FALSE(robot.links[0].joint.effort_max.has_value());
    CHECK_FALSE(robot.links[0].joint.velocity_max.has_value());
  }
  SECTION("an axis that is not a unit vector") {
    const Robot robot =
        read_text("arm.urdf", replaced(arm, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 2 0\"/>"));
    CHECK(noted(robot, "joint 'shoulder': its axis had length 2"));
    CHECK(robot.links[0].joint.screw.head<3>() == Vector3d::UnitY());
  }
  SECTION("inertia without mass in a lumped link") {
    const Robot robot =
        read_text("arm.urdf", replaced(arm, "<link name=\"tool\"/>",
                                       "<link name=\"tool\"><inertial><mass value=\"0\"/><inertia "
                                       "ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" "
                                       "izz=\"1\"/></inertial></link>"));
    CHECK(any_has(robot.warnings, "link 'tool' has inertia but no mass"));
    CHECK(robot.links[1].mass_kg == 2.0);
    CHECK(robot.links[1].inertia_kg_m2(0, 0) == Approx(1.02));
  }
  SECTION("mimic on a fixed joint") {
    const Robot robot =
        read_text("arm.urdf", replaced(arm, "<parent link=\"lower\"/>",
                                       "<parent link=\"lower\"/><mimic joint=\"slide\"/>"));
    CHECK(noted(robot, "joint 'mount': <mimic> ignored"));
  }
  SECTION("spheres on the base") {
    const Robot robot =
        read_text("arm.urdf", replaced(arm, "<link name=\"base\"/>",
                                       "<link name=\"base\"><collision><geometry><sphere "
                                       "radius=\"0.1\"/></geometry></collision></link>"));
    CHECK(noted(robot, "1 collision spheres on the base"));
    CHECK(robot.links[0].spheres.empty());
  }
}

TEST_CASE(
    "a massless moving link is accepted only where what it carries has inertia about its joint",
    "[description][robot]") {
  // A universal joint: the cross piece has no mass, and its joint turns the lower link.
  const std::string cross =
      replaced(replaced(arm, inertial, ""), "type=\"prismatic\"", "type=\"revolute\"");
  CHECK(read_text("arm.urdf", cross).links[0].mass_kg == 0.0);
  // Two joints on one axis: the cross piece turns without moving any link that has inertia.
  const std::string coaxial =
      replaced(replaced(cross, "<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 1 0\"/>"),
               "<origin xyz=\"0 0 0.4\"/>", "");
  CHECK_THAT(message_of("arm.urdf", coaxial),
             Catch::Contains("link 'upper': nothing it moves has inertia about joint 'shoulder'"));
  CHECK_THAT(message_of("arm.urdf", replaced(replaced(arm, inertial, ""), inertial, "")),
             Catch::Contains("nothing it moves has inertia"));
}

TEST_CASE("a bad URDF is refused in one line that names place and fault", "[description][robot]") {
  struct Bad {
    const char* name;
    std::string text;
    const char* expected;
  };
  std::string many_attributes = "<robot";
  for (int i = 0; i < 100000; ++i) many_attributes += " a" + std::to_string(i) + "=\"1\"";
  many_attributes += "/>";
  const std::vector<Bad> list{
      {"empty", "", "the file is empty"},
      {"blank", " \n\n ", "the file is empty"},
      {"binary", std::string("<robot>\0</robot>", 16), "not text"},
      {"not XML", "this is not XML", "not XML"},
      {"cut", arm.substr(0, arm.size() / 2), "not XML"},
      {"mismatched tags", replaced(arm, "</robot>", "</robots>"), "not XML"},
      {"wrong root", "<sdf><model/></sdf>", "line 1: expected <robot> as the root, found <sdf>"},
      {"xacro",
       replaced(arm, "<link name=\"base\"/>", "<xacro:macro name=\"x\"/><link name=\"base\"/>"),
       "xacro source"},
      {"no link", "<robot name=\"r\"/>", "the robot has no <link>"},
      {"no name", replaced(arm, "<link name=\"tool\"/>", "<link/>"), "a <link> has no name"},
      {"deep", "<robot name=\"r\">" + repeated("<a>", 100000), "nest deeper than 100"},
      {"deep behind quotes", "<robot name=\"r\">" + repeated("<a b='/>'>", 100000),
       "nest deeper than 100"},
      {"deep behind ends of nothing", repeated("</a>", 1000) + repeated("<a>", 1000),
       "nest deeper than 100"},
      {"deep behind a quoted end of the declaration",
       "<?xml version=\"><!--\"?>" + repeated("<a>", 100000), "nest deeper than 100"},
      {"deep behind closing tags that open", repeated("<a></a/>", 1000),
       "line 1: not XML: a closing tag ends in '/>'"},
      {"a tag in a tag", "<robot name=\"r\"><link <a/></robot>",
       "line 1: not XML: '<' inside a tag"},
      {"one letter", "<", "line 1: not XML"},
      {"a comment only", "<!-- x -->\n", "expected <robot> as the root, found no element"},
      {"two roots of XML", arm + "<robot name=\"b\"/>",
       "line 24: not XML: <robot> after the end of <robot>"},
      {"a character that does not exist", replaced(arm, "name=\"tool\"", "name=\"t&#xD800;\""),
       "<link>: name refers to a character that does not exist"},
      {"no name of the robot", replaced(arm, "<robot name=\"arm\">", "<robot>"),
       "line 2: the <robot> has no name"},
      {"another version",
       replaced(arm, "<robot name=\"arm\">", "<robot name=\"arm\" version=\"2.0\">"),
       "line 2: version=\"2.0\" of URDF is not supported, expected 1.0"},
      {"a shape of another format",
       replaced(arm, "<sphere radius=\"0.05\"/>", "<capsule radius=\"0.05\" length=\"1\"/>"),
       "line 9: link 'lower': <capsule> is not a shape of URDF"},
      {"no shape", replaced(arm, "<sphere radius=\"0.05\"/>", ""),
       "line 9: link 'lower': <geometry> is empty"},
      {"a mimic of nothing",
       replaced(arm, "<parent link=\"lower\"/>", "<parent link=\"lower\"/><mimic/>"),
       "joint 'mount': <mimic> has no joint"},
      {"Latin-1", replaced(arm, "name=\"tool\"", "name=\"to\xf6l\""), "is not UTF-8"},
      {"many attributes", many_attributes, "a tag has more than 100 attributes"},
      {"many attributes behind a comment that '>' does not close",
       "<!--><![CDATA[-->" + many_attributes, "a tag has more than 100 attributes"},
      {"large", arm + std::string(4U << 20, ' '), "expected at most 4194304"},
      {"link twice",
       replaced(arm, "<link name=\"tool\"/>", "<link name=\"tool\"/><link name=\"base\"/>"),
       "link 'base' is given twice, first in line 3"},
      {"joint twice", replaced(arm, "<joint name=\"slide\"", "<joint name=\"shoulder\""),
       "joint 'shoulder' is given twice"},
      {"missing parent", replaced(arm, "<parent link=\"base\"/>", "<parent link=\"bse\"/>"),
       "its parent 'bse' is not a link of the file; did you mean 'base'?"},
      {"no child", replaced(arm, "<child link=\"upper\"/>", ""),
       "joint 'shoulder' has no <child link=...>"},
      {"two parents",
       replaced(arm, "<parent link=\"lower\"/><child link=\"tool\"/>",
                "<parent link=\"base\"/><child link=\"lower\"/>"),
       "link 'lower' is the child of two joints, 'slide' and 'mount'"},
      {"cycle", replaced(arm, "<parent link=\"base\"/>", "<parent link=\"tool\"/>"), "cycle"},
      {"whole cycle", R"(<robot name="r"><link name="a"/><link name="b"/>
        <joint name="x" type="fixed"><parent link="a"/><child link="b"/></joint>
        <joint name="y" type="fixed"><parent link="b"/><child link="a"/></joint></robot>)",
       "root"},
      {"two roots",
       replaced(arm, "<link name=\"base\"/>", "<link name=\"base\"/><link name=\"other\"/>"),
       "root"},
      {"NaN mass", replaced(arm, "<mass value=\"2\"/>", "<mass value=\"nan\"/>"),
       "link 'upper': <mass>: value=\"nan\", expected a finite number"},
      {"infinite inertia", replaced(arm, "ixx=\"0.02\"", "ixx=\"inf\""), "<inertia>: ixx=\"inf\""},
      {"garbage number", replaced(arm, "ixx=\"0.02\"", "ixx=\"0.02kg\""),
       "ixx=\"0.02kg\", expected a finite number"},
      {"value over two lines", replaced(arm, "ixx=\"0.02\"", "ixx=\"0.02\nkg\""),
       "expected a finite number"},
      {"overflow", replaced(arm, "upper=\"2\"", "upper=\"1e999\""),
       "joint 'shoulder': <limit>: upper=\"1e999\""},
      {"huge", replaced(arm, "<origin xyz=\"0 0 0.3\"/>", "<origin xyz=\"0 0 1e200\"/>"),
       "expected finite numbers up to"},
      {"two coordinates", replaced(arm, "<origin xyz=\"0 0 0.3\"/>", "<origin xyz=\"0 0.3\"/>"),
       "xyz=\"0 0.3\", expected three finite numbers"},
      {"negative mass", replaced(arm, "<mass value=\"2\"/>", "<mass value=\"-2\"/>"),
       "link 'upper': mass -2 kg"},
      {"missing mass", replaced(arm, "<mass value=\"2\"/>", ""), "link 'upper': <mass> is missing"},
      {"indefinite inertia", replaced(arm, "ixx=\"0.02\"", "ixx=\"-0.02\""),
       "link 'upper': inertia is not positive semi-definite"},
      {"point mass",
       replaced(arm, "ixx=\"0.02\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.01\"",
                "ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\""),
       "inertia is not positive definite"},
      {"zero axis", replaced(arm, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>"),
       "joint 'shoulder': the axis has length 0"},
      {"no limits", replaced(arm, "lower=\"-1\" upper=\"2\"", ""),
       "joint 'shoulder': lower limit 0 is not below upper limit 0"},
      {"limits swapped", replaced(arm, "lower=\"-1\" upper=\"2\"", "lower=\"2\" upper=\"-1\""),
       "lower limit 2 is not below upper limit -1"},
      {"no effort", replaced(arm, "effort=\"50\" ", ""),
       "line 14: joint 'shoulder': <limit> has no effort"},
      {"negative effort", replaced(arm, "effort=\"50\"", "effort=\"-50\""), "effort limit -50"},
      {"negative damping", replaced(arm, "damping=\"0.5\"", "damping=\"-0.5\""), "damping -0.5"},
      {"negative friction", replaced(arm, "friction=\"0.1\"", "friction=\"-1\""), "friction -1"},
      {"floating", replaced(arm, "type=\"prismatic\"", "type=\"floating\""),
       "joint 'slide': its type is floating"},
      {"planar", replaced(arm, "type=\"prismatic\"", "type=\"planar\""),
       "joint 'slide': its type is planar"},
      {"unknown type", replaced(arm, "type=\"prismatic\"", "type=\"helical\""),
       "joint 'slide': its type is 'helical', expected one of revolute"},
      {"mimic",
       replaced(arm, "<parent link=\"upper\"/>",
                "<parent link=\"upper\"/><mimic joint=\"shoulder\"/>"),
       "joint 'slide': it mimics 'shoulder', expected no <mimic>"},
      {"zero sphere", replaced(arm, "radius=\"0.05\"", "radius=\"0\""),
       "radius 0 m, expected a positive number"},
      {"inertial twice", replaced(arm, inertial, inertial + inertial),
       "link 'upper': <inertial> is given twice"},
      {"nothing moves", R"(<robot name="r"><link name="a"/></robot>)",
       "no joint moves between 'a' and the tip 'a'"},
      {"several leaves", replaced(arm, "<parent link=\"lower\"/>", "<parent link=\"upper\"/>"),
       "several leaves, name one as the tip (--tip, or /robot/tip of a scene): tool, lower"},
  };
  REQUIRE(list.size() >= 40);
  for (const Bad& bad : list) {
    const std::string message = message_of("bad.urdf", bad.text);
    CAPTURE(bad.name);
    CHECK_THAT(message, Catch::Contains(bad.expected));
    CHECK(message.find('\n') == std::string::npos);
  }
}

TEST_CASE("moments that break the triangle inequality give a warning, or an error with strict",
          "[description][robot]") {
  const auto refused = [](const std::string& name, const std::string& text) {
    RobotOptions strict;
    strict.strict = true;
    return message_of(name, text, strict);
  };
  const std::string text = replaced(arm, "izz=\"0.01\"", "izz=\"0.05\"");
  const Robot robot = read_text("arm.urdf", text);
  CHECK(robot.links[0].inertia_kg_m2(2, 2) == 0.05);
  const auto messages = robot.warnings;
  REQUIRE(messages.size() == 1);
  CHECK_THAT(messages[0],
             Catch::StartsWith("link 'upper': inertia breaks the triangle inequality") &&
                 Catch::Contains("0.02, 0.02, 0.05"));
  CHECK_THAT(refused("arm.urdf", text),
             Catch::StartsWith(": line 4: link 'upper': inertia breaks the triangle"));
  CHECK(refused("arm.urdf", arm) == "no error");

  // The robot's JSON form contains the warning once, however often it is read.
  const std::string json = robot_to_json(robot).dump();
  const Robot again = read_text("arm.json", json);
  check_same(again, robot);
  CHECK(again.warnings == messages);
  CHECK_THAT(refused("arm.json", json),
             Catch::StartsWith(": link 'upper': inertia breaks the triangle inequality"));

  // If a part is lumped into a moving link, the warning names the part.
  const Robot lumped = read_text(
      "arm.urdf", replaced(arm, "<link name=\"tool\"/>",
                           "<link name=\"tool\">" +
                               replaced(inertial, "izz=\"0.01\"", "izz=\"0.05\"") + "</link>"));
  REQUIRE(lumped.warnings.size() == 1);
  CHECK_THAT(lumped.warnings[0], Catch::StartsWith("link 'tool': inertia"));
  check_same(read_text("arm.json", robot_to_json(lumped).dump()), lumped);
}

TEST_CASE("a file that is not a robot file is refused", "[description][robot]") {
  CHECK_THROWS_AS(read_robot(data), Error);  // a directory
  CHECK_THROWS_AS(read_robot(data / "absent.urdf"), Error);
  CHECK_THAT(message_of("arm.txt", arm),
             Catch::Contains("unknown kind of robot file '.txt', expected .urdf or .json"));
  RobotOptions options;
  options.tip = "toll";
  CHECK_THAT(message_of("arm.urdf", arm, options),
             Catch::Contains("no link 'toll' for the tip; did you mean 'tool'?; leaves are: tool"));
}

TEST_CASE("a bad JSON robot is refused with its place", "[description][robot]") {
  const Json good = robot_to_json(make_chain({}));
  const auto message = [&](const std::string& pointer, const Json& value) {
    Json bad = good;
    bad[Json::json_pointer(pointer)] = value;
    return message_of("bad.json", bad.dump());
  };
  CHECK_THAT(message_of("bad.json", ""), Catch::Contains("not JSON"));
  CHECK_THAT(message_of("bad.json", "[]"), Catch::Contains("/"));
  CHECK_THAT(message("/links/0/mass_kg", "one"), Catch::Contains("/links/0/mass_kg"));
  CHECK_THAT(message("/links/0/mass_kg", -1), Catch::Contains("/links/0/mass_kg"));
  CHECK_THAT(message("/links/0/mass", 1), Catch::Contains("unknown key 'mass'"));
  CHECK_THAT(message("/links/0/com/quaternion_wxyz", {1, 1, 0, 0}),
             Catch::Contains("/links/0/com/quaternion_wxyz: the norm is 1.414"));
  CHECK_THAT(message("/links/1/name", "a\nb"), Catch::Contains("control characters"));
  CHECK_THAT(message("/links/1/parent", -1),
             Catch::Contains("link 'link2': parent is -1, expected 0"));
  CHECK_THAT(message("/links/1/name", "link1"),
             Catch::Contains("link 'link1': the name is given twice"));
  CHECK_THAT(message("/links/1/joint/name", "j1"),
             Catch::Contains("joint 'j1': the name is given twice"));
  CHECK_THAT(message("/links/0/joint/screw", {0, 0, 0, 0, 0, 0}),
             Catch::Contains("/links/0/joint: the axis has length 0"));
  CHECK_THAT(message("/links/0/joint/screw", {1, 0, 0, 1, 0, 0}), Catch::Contains("pitch"));
  CHECK_THAT(message("/links/0/joint/type", "prismatic"),
             Catch::Contains("/links/0/joint: the axis has length 0"));
  CHECK_THAT(message("/links/1/joint/type", "prismatic"),
             Catch::Contains("joint 'j2': the screw of a prismatic joint has omega != 0"));
  CHECK_THAT(message("/links/0/inertia_kg_m2", {1, 1, 1, 2, 0, 0}),
             Catch::Contains("not positive definite"));
  CHECK_THAT(message("/links/0/spheres/0/radius_m", 0),
             Catch::Contains("/links/0/spheres/0/radius_m"));
  CHECK_THAT(message("/tip/link", "link9"), Catch::Contains("/tip/link: no link 'link9'"));
  CHECK_THAT(message("/self_collision_disabled/0/0", "lnk1"),
             Catch::Contains("no link 'lnk1'; did you mean 'link1'?"));
  Json wrong_limits = good;
  wrong_limits["links"][0]["joint"]["lower"] = 1;
  wrong_limits["links"][0]["joint"]["upper"] = 0;
  CHECK_THAT(message_of("bad.json", wrong_limits.dump()),
             Catch::Contains("joint 'j1': lower limit 1 is not below upper limit 0"));
  RobotOptions options;
  options.tip = "hand";
  CHECK_THAT(
      message_of("good.json", good.dump(), options),
      Catch::Contains("no frame 'hand' on a moving link for the tip, expected one of link7"));
}

TEST_CASE("a robot survives its JSON form bit for bit", "[description][robot]") {
  std::vector<Robot> robots{make_chain({}), read_text("arm.urdf", arm),
                            read_robot(data / "planar3.json"), read_robot(data / "planar4.json")};
  RobotOptions options;
  options.spheres = data / "arm7.spheres.json";
  robots.push_back(read_robot(data / "arm7.urdf", options));
  // Chains with randomly rotated COM frames.
  for (unsigned seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    Json json = robot_to_json(make_chain({2}));
    Eigen::Vector4d q(rng.normal(), rng.normal(), rng.normal(), rng.normal());
    q.normalize();
    json["links"][0]["com"]["quaternion_wxyz"] = {q[0], q[1], q[2], q[3]};
    json["links"][0]["joint"]["friction"] = rng.uniform(0.0, 1.0);
    json["links"][0]["joint"]["armature"] = rng.uniform(0.0, 1.0);
    json["links"][1]["joint"]["screw"] = {0.6 * (1.0 + 1e-9), 0, 0.8, 0, 0, 0};
    robots.push_back(robot_from_json(json, "tilted"));
  }
  for (const Robot& robot : robots) {
    const Json json = robot_to_json(robot);
    const Robot again = robot_from_json(parse_json(json.dump(), "again"), "again");
    check_same(robot, again);
    CHECK(robot_to_json(again).dump() == json.dump());
  }
}

TEST_CASE("a sidecar's spheres replace the file's own", "[description][robot]") {
  const Scratch spheres(
      "spheres.json",
      R"({"links": {"lower": [{"center": [0, 0, 0], "radius": 0.1}], "tool": [{"center": [0.1, 0, 0], "radius": 0.2}],
    "upper": [{"center": [0, 0, 0.2], "radius": 0.1}], "base": [{"center": [0, 0.3, 0.1], "radius": 0.2}]},
    "self_collision_disabled": [["upper", "lower"], ["base", "tool"]]})");
  RobotOptions options;
  options.spheres = spheres.file();
  const Robot robot = read_text("arm.urdf", arm, options);
  CHECK(noted(robot, "the file's own 1 collision spheres are replaced by those of spheres.json"));
  REQUIRE(robot.links[1].spheres.size() == 2);
  const Link& lower = robot.links[1];
  CHECK((lower.com * lower.spheres[0].center_m - Vector3d(0, 0, 0.7)).norm() < 1e-15);
  CHECK((lower.com * lower.spheres[1].center_m -
         Vector3d(0.1 * std::cos(1.0), 0.1 * std::sin(1.0), 0.95))
            .norm() < 1e-15);
  // Lumped links keep their names for self-collision, and the base keeps its spheres.
  CHECK(lower.spheres[0].part.empty());
  CHECK(lower.spheres[1].part == "tool");
  REQUIRE(robot.base_spheres.size() == 1);
  CHECK(robot.base_spheres[0].part == "base");
  CHECK(robot.base_spheres[0].center_m == Vector3d(0, 0.3, 0.1));
  using Pair = std::pair<std::string, std::string>;
  CHECK(robot.self_collision_disabled == std::vector<Pair>{{"upper", "lower"}, {"base", "tool"}});
  check_same(robot, robot_from_json(parse_json(robot_to_json(robot).dump(), "again"), "again"));

  const auto refused = [&](const std::string& text) {
    const Scratch bad("bad.json", text);
    RobotOptions with_bad;
    with_bad.spheres = bad.file();
    try {
      (void)read_text("arm.urdf", arm, with_bad);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  CHECK_THAT(refused("{}"), Catch::Contains("bad.json: expected an object whose \"links\""));
  CHECK_THAT(refused(R"({"links": {"lover": []}})"),
             Catch::Contains("no link 'lover'; did you mean 'lower'?"));
  CHECK_THAT(refused(R"({"links": {"lower": [{"center": [0, 0], "radius": 1}]}})"),
             Catch::Contains("/links/lower/0"));
  CHECK_THAT(refused(R"({"links": {"lower": [{"center": [0, 0, 0], "radius": -1}]}})"),
             Catch::Contains("/links/lower/0/radius"));
  CHECK_THAT(refused(R"({"links": {}, "self_collision_disabled": [["lower"]]})"),
             Catch::Contains("pairs of link names"));
}

TEST_CASE("a sidecar's capsules go to their links as its spheres do, and replace the file's own",
          "[description][robot]") {
  const Scratch sidecar("shapes.json",
                        R"({"links": {"upper": [{"center": [0, 0, 0.2], "radius": 0.1}]},
    "capsules": {"lower": [{"from": [0, 0, 0], "to": [0, 0, 0.2], "radius": 0.1}],
                 "tool": [{"from": [0.1, 0, 0], "to": [0.3, 0, 0], "radius": 0.05}],
                 "base": [{"from": [0, 0, -0.2], "to": [0, 0, 0.1], "radius": 0.2}]},
    "self_collision_disabled": [["upper", "lower"], ["base", "tool"]]})");
  RobotOptions options;
  options.spheres = sidecar.file();
  const Robot robot = read_text("arm.urdf", arm, options);
  CHECK(noted(robot, "1 collision capsules on the base do not move"));
  CHECK_FALSE(noted(robot, "collisions are not checked"));
  const Link& lower = robot.links[1];
  REQUIRE(lower.segments.size() == 2);
  CHECK((lower.com * lower.segments[0].from_m - Vector3d(0, 0, 0.7)).norm() < 1e-15);
  CHECK((lower.com * lower.segments[0].to_m - Vector3d(0, 0, 0.9)).norm() < 1e-15);
  CHECK(lower.segments[0].radius_m == 0.1);
  CHECK(lower.segments[0].part.empty());
  CHECK((lower.com * lower.segments[1].to_m -
         Vector3d(0.3 * std::cos(1.0), 0.3 * std::sin(1.0), 0.95))
            .norm() < 1e-15);
  CHECK(lower.segments[1].part == "tool");
  REQUIRE(robot.base_segments.size() == 1);
  CHECK(robot.base_segments[0].part == "base");
  CHECK(robot.base_segments[0].from_m == Vector3d(0, 0, -0.2));
  CHECK(robot.self_collision_disabled.size() == 2);  // capsules have parts as spheres do
  check_same(robot, robot_from_json(parse_json(robot_to_json(robot).dump(), "again"), "again"));
  CHECK(check_spheres(sidecar.file()) == 4);

  // For a JSON robot it replaces spheres and capsules and keeps lines.
  Robot with_line = robot;
  with_line.links[1].segments.push_back({Vector3d::Zero(), Vector3d::UnitX(), 0.0});
  const Scratch file("robot.json", robot_to_json(with_line).dump());
  const Scratch other(
      "other.json",
      R"({"links": {}, "capsules": {"upper": [{"from": [0, 0, 0], "to": [0, 0, 1], "radius": 0.3}]}})");
  options.spheres = other.file();
  const Robot replaced = read_robot(file.file(), options);
  CHECK(replaced.base_segments.empty());
  CHECK(replaced.links[0].spheres.empty());
  REQUIRE(replaced.links[0].segments.size() == 1);
  CHECK(replaced.links[0].segments[0].radius_m == 0.3);
  REQUIRE(replaced.links[1].segments.size() == 1);
  CHECK_FALSE(replaced.links[1].segments[0].is_capsule());

  const auto refused = [&](const std::string& text) {
    const Scratch bad("bad.json", text);
    RobotOptions with_bad;
    with_bad.spheres = bad.file();
    try {
      (void)read_text("arm.urdf", arm, with_bad);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  CHECK_THAT(refused(R"({"links": {}, "capsules": []})"),
             Catch::Contains("/capsules: expected an object"));
  CHECK_THAT(refused(R"({"links": {}, "capsules": {"lover": []}})"),
             Catch::Contains("did you mean 'lower'?"));
  CHECK_THAT(refused(R"({"links": {}, "capsules": {"lower": [{"from": [0, 0, 0], "radius": 1}]}})"),
             Catch::Contains("/capsules/lower/0"));
  CHECK_THAT(
      refused(
          R"({"links": {}, "capsules": {"lower": [{"from": [0, 0, 0], "to": [0, 0, 1], "radius": 0}]}})"),
      Catch::Contains("/capsules/lower/0/radius"));
}

TEST_CASE("parts of a JSON robot are checked, and a sidecar replaces them with their pairs",
          "[description][robot]") {
  const Scratch spheres("spheres.json",
                        R"({"links": {"lower": [{"center": [0, 0, 0], "radius": 0.1}],
    "tool": [{"center": [0.1, 0, 0], "radius": 0.2}], "base": [{"center": [0, 0, 0], "radius": 0.2}]},
    "self_collision_disabled": [["upper", "lower"], ["base", "tool"]]})");
  RobotOptions options;
  options.spheres = spheres.file();
  const Json json = robot_to_json(read_text("arm.urdf", arm, options));
  const auto refused = [&](const std::string& pointer, const Json& value) -> std::string {
    Json bad = json;
    bad[Json::json_pointer(pointer)] = value;
    try {
      (void)robot_from_json(bad, "robot");
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  CHECK_THAT(refused("/self_collision_disabled/1/1", "tolo"),
             Catch::Contains("no link 'tolo'; did you mean 'tool'?"));
  CHECK_THAT(refused("/base_spheres/0/part", "lower"),
             Catch::Contains("part 'lower' is on another link"));
  CHECK_THAT(refused("/links/1/spheres/1/part", "upper"),
             Catch::Contains("part 'upper' is on another link"));
  CHECK_THAT(refused("/base_spheres/0/radius_m", 0), Catch::Contains("/base_spheres/0/radius_m"));
  CHECK_THAT(refused("/base_spheres/0", {{"center_m", {0, 0, 0}}, {"radius_m", 0.1}}),
             Catch::Contains("part"));

  const Scratch replacing("replacing.json",
                          R"({"links": {"upper": [{"center": [0, 0, 0], "radius": 0.1}]}})");
  const Scratch file("robot.json", json.dump());
  options.spheres = replacing.file();
  const Robot robot = read_robot(file.file(), options);
  CHECK(robot.base_spheres.empty());
  CHECK(robot.links[1].spheres.empty());
  CHECK(robot.self_collision_disabled ==
        std::vector<std::pair<std::string, std::string>>{{"upper", "lower"}});
}

TEST_CASE("make_chain builds the reference chain and refuses invalid options",
          "[description][robot]") {
  const Robot robot = make_chain({4, "x,z,x", 0.2, 1.0, 0.03});
  REQUIRE(robot.dof() == 4);
  for (int i = 0; i < 4; ++i) {
    CAPTURE(i);
    const Link& link = robot.links[static_cast<std::size_t>(i)];
    const Vector3d axis = i % 3 == 1 ? Vector3d::UnitZ() : Vector3d::UnitX();
    const Vector3d origin(0, 0.2 * i, 0);
    CHECK(link.joint.screw.head<3>() == axis);
    CHECK((link.joint.screw.tail<3>() + axis.cross(origin)).norm() < 1e-15);
    CHECK((link.com.p() - (origin + Vector3d(0, 0.1, 0))).norm() < 1e-15);
    CHECK(link.inertia_kg_m2(0, 0) == Approx(0.04 / 12 + 0.0009 / 4));
    CHECK(link.inertia_kg_m2(1, 1) == Approx(0.00045));
    CHECK(link.inertia_kg_m2(2, 2) == link.inertia_kg_m2(0, 0));
    CHECK(link.spheres.empty());
    REQUIRE(link.segments.size() == 1);
    CHECK(link.segments[0].is_capsule());
    CHECK((link.com * link.segments[0].from_m - origin).norm() < 1e-15);
    CHECK((link.com * link.segments[0].to_m - origin).norm() == Approx(0.2));
    CHECK(link.segments[0].radius_m == 0.03);
  }
  CHECK((robot.tip.pose.p() - Vector3d(0, 0.8, 0)).norm() < 1e-15);
  CHECK_NOTHROW(make_chain({200, "x,y,z", 0.04, 0.1, 0.01}));
  for (const ChainOptions& bad :
       {ChainOptions{0}, ChainOptions{20000}, ChainOptions{3, ""}, ChainOptions{3, "x,w"},
        ChainOptions{3, "x,"}, ChainOptions{3, "x", 0.0}, ChainOptions{3, "x", 0.2, -1.0},
        ChainOptions{3, "x", 0.2, 1.0, std::nan("")}})
    CHECK_THROWS_AS(make_chain(bad), Error);
}

namespace {

std::string leaves_of(const fs::path& file) {
  try {
    (void)read_robot(file);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("the Panda loads with its tip, and without one its leaves are named",
          "[description][robot]") {
  CHECK_THAT(
      leaves_of(test::third_party_robots / "panda.urdf"),
      Catch::Contains("of a scene): panda_leftfinger, panda_rightfinger, panda_grasptarget"));
  RobotOptions options;
  options.tip = "panda_grasptarget";
  options.spheres = test::third_party_robots / "panda_spheres.json";
  const Robot robot = read_robot(test::third_party_robots / "panda.urdf", options);
  REQUIRE(robot.dof() == 7);
  CHECK(robot.tip.name == "panda_grasptarget");
  CHECK((robot.tip.pose.p() - Vector3d(0.088, 0, 0.333 + 0.316 + 0.384 - 0.107 - 0.105)).norm() <
        1e-9);
  CHECK(robot.links[6].mass_kg == Approx(0.2 + 0.81 + 0.1 + 0.1));
  CHECK(robot.links[6].spheres.size() == 5 + 18 + 2 + 2);
  CHECK(noted(robot, "lumped into link 'panda_link7': panda_link8, panda_hand"));
  CHECK(any_has(robot.warnings, "link 'panda_grasptarget' has inertia but no mass"));
  CHECK(noted(robot, "joint 'panda_finger_joint2': <mimic> ignored"));
  CHECK(noted(robot, "1 collision spheres on the base"));
  REQUIRE(robot.base_spheres.size() == 1);
  CHECK(robot.base_spheres[0].part == "panda_link0");
  CHECK(std::count_if(robot.links[6].spheres.begin(), robot.links[6].spheres.end(),
                      [](const Sphere& sphere) { return sphere.part == "panda_hand"; }) == 18);
  CHECK(robot.self_collision_disabled.size() == 34);
  check_same(robot, robot_from_json(robot_to_json(robot), "again"));
  CHECK(robot.links[0].joint.effort_max == 87.0);
  CHECK(std::count(robot.self_collision_disabled.begin(), robot.self_collision_disabled.end(),
                   std::make_pair(std::string("panda_link1"), std::string("panda_link2"))) == 1);
}

TEST_CASE("the UR5 loads with its tip, and without one its leaves are named",
          "[description][robot]") {
  const auto robots = test::shared_data("robots");
  CHECK_THAT(leaves_of(robots / "ur5_robot.urdf"),
             Catch::Contains("ee_link") && Catch::Contains("tool0") && Catch::Contains("base"));
  RobotOptions options;
  options.tip = "tool0";
  const Robot robot = read_robot(robots / "ur5_robot.urdf", options);
  REQUIRE(robot.dof() == 6);
  CHECK(noted(robot, "no collision spheres"));
  CHECK(robot.links[2].joint.lower == Approx(-3.14159265359));
}

TEST_CASE("a minimal robot file is written back unchanged", "[description][robot]") {
  const Json json = Json::parse(R"({"schema": "hamelin.robot/1", "name": "one",
    "tip": {"link": "link1", "position_m": [0, 0.3, 0], "quaternion_wxyz": [1, 0, 0, 0]},
    "links": [{"name": "link1", "parent": -1,
      "joint": {"name": "j1", "type": "revolute", "screw": [1, 0, 0, 0, 0, 0], "lower": null, "upper": null,
                "velocity_max": null, "effort_max": null, "damping": 0},
      "com": {"position_m": [0, 0.15, 0], "quaternion_wxyz": [1, 0, 0, 0]},
      "mass_kg": 2, "inertia_kg_m2": [0.02, 0.001, 0.02, 0, 0, 0],
      "spheres": [{"center_m": [0, 0.1, 0], "radius_m": 0.04}],
      "segments": [{"from_m": [0, -0.15, 0], "to_m": [0, 0.15, 0], "radius_m": 0}]}],
    "self_collision_disabled": []})");
  CHECK(robot_to_json(robot_from_json(json, "one")) == json);
}

TEST_CASE(
    "arm7's spheres cover it and no two links more than a joint apart overlap at the ready pose",
    "[description][robot]") {
  RobotOptions options;
  options.spheres = data / "arm7.spheres.json";
  const Robot robot = read_robot(data / "arm7.urdf", options);
  REQUIRE(robot.dof() == 7);
  CHECK(robot.tip.name == "flange");
  CHECK((robot.tip.pose.p() - Vector3d(0.088, 0, 0.333 + 0.316 + 0.384 - 0.107)).norm() < 1e-12);
  const std::vector<double> ready{0, -0.785, 0, -2.356, 0, 1.571, 0.785};
  // World positions by the product of exponentials.
  std::vector<std::vector<std::pair<Vector3d, double>>> placed;
  geometry::SE3 moved;
  std::size_t count = 0;
  for (std::size_t i = 0; i < 7; ++i) {
    const Link& link = robot.links[i];
    moved = moved * geometry::SE3::exp(link.joint.screw * ready[i]);
    placed.emplace_back();
    for (const Sphere& sphere : link.spheres)
      placed.back().emplace_back(moved * (link.com * sphere.center_m), sphere.radius_m);
    count += link.spheres.size();
    CHECK_FALSE(link.spheres.empty());
    CHECK(link.joint.lower < ready[i]);
    CHECK(link.joint.upper > ready[i]);
    CHECK(link.joint.effort_max == (i < 4 ? 87.0 : 12.0));
    CHECK(link.joint.velocity_max == (i < 4 ? 2.175 : 2.61));
  }
  CHECK(count >= 40);
  CHECK(count <= 60);
  for (std::size_t a = 0; a < 7; ++a)
    for (std::size_t b = a + 2; b < 7; ++b)
      for (const auto& x : placed[a])
        for (const auto& y : placed[b]) {
          CAPTURE(a, b, x.first.transpose(), y.first.transpose());
          CHECK((x.first - y.first).norm() > x.second + y.second);
        }
}
