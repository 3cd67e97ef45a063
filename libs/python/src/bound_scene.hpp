#pragma once
#include <pybind11/pybind11.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bound_model.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/overrides.hpp"

namespace hamelin::python {

namespace py = pybind11;

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
                                     const scene::Overrides& overrides);
/// Values that replace those of a scene, as Python gives them. @throws Error usage
[[nodiscard]] scene::Overrides checked_overrides(const py::dict& given);
/// A Scene, a document as a dict, or the path of a file.
[[nodiscard]] SharedScene scene_of(py::handle given, const scene::Overrides& overrides);

}  // namespace hamelin::python
