#pragma once
#include <pybind11/pybind11.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bound_model.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::python {

namespace py = pybind11;

/// Values that replace those of a scene file, as the options of `hamelin run` do.
struct SceneOverrides {
  std::optional<std::string> planner, guide, integrator, plant;
  std::optional<double> step_s, duration_s;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> set;  ///< "/json/pointer=VALUE"
};

/// "python:FILE:CLASS" as the entry of a scene: the planner `python` with its parameters. Any other
/// text is a planner's name.
[[nodiscard]] Json planner_entry(const std::string& name);

/// Applies them to a scene's document.
void apply_overrides(const SceneOverrides& overrides, Json& document);

/// hamelin.Scene: the document of a scene, and what was read from it.
struct BoundScene : Whole {
  BoundScene(Json given, std::filesystem::path base_dir, std::string where);
  /// The model of its robot with payload and armature; made once.
  [[nodiscard]] const SharedModel& model();

  Json document;
  std::filesystem::path folder;
  std::string name;
  scene::Scene scene;

 private:
  SharedModel model_;
};

using SharedScene = std::shared_ptr<BoundScene>;

[[nodiscard]] SharedScene read_scene(const std::filesystem::path& file,
                                     const SceneOverrides& overrides);
/// A Scene, a document as a dict, or the path of a file.
[[nodiscard]] SharedScene scene_of(py::handle given, const SceneOverrides& overrides);

}  // namespace hamelin::python
