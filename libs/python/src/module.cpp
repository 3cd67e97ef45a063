#include "module.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::python {

namespace fs = std::filesystem;

namespace {

// Raises hamelin.Error, which is a class of the Python part: it splits the message into file, place
// and text.
void raise_error(const Error& error) {
  const py::object type = py::module_::import("hamelin._error").attr("Error");
  const py::object instance = type(std::string(error.what()), std::string(to_string(error.code())));
  PyErr_SetObject(type.ptr(), instance.ptr());
}

fs::path own_file() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&own_file), &info) == 0 || info.dli_fname == nullptr)
    return {};
  std::error_code ec;
  return fs::canonical(info.dli_fname, ec);
}

}  // namespace

fs::path prefix() {
  const fs::path file = own_file();
  std::error_code ec;
  for (fs::path at = file.parent_path(); at.has_relative_path(); at = at.parent_path())
    for (const char* folder : {"lib", HAMELIN_LIBDIR})
      if (fs::is_directory(at / folder / "hamelin" / "plugins", ec)) return at;
  throw Error(ErrorCode::io, fmt::format("{}: no folder above it has lib/hamelin/plugins, expected "
                                         "an installed or built hamelin",
                                         file.string()));
}

std::vector<fs::path> plugin_path(const std::vector<fs::path>& given) {
  const fs::path base = prefix();
  std::vector<fs::path> own{base / "lib" / "hamelin" / "plugins"};
  if (std::string_view(HAMELIN_LIBDIR) != "lib")
    own.push_back(base / HAMELIN_LIBDIR / "hamelin" / "plugins");
  return planning::plugin_directories(given, own);
}

}  // namespace hamelin::python

// NOLINTNEXTLINE: the macro defines the entry point of an extension module
PYBIND11_MODULE(_hamelin, module) {
  using namespace hamelin;
  namespace py = pybind11;
  module.doc() = "The extension module of hamelin; use the package hamelin.";
  // NOLINTNEXTLINE(performance-unnecessary-value-param): the signature is pybind11's
  py::register_local_exception_translator([](std::exception_ptr error) {
    try {
      if (error) std::rethrow_exception(error);
    } catch (const Error& e) {
      python::raise_error(e);
    } catch (const std::filesystem::filesystem_error& e) {
      python::raise_error(Error(ErrorCode::io, e.what()));
    } catch (const py::cast_error& e) {
      PyErr_SetString(PyExc_TypeError, e.what());
    }
  });
  module.attr("__version__") = std::string(version());
  module.def(
      "instruction_set", [] { return std::string(name_of(default_isa())); },
      "The instruction set of the numerical kernels: 'x86-64' ('generic' elsewhere), 'v3' or "
      "'v4'.\n\n"
      "The environment variable HAMELIN_ISA chooses another one before hamelin is imported.");
  module.def(
      "plugin_path",
      [] {
        py::list out;
        for (const auto& folder : python::plugin_path({})) out.append(folder.string());
        return out;
      },
      "The folders in which planners are searched for, in this order.");
  module.def(
      "_prefix", [] { return python::prefix().string(); },
      "The folder into which hamelin is installed or built.");
  if (const char* const name = std::getenv("HAMELIN_ISA"); name != nullptr && *name != '\0')
    set_default_isa(isa_from_name(name, "HAMELIN_ISA"));
  python::add_models(module);
  python::add_robot_files(module);
  python::add_integrators(module);
  python::add_events(module);
  python::add_scenes(module);
  python::add_runs(module);
  python::add_logs(module);
  python::add_accuracy(module);
  python::add_sweeps(module);
  python::add_motions(module);
  python::add_controllers(module);
  python::add_planners(module);
}
