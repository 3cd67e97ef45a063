#include "planner_object.hpp"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "arguments.hpp"

namespace hamelin::python {

namespace {

// Set by PlannerObjectScope; borrowed.
thread_local PyObject* planner_object = nullptr;

// The object of the scope, if the parameters ask for it; else a null object.
py::object given_object(const Json& params) {
  if (!params.value("object", false) || planner_object == nullptr) return {};
  return py::reinterpret_borrow<py::object>(planner_object);
}

// Executes the file as a module and returns its class.
py::object load_class(const Json& params) {
  const Json file = params.value("file", Json()), name = params.value("class", Json());
  if (!file.is_string() || !name.is_string())
    throw Error(ErrorCode::plugin,
                params.value("object", false)
                    ? "planner python: its object exists only in the Python program that made it; "
                      "expected hamelin.verify(log, planner=object) there"
                    : "planner python: expected params 'file' and 'class', or python:FILE:CLASS");
  return guarded(planner_name(params), [&]() -> py::object {
    return py::module_::import("hamelin._planner_files")
        .attr("load_class")(file.get<std::string>(), name.get<std::string>());
  });
}

// Whether Python can still be entered.
bool python_runs() noexcept {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsInitialized() != 0 && Py_IsFinalizing() == 0;
#else
  return Py_IsInitialized() != 0 && _Py_IsFinalizing() == 0;
#endif
}

// The class that influence_m() has loaded for create(), which follows on the same thread. If no
// create() follows, it is destroyed at the end of the thread, which does not hold Python's lock.
struct Loaded {
  Loaded(Json given, py::object of) : params(std::move(given)), type(std::move(of)) {}
  Loaded(const Loaded&) = delete;
  Loaded& operator=(const Loaded&) = delete;
  ~Loaded() {
    if (!python_runs()) {
      (void)type.release();  // Python's objects are gone or cannot be touched any more
      return;
    }
    const py::gil_scoped_acquire locked;
    type = py::object();
  }

  Json params;
  py::object type;
};
thread_local std::unique_ptr<Loaded> last_loaded;

py::object take_class(const Json& params) {
  if (last_loaded && last_loaded->params == params) {
    py::object type = last_loaded->type;
    last_loaded.reset();
    return type;
  }
  return load_class(params);
}

}  // namespace

PlannerObjectScope::PlannerObjectScope(py::handle object, scene::Scene& scene) {
  if (object.is_none()) return;
  if (!py::hasattr(object, "tick") || PyType_Check(object.ptr()) != 0)
    throw py::type_error(
        "planner: expected a name, or an object of a class with the method tick(tick, command)");
  const py::dict description =
      py::module_::import("hamelin._planner_files").attr("describe")(object);
  scene.planner = scene::Choice{"python", to_json(description)};
  use(py::reinterpret_borrow<py::object>(object));
}

PlannerObjectScope::PlannerObjectScope(const py::object& object) {
  if (!object.is_none()) use(py::module_::import("copy").attr("copy")(object));
}

void PlannerObjectScope::use(py::object object) {
  object_ = std::move(object);
  before_ = planner_object;
  planner_object = object_.ptr();
  set_ = true;
}

PlannerObjectScope::~PlannerObjectScope() {
  if (set_) planner_object = before_;
}

py::object make_planner_object(const Json& params) {
  if (py::object given = given_object(params)) return given;
  const py::object type = take_class(params);
  return guarded(planner_name(params), [&]() -> py::object {
    Json given = params.value("params", Json::object());
    if (py::hasattr(type, "params_schema")) {
      const Json wanted = to_json(type.attr("params_schema"));
      check_schema(given, wanted, planner_name(params) + ": params");
      given = with_defaults(given, wanted);
    }
    return type(**to_python(given).cast<py::dict>());
  });
}

double planner_influence_m(const Json& params) {
  py::object source = given_object(params);
  if (!source) {
    source = load_class(params);
    last_loaded = std::make_unique<Loaded>(params, source);
  }
  return guarded(planner_name(params), [&] {
    return py::hasattr(source, "influence_m") ? source.attr("influence_m").cast<double>() : -1.0;
  });
}

std::string planner_name(const Json& params) {
  const Json file = params.value("file", Json()), type = params.value("class", Json());
  return fmt::format("planner python:{}:{}", file.is_string() ? file.get<std::string>() : "",
                     type.is_string() ? type.get<std::string>() : "");
}

std::string describe(py::error_already_set& error) {
  std::string text =
      fmt::format("{}: {}", py::str(error.type().attr("__name__")).cast<std::string>(),
                  py::str(error.value()).cast<std::string>());
  py::object trace = error.trace() ? py::object(error.trace()) : py::object(py::none());
  if (trace.is_none()) return text;
  while (!trace.attr("tb_next").is_none()) trace = trace.attr("tb_next");
  return fmt::format(
      "{} ({}, line {})", text,
      py::str(trace.attr("tb_frame").attr("f_code").attr("co_filename")).cast<std::string>(),
      py::str(trace.attr("tb_lineno")).cast<std::string>());
}

}  // namespace hamelin::python
