#include "hamelin/fit/robot_fit.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/test/errors.hpp"
#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;
using Eigen::Vector3d;

namespace {

std::string link(const std::string& name, const std::string& inside) {
  return "<link name=\"" + name +
         "\"><inertial><mass value=\"1\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" "
         "iyz=\"0\" "
         "izz=\"0.01\"/></inertial>\n" +
         inside + "</link>\n";
}

std::string collision(const std::string& geometry, const std::string& origin = "",
                      const char* tag = "collision") {
  return std::string("<") + tag + ">" + origin + "<geometry>\n" + geometry + "</geometry></" + tag +
         ">\n";
}

std::string joint(const std::string& parent, const std::string& child) {
  return "<joint name=\"to_" + child + "\" type=\"revolute\"><parent link=\"" + parent +
         "\"/><child link=\"" + child +
         "\"/><axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" "
         "velocity=\"1\"/></joint>\n";
}

// A base without geometry and one link with the given shapes.
std::string robot(const std::string& shapes) {
  return "<robot name=\"r\">\n<link name=\"base\"/>\n" + link("arm", shapes) +
         joint("base", "arm") + "</robot>\n";
}

std::string error_of(const std::filesystem::path& urdf, const FitOptions& options = {}) {
  return test::error_of([&] { (void)fit_robot(urdf, options); });
}

double least_distance(const LinkFit& of, const Vector3d& p) {
  double least = 1e300;
  for (const Shape& shape : of.shapes) least = std::min(least, distance(shape, p));
  return least;
}

}  // namespace

TEST_CASE("box, cylinder and sphere of a link are covered at their origins", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf = scratch.put(
      "r.urdf", robot(collision("<box size=\"0.2 0.1 0.1\"/>",
                                "<origin xyz=\"0.5 0 0\" rpy=\"0 0 1.5707963267948966\"/>") +
                      collision("<cylinder radius=\"0.05\" length=\"0.3\"/>",
                                "<origin xyz=\"0 0 1\" rpy=\"0 1.5707963267948966 0\"/>") +
                      collision("<sphere radius=\"0.123\"/>", "<origin xyz=\"0 2 0\"/>")));
  for (const bool capsules : {false, true}) {
    FitOptions options;
    options.cover.capsules = capsules;
    const RobotFit fit = fit_robot(urdf, options);
    REQUIRE(fit.links.size() == 1);
    const LinkFit& arm = fit.links[0];
    CHECK(arm.name == "arm");
    CHECK(arm.gap.bound_m == 0.0);
    CHECK(fit.gap_bound_m() == 0.0);
    CHECK(arm.excess.max_m < 0.025 + 0.01);
    // the sphere stays unchanged
    CHECK(std::count_if(arm.shapes.begin(), arm.shapes.end(), [](const Shape& s) {
            return s.ball() && s.radius_m == 0.123 && s.from == Vector3d(0.0, 2.0, 0.0);
          }) == 1);
    Rng rng(1);
    for (int i = 0; i < 20'000; ++i) {
      Vector3d box(rng.uniform(-0.05, 0.05), rng.uniform(-0.1, 0.1), rng.uniform(-0.05, 0.05));
      const auto side = static_cast<Eigen::Index>(rng.below(3));
      box[side] = (rng.below(2) == 0 ? -1.0 : 1.0) * (side == 1 ? 0.1 : 0.05);
      REQUIRE(least_distance(arm, box + Vector3d(0.5, 0.0, 0.0)) <= 1e-12);
      const double turn = rng.uniform(0.0, 2.0 * M_PI), x = rng.uniform(-0.15, 0.15),
                   r = 0.05 * rng.uniform();
      REQUIRE(least_distance(arm, {x, 0.05 * std::cos(turn), 1.0 + 0.05 * std::sin(turn)}) <=
              1e-12);
      REQUIRE(least_distance(arm, {x < 0.0 ? -0.15 : 0.15, r * std::cos(turn),
                                   1.0 + r * std::sin(turn)}) <= 1e-12);
    }
    CHECK(arm.volume_m3 == Approx(0.002 + M_PI * 0.0025 * 0.3).epsilon(0.05));
    CHECK((std::find_if(fit.notes.begin(), fit.notes.end(), [](const std::string& n) {
             return n.find("no geometry and therefore no shapes: base") == 0;
           }) != fit.notes.end()));
  }
}

