// Wrenches of a scene on the arm.
#include <catch2/catch.hpp>
#include <filesystem>

#include "../scratch_scene.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;

namespace {

// A free arm that holds its place, and is pushed.
Json pushed(const Json& wrenches) {
  return {{"schema", "hamelin.scene/1"},
          {"robot", {{"file", HAMELIN_SOURCE_DIR "/data/robots/arm7.urdf"}}},
          {"start", {{"q", {0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785}}}},
          {"wrenches", wrenches},
          {"duration_s", 0.3}};
}

scene::Scene push_scene(const Json& document) {
  return scene::scene_from_json(document, ".", "push.json");
}

log::Result integrated(const Json& wrenches, const std::string& integrator) {
  Json document = pushed(wrenches);
  document["integrator"] = {{"name", integrator}};
  const scene::Scene scene = push_scene(document);
  const model::Model model = control::load_model(scene);
  return simulation::integrate(model, simulation::free_motion(scene, model), {});
}

const Json push{{"frame", "link4"}, {"force_N", {0, 20, 5}}, {"from_s", 0.1}, {"to_s", 0.2}};

}  // namespace

TEST_CASE("the work of pushes in a scene closes the account of energy", "[simulation][wrenches]") {
  const log::Result free = integrated(Json::array(), "gauss:8"),
                    result = integrated(Json::array({push}), "gauss:8");
  CHECK(free.external_work_J == 0.0);
  CHECK(std::abs(result.external_work_J) > 1e-3);
  CHECK(result.energy_error_max_J <= 1e-11);
  CHECK((result.q - free.q).norm() > 1e-3);
  CHECK(std::abs(result.energy_final_J - free.energy_final_J - result.external_work_J) <= 1e-9);
}

TEST_CASE("a push of no length in another frame is refused, and one line says where",
          "[simulation][wrenches]") {
  const auto message = [](const Json& wrench) {
    return test::error_of([&] { (void)integrated(Json::array({wrench}), "gauss:8"); });
  };
  Json wrong = push;
  wrong["frame"] = "link44";
  CHECK_THAT(message(wrong), Catch::Contains("push.json: /wrenches/0/frame: ") &&
                                 Catch::Contains("no frame 'link44', expected one of ") &&
                                 Catch::Contains("; did you mean 'link4'?"));
  wrong = push;
  wrong["to_s"] = 0.1;
  CHECK_THAT(message(wrong),
             Catch::Contains("/wrenches/0/to_s: is 0.1, expected more than from_s"));
  CHECK_THAT(message(Json{{"frame", "link4"}}),
             Catch::Contains("/wrenches/0/force_N: is missing, expected force_N, moment_Nm"));
  wrong = push;
  wrong["reference"] = "body";
  CHECK_THAT(message(wrong), Catch::Contains("/wrenches/0/reference"));
}

TEST_CASE("a scene with wrenches is written out and read again", "[scene][wrenches]") {
  Json other = push;
  other["reference"] = "local";
  other["moment_Nm"] = {1, 2, 3};
  const Json resolved = scene::resolved_json(push_scene(pushed(Json::array({push, other}))));
  CHECK(scene::resolved_json(push_scene(resolved)) == resolved);
  CHECK(resolved["wrenches"][1]["reference"] == "local");
  CHECK(resolved["wrenches"][0]["to_s"] == 0.2);
}

TEST_CASE("a pushed arm gets to its goals, and the push is in log and result",
          "[simulation][wrenches]") {
  const auto folder = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes";
  const std::string plant = GENERATE("ideal", "sampled");
  Json document = read_json(folder / "shelf.json");
  document["actuation"] = {{"type", plant}};
  document["wrenches"] = {{{"force_N", {0, 10, 0}}, {"from_s", 0.5}, {"to_s", 0.6}}};
  const auto file = test::temporary("push_" + plant + ".jsonl");
  simulation::Watch watch;
  log::RunLog log(file);
  watch.log = &log;
  const log::Result result = simulation::run(
      scene::scene_from_json(document, folder, "shelf_push.json"), test::plugin_directories, watch);
  log.flush();
  CAPTURE(plant, result.cause);
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.min_clearance_m.value() > 0.0);
  CHECK(std::abs(result.external_work_J) > 1e-3);
  const std::string text = read_file(file);
  CHECK(text.find("the arm is pushed: 'flange' by 10 N") != std::string::npos);
  CHECK(text.find("nothing pushes the arm any more") != std::string::npos);
}
