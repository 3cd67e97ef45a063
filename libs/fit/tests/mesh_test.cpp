#include "hamelin/fit/mesh.hpp"

#include <catch2/catch.hpp>
#include <limits>

#include "hamelin/core/error.hpp"
#include "hamelin/fit/solid.hpp"
#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;
using Eigen::Vector3d;

namespace {

std::array<Vector3d, 2> bounds(const Mesh& mesh) {
  std::array<Vector3d, 2> out{mesh.vertices.front(), mesh.vertices.front()};
  for (const auto& t : mesh.triangles)
    for (const std::int32_t i : t) {
      out[0] = out[0].cwiseMin(mesh.vertices[static_cast<std::size_t>(i)]);
      out[1] = out[1].cwiseMax(mesh.vertices[static_cast<std::size_t>(i)]);
    }
  return out;
}

std::string mesh_error(const std::filesystem::path& file) {
  try {
    (void)load_mesh(file, Vector3d::Ones());
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("binary STL, ASCII STL and OBJ read back as the box that was written, scaled",
          "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const Mesh box = test::boxes({{Vector3d(-0.1, 0.0, 0.2), Vector3d(0.3, 0.5, 0.25)}});
  const std::vector<std::filesystem::path> files = {scratch.put("b.stl", test::binary_stl(box)),
                                                    scratch.put("a.stl", test::ascii_stl(box)),
                                                    scratch.put("o.obj", test::obj(box))};
  for (const auto& file : files) {
    CAPTURE(file.string());
    const Mesh read = load_mesh(file, Vector3d(2.0, 1.0, -10.0));
    CHECK(read.triangles.size() == 12);
    const auto [low, high] = bounds(read);
    CHECK((low - Vector3d(-0.2, 0.0, -2.5)).norm() < 1e-6);
    CHECK((high - Vector3d(0.6, 0.5, -2.0)).norm() < 1e-6);
  }
}

TEST_CASE("the unit of a COLLADA file is applied and its up-axis is ignored", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  const auto file = scratch.put("t.dae", R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit name="millimeter" meter="0.001"/><up_axis>Y_UP</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 200 300</float_array>
   <technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
   <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
 </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>)");
  const auto [low, high] = bounds(load_mesh(file, Vector3d::Ones()));
  CHECK(low.norm() < 1e-7);
  CHECK((high - Vector3d(0.1, 0.2, 0.3)).norm() < 1e-7);
}

TEST_CASE("files without a mesh are refused in one line that names them", "[fit][unit]") {
  const test::TemporaryFolder scratch;
  Mesh bad = test::boxes({{Vector3d(0.0, 0.0, 0.0), Vector3d(0.1, 0.1, 0.1)}});
  CHECK_THAT(mesh_error(scratch.path() / "absent.stl"),
             Catch::Contains("absent.stl") && Catch::Contains("cannot be read"));
  CHECK_THAT(mesh_error(scratch.put("junk.stl", "this is no mesh")),
             Catch::Contains("junk.stl: not a mesh"));
  CHECK_THAT(mesh_error(scratch.put("empty.obj", "")), Catch::Contains("empty.obj: not a mesh"));
  CHECK_THAT(mesh_error(scratch.put("kind.xyzzy", "1")), Catch::Contains("kind.xyzzy: not a mesh"));
  bad.vertices[3].y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THAT(mesh_error(scratch.put("nan.stl", test::binary_stl(bad))),
             Catch::Contains("nan.stl") && Catch::Contains("finite"));
  bad.vertices[3].y() = std::numeric_limits<double>::infinity();
  CHECK_THAT(mesh_error(scratch.put("inf.stl", test::binary_stl(bad))),
             Catch::Contains("inf.stl") && Catch::Contains("finite"));
  const std::string whole = test::binary_stl(test::ball(0.1, 8));
  CHECK_THAT(mesh_error(scratch.put("cut.stl", whole.substr(0, whole.size() / 2))),
             Catch::Contains("cut.stl: not a mesh"));
}

TEST_CASE("the meshes of primitives enclose them and stay within the facet error", "[fit][unit]") {
  const double radius = 0.07, length = 0.4;
  const Mesh cylinder = cylinder_mesh(radius, length), sphere = ball_mesh({0.1, 0.2, 0.3}, radius);
  for (const Vector3d& p : test::random_points(cylinder, 20'000, 1)) {
    const double out = std::max(std::hypot(p.x(), p.y()) - radius, std::abs(p.z()) - 0.5 * length);
    REQUIRE(out >= -1e-12);
    REQUIRE(out <= facet_error_m + 1e-12);
  }
  for (const Vector3d& p : test::random_points(sphere, 20'000, 2)) {
    const double out = (p - Vector3d(0.1, 0.2, 0.3)).norm() - radius;
    REQUIRE(out >= -1e-12);
    REQUIRE(out <= 4.0 * facet_error_m);
  }
  for (const Mesh& mesh : {cylinder, sphere, box_mesh({0.1, 0.2, 0.3})})
    CHECK(Solid(mesh, 8000).closed());
}
