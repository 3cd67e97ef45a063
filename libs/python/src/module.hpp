#pragma once
#include <pybind11/pybind11.h>

#include <filesystem>
#include <vector>

/// The parts of the extension module `hamelin._hamelin`.
namespace hamelin::python {

namespace py = pybind11;

void add_models(py::module_& module);
void add_robot_files(py::module_& module);
void add_integrators(py::module_& module);
void add_events(py::module_& module);
void add_scenes(py::module_& module);
void add_runs(py::module_& module);
void add_logs(py::module_& module);
void add_accuracy(py::module_& module);
void add_sweeps(py::module_& module);
void add_motions(py::module_& module);
void add_controllers(py::module_& module);
void add_planners(py::module_& module);

/// The folder into which hamelin is installed or built, found from the module's own file: the
/// nearest folder above it that has planners. @throws Error io if there is none
[[nodiscard]] std::filesystem::path prefix();
/// Where planners are searched for: the given folders, HAMELIN_PLUGIN_PATH, those of prefix().
[[nodiscard]] std::vector<std::filesystem::path> plugin_path(
    const std::vector<std::filesystem::path>& given);

}  // namespace hamelin::python
