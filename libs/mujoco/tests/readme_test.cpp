#include <catch2/catch.hpp>

#include "hamelin/mujoco/plant.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/readme.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;

TEST_CASE("the README's example reaches the goals of the clutter in MuJoCo", "[mujoco]") {
  const auto file = test::data / "scenes" / "clutter.json";
  const std::vector<std::filesystem::path> plugin_directories{HAMELIN_TEST_PLUGIN_DIR};
  // clang-format off
  // [example]
scene::Scene scene = scene::read_scene(file);
scene.plant = scene::PlantType::mujoco;
scene.actuation.type = scene::ActuationType::sampled;  // MuJoCo takes torques
const log::Result result =
    simulation::run(scene, plugin_directories, {}, hamelin::mujoco::make_plant);
const long contacts = result.plant->contacts;  // by MuJoCo's own collision detection
  // [example]
  // clang-format on
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(contacts == 0);
  test::check_readme_example("libs/mujoco");
}
