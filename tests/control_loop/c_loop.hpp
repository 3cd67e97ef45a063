#pragma once
#include <array>
#include <catch2/catch.hpp>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/control/hamelin_control.h"
#include "hamelin/core/text.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/temporary.hpp"
#include "loop.hpp"

namespace hamelin::test {

inline const std::array<const char*, 2> c_plugins{HAMELIN_TEST_PLUGIN_DIR,
                                                  HAMELIN_TEST_ONLY_PLUGIN_DIR};

/// The scene clutter.json with one torque per millisecond, for any folder, without searched paths.
inline Json c_document(const std::string& planner, const Json& params = Json::object()) {
  Json document = parse_json(read_file(data_folder / "scenes/clutter.json"), "clutter.json");
  document["robot"]["file"] = (data_folder / "robots/arm7.urdf").string();
  document["robot"]["spheres"] = (data_folder / "robots/arm7.spheres.json").string();
  document["map"]["file"] = (data_folder / "maps/clutter.bt").string();
  document["planner"] = {{"name", planner}, {"params", params}, {"guide", "none"}};
  document["actuation"] = {{"type", "sampled"}, {"control_period_s", 0.001}, {"deadline_s", 0.001}};
  return document;
}

struct CLogLine {
  std::int32_t level;
  std::string text;
};

/// A controller that is called through the C interface, and an arm that it moves: a simulated one
/// by torque, or servos that follow their set points exactly.
struct CLoop {
  using Change = std::function<void(hamelin_controller_options&)>;

  /// @param change of the options, before the controller is made
  explicit CLoop(const Json& document, const Change& change = {}) {
    write_file_atomically(folder.path() / "scene.json", document.dump());
    const std::string file = (folder.path() / "scene.json").string();
    scene = scene::read_scene(file);
    hamelin_controller_options options{};
    options.struct_size = sizeof options;
    options.scene_file = file.c_str();
    options.plugin_directories = c_plugins.data();
    options.plugin_directory_count = c_plugins.size();
    options.log = [](void* context, std::int32_t level, const char* text, std::size_t size) {
      static_cast<CLoop*>(context)->lines.push_back({level, std::string(text, size)});
    };
    options.log_context = this;
    if (change) change(options);
    controller = hamelin_controller_create(&options, error.data(), error.size());
    INFO(error.data());
    REQUIRE(controller != nullptr);
    answer.struct_size = sizeof answer;
    model.emplace(control::load_model(scene));
    integrator = integration::make_integrator("hamel-variational", *model);
    v = Eigen::VectorXd::Zero(model->dof());
    state = integrator->start(scene.start_q, v);
  }
  CLoop(const CLoop&) = delete;
  CLoop& operator=(const CLoop&) = delete;
  ~CLoop() { hamelin_controller_destroy(controller); }

  std::int32_t tick() {
    return hamelin_controller_tick(controller, state.time_s, state.q.data(), v.data(), &answer);
  }
  /// One period with the torque of the answer.
  void step() {
    channels.held_torque = Eigen::VectorXd::Map(answer.torque, v.size());
    REQUIRE(integrator->step(state, channels, 0.001).converged);
    integrator->velocity(state, v);
  }
  /// One period of servos that follow their set points exactly.
  void follow() {
    state.q = Eigen::VectorXd::Map(answer.q_next, v.size());
    v = Eigen::VectorXd::Map(answer.v_next, v.size());
    state.time_s = 0.001 * static_cast<double>(++state.k);
  }
  void move(int ticks) {
    for (int k = 0; k < ticks; ++k) {
      REQUIRE(tick() == 0);
      step();
    }
  }
  /// Moves the arm by torque or by position until all goals are reached.
  /// @return whether they were within 20 s
  bool arrives(bool by_position = false) {
    for (int k = 0; k < 20000; ++k) {
      REQUIRE(tick() == 0);
      REQUIRE(answer.clearance_m > 0.0);
      if (answer.state == HAMELIN_CONTROL_REACHED) return true;
      by_position ? follow() : step();
    }
    return false;
  }

  /// Requires that a call succeeded.
  void require(std::int32_t result) const {
    INFO(error.data());
    REQUIRE(result == 0);
  }
  /// The message of a call that must have failed: one line.
  std::string failure(std::int32_t result) {
    CHECK(result == 1);
    std::string message = error.data();
    CHECK_FALSE(message.empty());
    CHECK(one_line(message) == message);
    error.fill('\0');
    return message;
  }

  TemporaryFolder folder;
  scene::Scene scene;
  std::optional<model::Model> model;
  std::unique_ptr<integration::Integrator> integrator;
  integration::State state;
  integration::Channels channels;
  Eigen::VectorXd v;
  hamelin_controller* controller = nullptr;
  hamelin_answer answer{};
  std::array<char, 512> error{};
  std::vector<CLogLine> lines;
};

/// The message with which hamelin_controller_create refuses options; "made" if it does not.
inline std::string creation_failure(const Json& document, const CLoop::Change& change) {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "scene.json").string();
  write_file_atomically(file, document.dump());
  hamelin_controller_options options{};
  options.struct_size = sizeof options;
  options.scene_file = file.c_str();
  options.plugin_directories = c_plugins.data();
  options.plugin_directory_count = c_plugins.size();
  change(options);
  std::array<char, 512> error{};
  hamelin_controller* const made = hamelin_controller_create(&options, error.data(), error.size());
  hamelin_controller_destroy(made);
  const std::string message = error.data();
  CHECK((made == nullptr) == !message.empty());
  CHECK(one_line(message) == message);
  return made != nullptr ? "made" : message;
}

}  // namespace hamelin::test