TEST_CASE("read_robot reads the sidecar, and it measures as the fit did", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf =
      scratch.put("r.urdf", robot(collision("<cylinder radius=\"0.05\" length=\"0.4\"/>")));
  for (const bool capsules : {false, true}) {
    FitOptions options;
    options.cover.capsules = capsules;
    options.padding_m = 0.01;
    const RobotFit fit = fit_robot(urdf, options);
    const auto file = scratch.put("s.json", sidecar_json(fit, "note", {{"base", "arm"}}).dump());
    const model::Robot read = description::read_robot(urdf, {{}, file});
    CHECK(read.links[0].spheres.size() + read.links[0].segments.size() == fit.shapes());
    CHECK((read.links[0].segments.empty() != capsules));
    const RobotFit again = measure_sidecar(urdf, file, {});
    CHECK(again.shapes() == fit.shapes());
    CHECK(again.gap_bound_m() == 0.0);
    CHECK(again.excess_max_m() == fit.excess_max_m());
    FitOptions bare;
    bare.cover.capsules = capsules;
    CHECK(fit.links[0].shapes[0].radius_m ==
          Approx(fit_robot(urdf, bare).links[0].shapes[0].radius_m + 0.01));
  }
}

TEST_CASE("the gap of shapes that do not cover the geometry is measured", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf = scratch.put(
      "r.urdf", robot(collision("<box size=\"0.2 0.2 0.2\"/>") +
                      collision("<sphere radius=\"0.1\"/>", "<origin xyz=\"1 0 0\"/>")));
  const auto file =
      scratch.put("s.json", R"({"links": {"arm": [{"center": [0, 0, 0], "radius": 0.12},
                                              {"center": [1, 0, 0], "radius": 0.07}], "base": []}})");
  const RobotFit given = measure_sidecar(urdf, file, {});
  CHECK(given.links[0].gap.found_m == Approx(0.1 * std::sqrt(3.0) - 0.12).epsilon(1e-9));
  CHECK(given.links[0].gap.bound_m == Approx(0.1 * std::sqrt(3.0) - 0.12).margin(1e-4));
  const auto none = scratch.put("n.json", R"({"links": {}})");
  CHECK(std::isinf(measure_sidecar(urdf, none, {}).gap_bound_m()));
}

TEST_CASE(
    "meshes are found by package, by folder and beside the URDF; scale and origin are applied",
    "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const Mesh box = test::boxes({{Vector3d(0.0, 0.0, 0.0), Vector3d(100.0, 50.0, 50.0)}});
  (void)scratch.put("pkg/meshes/box.stl", test::binary_stl(box));
  (void)scratch.put("robots/near.stl", test::binary_stl(box));
  const auto mesh = [](const std::string& file) {
    return robot(collision("<mesh filename=\"" + file + "\" scale=\"0.001 0.001 0.001\"/>",
                           "<origin xyz=\"1 0 0\"/>"));
  };
  FitOptions by_package, by_folder;
  by_package.meshes.packages = {{"some_package", scratch.path() / "pkg"}};
  by_folder.meshes.folders = {scratch.path() / "pkg"};
  struct Way {
    std::string name;
    FitOptions options;
  };
  const std::vector<Way> ways = {{"package://some_package/meshes/box.stl", by_package},
                                 {"package://other/deep/down/meshes/box.stl", by_folder},
                                 {"near.stl", {}},
                                 {"package://whatever/near.stl", {}},
                                 {"file://" + (scratch.path() / "pkg/meshes/box.stl").string(), {}},
                                 {"../pkg/meshes/box.stl", {}}};
  for (const Way& way : ways) {
    CAPTURE(way.name);
    const auto urdf = scratch.put("robots/r.urdf", mesh(way.name));
    const RobotFit fit = fit_robot(urdf, way.options);
    REQUIRE(fit.links.size() == 1);
    CHECK(fit.links[0].triangles == 12);
    CHECK(fit.gap_bound_m() == 0.0);
    CHECK(least_distance(fit.links[0], {1.0, 0.0, 0.0}) <= 1e-7);
    CHECK(least_distance(fit.links[0], {1.1, 0.05, 0.05}) <= 1e-7);
    CHECK(least_distance(fit.links[0], {0.9, 0.0, 0.0}) > 0.0);
  }
  const std::string missing =
      error_of(scratch.put("robots/r.urdf", mesh("package://gone/meshes/gone.stl")), by_folder);
  CHECK_THAT(missing,
             Catch::Contains("r.urdf: line 5: link 'arm'") &&
                 Catch::Contains("'package://gone/meshes/gone.stl'") &&
                 Catch::Contains((scratch.path() / "robots/gone/meshes/gone.stl").string()));
  CHECK(missing.find('\n') == std::string::npos);
}

