#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

/// A planner given as "python:FILE:CLASS": the planner `python` with these parameters.
struct PythonPlanner {
  std::string file, class_name;
  [[nodiscard]] std::string text() const { return "python:" + file + ":" + class_name; }
};
/// None for the name of any other planner.
/// @param option what the caller calls the planner, for messages
/// @throws Error usage if file or class are missing
[[nodiscard]] std::optional<PythonPlanner> python_planner(const std::string& planner,
                                                          std::string_view option);

/// Values that replace those of a scene file, as the options of `hamelin run` do.
struct Overrides {
  /// A name, or "python:FILE:CLASS".
  std::optional<std::string> planner;
  std::optional<std::string> guide, integrator, plant;
  std::optional<double> step_s, duration_s;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> set;  ///< "/json/pointer=VALUE", applied last
};

/// Writes them into a scene's document, whose checks then cover them. The parameters of the scene's
/// planner and integrator stay if these stay. A document that is no object stays as it is.
/// @param planner_option what the caller calls the planner, for messages
/// @throws Error usage for a "python:" planner that is incomplete, and as set_pointer() does
void apply(const Overrides& overrides, std::string_view planner_option, Json& document);

/// Lets the last goal follow the stream of targets of a file.
/// @param option what the caller calls the file, for messages
/// @throws Error usage if the last goal does not follow a streamed target
void set_target_file(Scene& scene, const std::filesystem::path& file, std::string_view option);

}  // namespace hamelin::scene
