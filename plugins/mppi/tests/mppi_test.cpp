#include <catch2/catch.hpp>

#include "hamelin/test/arm_loop.hpp"

using namespace hamelin;

namespace {
const std::string plugin_file = HAMELIN_TEST_PLUGIN_DIR "/mppi.hamelin.so";
}

TEST_CASE("the mppi reaches a free goal under gravity", "[mppi]") {
  test::ArmLoop loop(plugin_file, Json::object(), test::planar4(), {2.0, 3.0, 0.0}, {},
                     {0.0, -9.81, 0.0});
  CHECK(loop.run(40.0).reached);
}

TEST_CASE("the mppi reaches a joint goal under gravity", "[mppi]") {
  const Eigen::Vector4d to(0.4, 0.3, -0.2, 0.5);
  test::ArmLoop loop(plugin_file, Json::object(), test::planar4(), Eigen::Vector3d::Constant(9.0),
                     {}, {0.0, -9.81, 0.0}, to);
  (void)loop.run(60.0);
  CHECK((loop.q - to).norm() < 0.01);
  CHECK(loop.v.norm() < 0.01);
}