TEST_CASE("bad geometry is refused in one line that names the place", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto of = [&](const std::string& text) { return error_of(scratch.put("r.urdf", text)); };
  CHECK_THAT(of(robot("")), Catch::Contains("r.urdf: no link has a <collision>"));
  CHECK_THAT(of(robot(collision("<box size=\"0.2 0 0.1\"/>"))),
             Catch::Contains("line 5") && Catch::Contains("positive"));
  CHECK_THAT(of(robot(collision("<box size=\"0.2 nan 0.1\"/>"))),
             Catch::Contains("line 5") && Catch::Contains("finite"));
  CHECK_THAT(of(robot(collision("<sphere radius=\"-1\"/>"))),
             Catch::Contains("line 5") && Catch::Contains("radius"));
  CHECK_THAT(of(robot(collision("<mesh filename=\"a.stl\" scale=\"1 x 1\"/>"))),
             Catch::Contains("line 5: link 'arm': <mesh>: scale=\"1 x 1\""));
  CHECK_THAT(of(robot(collision("<mesh filename=\"a.stl\" scale=\"1 0 1\"/>"))),
             Catch::Contains("line 5"));
  (void)scratch.put("junk.stl", "no mesh at all");
  CHECK_THAT(of(robot(collision("<mesh filename=\"junk.stl\"/>"))),
             Catch::Contains("line 5") && Catch::Contains("junk.stl: not a mesh"));
  FitOptions few;
  few.total = 1;
  const auto two = scratch.put("two.urdf", "<robot name=\"r\">" +
                                               link("base", collision("<box size=\"1 1 1\"/>")) +
                                               link("arm", collision("<box size=\"1 1 1\"/>")) +
                                               joint("base", "arm") + "</robot>");
  CHECK_THAT(error_of(two, few), Catch::Contains("at least 2"));
}

TEST_CASE("<visual> is used only if requested and if <collision> is absent", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf =
      scratch.put("r.urdf", robot(collision("<box size=\"0.1 0.1 0.1\"/>", "", "visual")));
  CHECK_THAT(error_of(urdf), Catch::Contains("--visual"));
  FitOptions options;
  options.visual = true;
  const RobotFit fit = fit_robot(urdf, options);
  CHECK(fit.links.size() == 1);
  CHECK_THAT(fit.notes.at(0), Catch::Contains("taken from <visual>") && Catch::Contains("arm"));
}

TEST_CASE("a total number of shapes is kept, and more shapes stick out less", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto urdf = scratch.put("r.urdf", robot(collision("<box size=\"0.5 0.1 0.1\"/>")));
  double before = 1e300;
  for (const int total : {2, 5, 9}) {
    FitOptions options;
    options.total = total;
    const RobotFit fit = fit_robot(urdf, options);
    CAPTURE(total);
    CHECK(fit.shapes() <= static_cast<std::size_t>(total));
    CHECK(fit.gap_bound_m() == 0.0);
    CHECK(fit.excess_max_m() < before);
    before = fit.excess_max_m();
  }
}
