#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <array>
#include <cstring>
#include <memory>
#include <thread>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/planning/plugin.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#include "planner_object.hpp"
#include "whole.hpp"

namespace hamelin::python {

using planning::Command;
using planning::Host;
using planning::Query;
using planning::Setup;
using planning::Tick;

// A contact of a tick as an element of an array of numpy.
struct TickContactRow {
  std::int32_t shape, link, obstacle;
  double distance_m;
  double arm_point_m[3], obstacle_point_m[3], direction[3], obstacle_velocity_m_s[3];
};

struct TickSelfContactRow {
  std::int32_t shape_a, shape_b;
  double distance_m;
  double point_a_m[3], point_b_m[3], direction[3];
};

namespace {

// Set by PlannerObjectScope; borrowed.
thread_local PyObject* planner_object = nullptr;

// "ValueError: text (mine.py, line 12)" of an exception.
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

// Calls f with Python's lock; an exception of Python becomes an Error.
template <class F>
auto guarded(const std::string& where, const F& f) {
  const py::gil_scoped_acquire locked;
  try {
    return f();
  } catch (py::error_already_set& error) {
    throw Error(ErrorCode::plugin, fmt::format("{}: {}", where, describe(error)));
  } catch (const py::cast_error& error) {
    throw Error(ErrorCode::plugin, fmt::format("{}: {}", where, error.what()));
  } catch (const py::builtin_exception& error) {
    throw Error(ErrorCode::plugin, fmt::format("{}: {}", where, error.what()));
  }
}

std::string name_of(const Json& params) {
  const Json file = params.value("file", Json()), type = params.value("class", Json());
  return fmt::format("planner python:{}:{}", file.is_string() ? file.get<std::string>() : "",
                     type.is_string() ? type.get<std::string>() : "");
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
  return guarded(name_of(params), [&]() -> py::object {
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
  Loaded(Json params_, py::object type_) : params(std::move(params_)), type(std::move(type_)) {}
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

py::object make_object(const Json& params) {
  if (params.value("object", false) && planner_object != nullptr)
    return py::reinterpret_borrow<py::object>(planner_object);
  const py::object type = take_class(params);
  return guarded(name_of(params), [&]() -> py::object {
    Json given = params.value("params", Json::object());
    if (py::hasattr(type, "params_schema")) {
      const Json wanted = to_json(type.attr("params_schema"));
      check_schema(given, wanted, name_of(params) + ": params");
      given = with_defaults(given, wanted);
    }
    return type(**to_python(given).cast<py::dict>());
  });
}

// A view of a struct that is valid during one call of the planner.
template <class T>
class DuringCall {
 public:
  void set(T* value) noexcept { value_ = value; }
  [[nodiscard]] T& get(const char* what) const {
    if (value_ == nullptr)
      throw Error(ErrorCode::usage,
                  fmt::format("{}: used after the call that it was passed to; keep copies of its "
                              "values instead",
                              what));
    return *value_;
  }

 private:
  T* value_ = nullptr;
};

void copy3(const double (&from)[3], double (&to)[3]) {
  std::memcpy(to, from, sizeof to);
}

py::array_t<double> array3(const double (&x)[3]) {
  return to_array(Eigen::Vector3d(x[0], x[1], x[2]));
}

py::array_t<double> numbers_at(const double* x, std::size_t n) {
  return to_array(
      Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(x, static_cast<Eigen::Index>(n))));
}

// A goal as a dict.
py::dict goal_dict(const hamelin_goal& goal, std::size_t dof) {
  static constexpr std::array<const char*, 4> types{"joint", "position", "pose", "follow"};
  py::dict out;
  const auto type = static_cast<std::size_t>(goal.type);
  out["type"] = type < types.size() ? types[type] : "unknown";
  out["tolerance_m"] = goal.tolerance_m;
  out["tolerance_rad"] = goal.tolerance_rad;
  out["speed_max"] = goal.speed_max;
  if (goal.path_points > 0) {
    auto path =
        new_array({static_cast<py::ssize_t>(goal.path_points), static_cast<py::ssize_t>(dof)});
    std::memcpy(path.mutable_data(), goal.path, sizeof(double) * goal.path_points * dof);
    out["path"] = path;
    if (goal.path_margin_m > 0.0) out["path_margin_m"] = goal.path_margin_m;
  }
  static constexpr std::array<const char*, 4> searches{"not sought", "sought", "found",
                                                       "not found"};
  if (const auto search = static_cast<std::size_t>(goal.path_search); search < searches.size())
    out["path_search"] = searches[search];
  if (goal.q != nullptr) {
    out["q"] = numbers_at(goal.q, dof);
  } else {
    out["position_m"] = array3(goal.position_world_m);
    out["quaternion_wxyz"] = numbers_at(&goal.quaternion_wxyz[0], 4);
    out["velocity_m_s"] = array3(goal.velocity_world_m_s);
    out["angular_velocity_rad_s"] = array3(goal.angular_velocity_world_rad_s);
  }
  return out;
}

// hamelin.Tick
struct PyTick : Whole {
  DuringCall<const Tick> tick;
  std::size_t dof = 0;
  std::vector<std::int32_t> links;  // of the shapes
  py::array_t<double> q, v;

  [[nodiscard]] const Tick& get() const { return tick.get("Tick"); }
};

py::array_t<TickContactRow> tick_contacts(const PyTick& t) {
  const auto contacts = t.get().contacts();
  py::array_t<TickContactRow> out(static_cast<py::ssize_t>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const hamelin_contact& from = contacts[i];
    TickContactRow& row = out.mutable_data()[i];
    row.shape = from.shape;
    row.link = t.links.at(static_cast<std::size_t>(from.shape));
    row.obstacle = from.obstacle;
    row.distance_m = from.distance_m;
    copy3(from.arm_point_world_m, row.arm_point_m);
    copy3(from.obstacle_point_world_m, row.obstacle_point_m);
    copy3(from.direction_world, row.direction);
    copy3(from.obstacle_velocity_world_m_s, row.obstacle_velocity_m_s);
  }
  return out;
}

py::array_t<TickSelfContactRow> tick_self_contacts(const PyTick& t) {
  const auto contacts = t.get().self_contacts();
  py::array_t<TickSelfContactRow> out(static_cast<py::ssize_t>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const hamelin_self_contact& from = contacts[i];
    TickSelfContactRow& row = out.mutable_data()[i];
    row.shape_a = from.shape_a;
    row.shape_b = from.shape_b;
    row.distance_m = from.distance_m;
    copy3(from.point_a_world_m, row.point_a_m);
    copy3(from.point_b_world_m, row.point_b_m);
    copy3(from.direction_world, row.direction);
  }
  return out;
}

py::object tick_reference(const PyTick& t) {
  const auto reference = t.get().reference();
  if (!reference) return py::none();
  py::dict out;
  out["q"] = to_array(Eigen::VectorXd(reference->q));
  out["v"] = to_array(Eigen::VectorXd(reference->v));
  out["a"] = to_array(Eigen::VectorXd(reference->a));
  out["time_s"] = reference->time_s;
  out["rate"] = reference->rate;
  return out;
}

py::object array_or_none(const std::optional<planning::ConstVectorMap>& values) {
  if (!values) return py::none();
  return to_array(Eigen::VectorXd(*values));
}

// hamelin.Command: arrays that a planner writes, copied to the host after its tick.
struct PyCommand : Whole {
  DuringCall<Command> command;
  py::array_t<double> potential_gradient, damping, held_torque;
  std::optional<Eigen::VectorXd> node_velocity;

  void clear() {
    for (auto* array : {&potential_gradient, &damping, &held_torque})
      std::memset(array->mutable_data(), 0,
                  sizeof(double) * static_cast<std::size_t>(array->size()));
    node_velocity.reset();
  }
  [[nodiscard]] Command& get() const { return command.get("Command"); }
  // The numbers of an array of the planner's own, which it may have replaced in place.
  static void copy(const char* name, const py::array_t<double>& from, double* to, std::size_t dof) {
    if (from.size() != static_cast<py::ssize_t>(dof))
      refuse("Command", name, fmt::format("{} numbers, expected {}", from.size(), dof));
    std::memcpy(to, from.data(), sizeof(double) * dof);
  }
};

void assign(py::array_t<double>& to, const char* name, py::handle from) {
  const Eigen::VectorXd x = python::vector_of("Command", name, from, to.size());
  std::memcpy(to.mutable_data(), x.data(), sizeof(double) * static_cast<std::size_t>(x.size()));
}

// hamelin.PlannerSetup: what is fixed for a run, and the services of the host.
struct PySetup : Whole {
  const Host* host = nullptr;  // during a call of the planner
  std::thread::id thread;      // of that call
  DuringCall<Query> query;
  SharedModel model;
  py::dict facts;
  bool starting = false;  // during start()

  // Services of the host, which belong to the thread of the planner's calls.
  [[nodiscard]] const Host& services() const {
    if (host == nullptr || thread != std::this_thread::get_id())
      throw Error(
          ErrorCode::usage,
          "PlannerSetup: log(), warn(), declare_series(), draw_path() and request_path() are "
          "used outside of the planner's calls, expected in start() or tick()");
    return *host;
  }
};

py::object setup_clearance(PySetup& s, py::handle q, double time_ahead, double at_least) {
  const Numbers numbers("clearance", "q", q);
  const py::ssize_t dof = s.model->model.dof();
  const bool single = numbers.dimensions() == 1;
  if (single)
    numbers.require_vector(dof);
  else
    numbers.require_rows(dof);
  if (!numbers.vector().allFinite()) refuse("clearance", "q", "is not finite");
  const py::ssize_t count = single ? 1 : numbers.extent(0);
  auto out = new_array({count});
  s.query.get("PlannerSetup")
      .clearance({numbers.data(), static_cast<std::size_t>(numbers.size())}, time_ahead, at_least,
                 {out.mutable_data(), static_cast<std::size_t>(count)});
  return number_or_array(single, out);
}

bool setup_motion_clear(PySetup& s, py::handle q0, py::handle q1) {
  const py::ssize_t dof = s.model->model.dof();
  const Eigen::VectorXd a = python::vector_of("motion_clear", "q0", q0, dof);
  const Eigen::VectorXd b = python::vector_of("motion_clear", "q1", q1, dof);
  if (!a.allFinite() || !b.allFinite()) refuse("motion_clear", "q0, q1", "are not finite");
  const auto size = static_cast<std::size_t>(dof);
  return s.query.get("PlannerSetup").motion_clear({a.data(), size}, {b.data(), size});
}

py::object setup_distance(PySetup& s, py::handle points, double time_ahead, double limit) {
  const Numbers numbers("distance", "points", points);
  const bool single = numbers.dimensions() == 1;
  if (single)
    numbers.require_vector(3);
  else
    numbers.require_rows(3);
  if (!numbers.vector().allFinite()) refuse("distance", "points", "is not finite");
  const py::ssize_t count = single ? 1 : numbers.extent(0);
  auto out = new_array({count});
  for (py::ssize_t i = 0; i < count; ++i)
    out.mutable_data()[i] =
        s.query.get("PlannerSetup")
            .distance(Eigen::Map<const Eigen::Vector3d>(numbers.data() + 3 * i), time_ahead, limit);
  return number_or_array(single, out);
}

void setup_draw_path(PySetup& s, py::handle points) {
  const Numbers numbers("draw_path", "points", points);
  numbers.require_rows(3);
  std::vector<Eigen::Vector3d> path;
  for (py::ssize_t i = 0; i < numbers.extent(0); ++i)
    path.emplace_back(Eigen::Map<const Eigen::Vector3d>(numbers.data() + 3 * i));
  s.services().draw_path(path);
}

py::object optional_limit(const std::optional<planning::ConstVectorMap>& limit) {
  if (!limit) return py::none();
  return to_array(Eigen::VectorXd(*limit));
}

py::dict facts_of(const Setup& setup) {
  py::dict out;
  out["dof"] = setup.dof();
  out["q_lower"] = optional_limit(setup.q_lower());
  out["q_upper"] = optional_limit(setup.q_upper());
  out["velocity_max"] = optional_limit(setup.velocity_max());
  out["effort_max"] = optional_limit(setup.effort_max());
  out["effort_rate_max"] = optional_limit(setup.effort_rate_max());
  out["control_period_s"] = setup.control_period_s();
  out["deadline_s"] = setup.deadline_s();
  out["delay_s"] = setup.delay_s();
  out["sampled"] = setup.sampled();
  out["self_collision"] = setup.self_collision();
  out["influence_m"] = setup.influence_m();
  out["map_resolution_m"] = setup.map_resolution_m();
  out["shield_margin_m"] = setup.shield_margin_m();
  out["seed"] = setup.seed();
  py::list goals;
  for (const auto& goal : setup.goals())
    goals.append(goal_dict(goal, static_cast<std::size_t>(setup.dof())));
  out["goals"] = goals;
  return out;
}

// The planner `python`: calls an object of Python, with Python's lock. What it passes to the object
// lives as long as Python keeps it; after the planner is gone, using it raises hamelin.Error.
class PythonPlanner final : public planning::Planner {
 public:
  static constexpr std::uint32_t properties = HAMELIN_TICK_ALLOCATES | HAMELIN_FOLLOWS_TARGETS |
                                              HAMELIN_FOLLOWS_PATHS | HAMELIN_FOLLOWS_TRAJECTORIES |
                                              HAMELIN_ASKS_FOR_PATHS;

  PythonPlanner(const Host& host, const Setup& setup, const Json& params)
      : host_(host), query_(host), dof_(static_cast<std::size_t>(setup.dof())) {
    const py::gil_scoped_acquire locked;
    python_ = std::make_unique<Python>();
    try {
      start(setup, params);
    } catch (...) {
      disconnect();
      throw;
    }
  }
  ~PythonPlanner() override {
    const py::gil_scoped_acquire locked;
    disconnect();
  }

  static double influence_m(const Json& params) {
    const py::gil_scoped_acquire locked;
    py::object source;
    if (params.value("object", false) && planner_object != nullptr) {
      source = py::reinterpret_borrow<py::object>(planner_object);
    } else {
      source = load_class(params);
      last_loaded = std::make_unique<Loaded>(params, source);
    }
    return guarded(name_of(params), [&] {
      return py::hasattr(source, "influence_m") ? source.attr("influence_m").cast<double>() : -1.0;
    });
  }

  void tick(const Tick& tick, Command& command) override {
    const py::gil_scoped_acquire locked;
    PyTick& t = *python_->tick;
    PyCommand& c = *python_->command;
    std::memcpy(const_cast<double*>(t.q.data()), tick.q().data(), sizeof(double) * dof_);
    std::memcpy(const_cast<double*>(t.v.data()), tick.v().data(), sizeof(double) * dof_);
    c.clear();
    const DuringTick during(t, tick, c, command, *python_->setup, host_);
    try {
      python_->method(python_->tick_object, python_->command_object);
    } catch (py::error_already_set& error) {
      InterruptCheck* const interrupts = InterruptScope::current();
      if (interrupts != nullptr && error.matches(PyExc_KeyboardInterrupt)) {
        interrupts->keep(error);
        return;
      }
      throw Error(ErrorCode::plugin, fmt::format("{}: {}", python_->name, describe(error)));
    }
    PyCommand::copy("potential_gradient", c.potential_gradient, command.potential_gradient().data(),
                    dof_);
    PyCommand::copy("damping", c.damping, command.damping().data(), dof_);
    PyCommand::copy("held_torque", c.held_torque, command.held_torque().data(), dof_);
    if (c.node_velocity) command.node_velocity() = *c.node_velocity;
  }

  void reset(planning::ConstVectorMap q, planning::ConstVectorMap v) noexcept {
    call("reset", [&](const py::object& method) {
      method(to_array(Eigen::VectorXd(q)), to_array(Eigen::VectorXd(v)));
    });
  }
  void world_changed(std::uint64_t world) noexcept {
    call("world_changed", [&](const py::object& method) { method(world); });
  }

 private:
  struct Python {
    py::object object, method, tick_object, command_object, setup_object;
    PyTick* tick = nullptr;
    PyCommand* command = nullptr;
    PySetup* setup = nullptr;
    std::string name;
  };
  // Lets the object use the host's services.
  class DuringServices {
   public:
    DuringServices(PySetup& setup, const Host& host) : setup_(setup) {
      setup.host = &host;
      setup.thread = std::this_thread::get_id();
    }
    DuringServices(const DuringServices&) = delete;
    DuringServices& operator=(const DuringServices&) = delete;
    ~DuringServices() { setup_.host = nullptr; }

   private:
    PySetup& setup_;
  };
  class DuringTick {
   public:
    DuringTick(PyTick& t, const Tick& tick, PyCommand& c, Command& command, PySetup& setup,
               const Host& host)
        : t_(t), c_(c), services_(setup, host) {
      t.tick.set(&tick);
      c.command.set(&command);
    }
    DuringTick(const DuringTick&) = delete;
    DuringTick& operator=(const DuringTick&) = delete;
    ~DuringTick() {
      t_.tick.set(nullptr);
      c_.command.set(nullptr);
    }

   private:
    PyTick& t_;
    PyCommand& c_;
    DuringServices services_;
  };

  void start(const Setup& setup, const Json& params) {
    const std::string where = name_of(params);
    python_->object = make_object(params);
    guarded(where, [&] {
      const auto dof = static_cast<py::ssize_t>(dof_);
      python_->name = py::str(py::type::of(python_->object).attr("__name__"));
      python_->tick_object = py::cast(std::make_shared<PyTick>());
      python_->tick = python_->tick_object.cast<PyTick*>();
      PyTick& t = *python_->tick;
      t.dof = dof_;
      for (const auto& shape : setup.shapes()) t.links.push_back(shape.link);
      t.q = new_array({dof});
      t.v = new_array({dof});
      for (auto* x : {&t.q, &t.v}) x->attr("setflags")(py::arg("write") = false);
      python_->command_object = py::cast(std::make_shared<PyCommand>());
      python_->command = python_->command_object.cast<PyCommand*>();
      for (auto* x : {&python_->command->potential_gradient, &python_->command->damping,
                      &python_->command->held_torque})
        *x = new_array({dof});
      python_->setup_object = py::cast(std::make_shared<PySetup>());
      python_->setup = python_->setup_object.cast<PySetup*>();
      python_->setup->query.set(&query_);
      python_->setup->model = std::make_shared<BoundModel>(setup.model());
      python_->setup->facts = facts_of(setup);
      const DuringServices services(*python_->setup, host_);
      python_->setup->starting = true;
      if (py::hasattr(python_->object, "start"))
        python_->object.attr("start")(python_->setup_object);
      python_->setup->starting = false;
      python_->method = python_->object.attr("tick");
    });
  }
  void disconnect() noexcept {
    if (!python_) return;
    if (python_->setup != nullptr) {
      python_->setup->query.set(nullptr);
    }
    python_.reset();
  }
  // Calls a method that the object may have. What it raises is written to the log.
  template <class F>
  void call(const char* name, const F& f) noexcept {
    try {
      const py::gil_scoped_acquire locked;
      try {
        const DuringServices services(*python_->setup, host_);
        if (py::hasattr(python_->object, name)) f(python_->object.attr(name));
      } catch (py::error_already_set& error) {
        host_.warning(one_line(fmt::format("{}.{}: {}", python_->name, name, describe(error))));
      }
    } catch (...) {
      // There is no one to tell.
    }
  }

  Host host_;
  Query query_;
  std::size_t dof_;
  std::unique_ptr<Python> python_;
};

void add_tick(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(TickContactRow, shape, link, obstacle, distance_m, arm_point_m,
                       obstacle_point_m, direction, obstacle_velocity_m_s);
  PYBIND11_NUMPY_DTYPE(TickSelfContactRow, shape_a, shape_b, distance_m, point_a_m, point_b_m,
                       direction);
  py::class_<PyTick, std::shared_ptr<PyTick>>(
      module, "Tick", "The input of one tick of a planner. Valid during the call of tick().")
      .def_property_readonly(
          "k", [](const PyTick& t) { return t.get().k(); }, "Index of the tick.")
      .def_property_readonly(
          "time_s", [](const PyTick& t) { return t.get().time_s(); }, "Time [s].")
      .def_property_readonly(
          "q", [](const PyTick& t) -> py::object { return t.q; },
          "Joint positions, shape (n,) [rad or m]. The same array at each tick, read-only; copy "
          "it\n"
          "to keep it.")
      .def_property_readonly(
          "v", [](const PyTick& t) -> py::object { return t.v; },
          "Joint velocities, shape (n,) [rad/s or m/s], as q.")
      .def_property_readonly(
          "goal", [](const PyTick& t) { return goal_dict(t.get().goal(), t.dof); },
          "The current goal as a dict: type, tolerances, path, path_margin_m (its clearance away\n"
          "from its ends, if it was searched), path_search (\"not sought\", \"sought\",\n"
          "\"found\", \"not found\"), and q or position_m, quaternion_wxyz, velocity_m_s,\n"
          "angular_velocity_rad_s; a copy.")
      .def_property_readonly(
          "goal_number", [](const PyTick& t) { return t.get().goal_number(); },
          "Another number means another goal.")
      .def_property_readonly(
          "goal_index", [](const PyTick& t) { return t.get().goal_index(); },
          "Index of the goal in its list.")
      .def_property_readonly("contacts", &tick_contacts,
                             "Near obstacle points, shape by shape, nearest first: a structured\n"
                             "array with shape, link, obstacle, distance_m, arm_point_m,\n"
                             "obstacle_point_m, direction, obstacle_velocity_m_s; a copy.")
      .def_property_readonly("self_contacts", &tick_self_contacts,
                             "Near pairs of parts of the arm: a structured array with shape_a,\n"
                             "shape_b, distance_m, point_a_m, point_b_m, direction; a copy.")
      .def_property_readonly(
          "reference", &tick_reference,
          "Where the arm should be by the trajectory of its goal: a dict with q,\n"
          "v, a, time_s, rate; None without a trajectory.")
      .def_property_readonly(
          "torque", [](const PyTick& t) { return array_or_none(t.get().torque()); },
          "Joint torques sent to the arm last, shape (n,); None under ideal\n"
          "actuation.")
      .def_property_readonly(
          "disturbance", [](const PyTick& t) { return array_or_none(t.get().disturbance()); },
          "Joint accelerations that the model does not explain, because of friction or wrong\n"
          "masses, shape (n,); None where no torques are sent.")
      .def_property_readonly(
          "world", [](const PyTick& t) { return t.get().world(); },
          "Number of the world's snapshot; changes with obstacles and map.")
      .def_property_readonly(
          "speed_scale", [](const PyTick& t) { return t.get().speed_scale(); },
          "1, or less where the scene requires slow motion.")
      .def_property_readonly(
          "moving_count", [](const PyTick& t) { return t.get().moving_count(); },
          "Number of obstacles that move, or may move later.")
      .def("__repr__", [](const PyTick&) { return "<hamelin.Tick>"; });
}

template <py::array_t<double> PyCommand::*member>
void add_channel(py::class_<PyCommand, std::shared_ptr<PyCommand>>& type, const char* name,
                 const char* text) {
  type.def_property(
      name, [](const PyCommand& c) -> py::object { return c.*member; },
      [name](PyCommand& c, py::handle x) { assign(c.*member, name, x); }, text);
}

template <class T, T hamelin_command::*member>
void add_number(py::class_<PyCommand, std::shared_ptr<PyCommand>>& type, const char* name,
                const char* text) {
  type.def_property(
      name, [](const PyCommand& c) { return c.get().raw().*member; },
      [](PyCommand& c, T value) { c.get().raw().*member = value; }, text);
}

void add_command(py::module_& module) {
  using py::arg;
  py::class_<PyCommand, std::shared_ptr<PyCommand>> type(
      module, "Command",
      "The answer of one tick of a planner, in channels that are zero at\n"
      "first. Valid during the call of tick().");
  add_channel<&PyCommand::potential_gradient>(
      type, "potential_gradient",
      "Gradient of a potential, shape (n,) [Nm or N]: the arm feels -g.");
  add_channel<&PyCommand::damping>(type, "damping",
                                   "Coefficients of damping, shape (n,), not negative [Nms/rad].");
  add_channel<&PyCommand::held_torque>(type, "held_torque",
                                       "Torque that is held over the step, shape (n,) [Nm or N].");
  type.def_property(
          "node_velocity",
          [](const PyCommand& c) -> py::object {
            if (!c.node_velocity) return py::none();
            return to_array(*c.node_velocity);
          },
          [](PyCommand& c, py::handle v) {
            if (v.is_none())
              c.node_velocity.reset();
            else
              c.node_velocity = python::vector_of("Command", "node_velocity", v, c.damping.size());
          },
          "Joint velocity that is set at the node, shape (n,) [rad/s or m/s]; None: not set.")
      .def(
          "add_gyroscopic",
          [](PyCommand& c, int link, py::handle point, py::handle w) {
            const Eigen::Vector3d p = vector3_of("Command", "point", point);
            const Eigen::Vector3d axis = vector3_of("Command", "w", w);
            if (link < 0 || link >= c.damping.size())
              refuse("Command", "link",
                     fmt::format("{}, expected 0 to {}", link, c.damping.size() - 1));
            const hamelin_command& raw = c.get().raw();
            if (raw.gyroscopic_count >= raw.gyroscopic_capacity)
              refuse("Command", "add_gyroscopic",
                     fmt::format("{} terms, expected no more", raw.gyroscopic_count));
            c.get().add_gyroscopic(link, p, axis);
          },
          arg("link"), arg("point"), arg("w"),
          "Adds the force w x (velocity of the point). link: index; point: shape (3,), in the "
          "link's\n"
          "centre-of-mass frame [m]; w: shape (3,), world axes [N s/m].")
      .def(
          "give_up", [](PyCommand& c, const std::string& cause) { c.get().give_up(cause); },
          arg("cause"), "Ends the run: the planner sees no way to the goal.")
      .def(
          "set_series",
          [](PyCommand& c, int series, double value) {
            if (series < 0 || static_cast<std::size_t>(series) >= c.get().raw().series_count)
              refuse("Command", "series",
                     fmt::format("{}, expected a number that declare_series returned", series));
            c.get().set_series(series, value);
          },
          arg("series"), arg("value"), "Sets a number of a declared series, for log and report.")
      .def("__repr__", [](const PyCommand&) { return "<hamelin.Command>"; });
  add_number<double, &hamelin_command::potential_J>(type, "potential_J",
                                                    "The potential at this node [J].");
  add_number<double, &hamelin_command::filter_work_J>(
      type, "filter_work_J", "Work of node velocities by constraints that admit rest [J].");
  add_number<double, &hamelin_command::recovery_work_J>(
      type, "recovery_work_J", "Work of node velocities by constraints that demand motion [J].");
}

void add_setup(py::module_& module) {
  using py::arg;
  py::class_<PySetup, std::shared_ptr<PySetup>>(
      module, "PlannerSetup",
      "What is fixed for a run, and the services of the host. A planner gets it by\n"
      "start(setup). Limits are None where the scene does not model them. The\n"
      "queries may be used until the run ends; log(), warn(), declare_series(), draw_path() and\n"
      "request_path() in calls of the planner.")
      .def_property_readonly(
          "model", [](const PySetup& s) { return s.model; }, "The planner's model of the arm.")
      .def_property_readonly(
          "facts", [](const PySetup& s) { return s.facts; },
          "All that is fixed, as a dict: dof, q_lower, q_upper, velocity_max,\n"
          "effort_max, effort_rate_max (arrays or None), control_period_s,\n"
          "deadline_s, delay_s, sampled, self_collision, influence_m,\n"
          "map_resolution_m, shield_margin_m, seed, goals.")
      .def(
          "__getattr__",
          [](const PySetup& s, const std::string& name) -> py::object {
            if (s.facts && s.facts.contains(name.c_str())) return s.facts[name.c_str()];
            throw py::attribute_error(fmt::format("PlannerSetup has no attribute '{}'", name));
          },
          arg("name"), "One of the facts.")
      .def(
          "log",
          [](const PySetup& s, const std::string& text) { s.services().info(one_line(text)); },
          arg("text"), "Writes a line to the log.")
      .def(
          "warn",
          [](const PySetup& s, const std::string& text) { s.services().warning(one_line(text)); },
          arg("text"), "Writes a warning to the log.")
      .def(
          "declare_series",
          [](const PySetup& s, const std::string& name, const std::string& unit) {
            if (!s.starting)
              refuse("PlannerSetup", "declare_series", "called after start(), expected in start()");
            return s.services().declare_series(name, unit);
          },
          arg("name"), arg("unit") = "",
          "Declares a series of numbers for log and report; in start() only. Returns its number,\n"
          "for Command.set_series().")
      .def("draw_path", &setup_draw_path, arg("points"),
           "Draws a line of points of the world, shape (N, 3) [m], for log and report; in tick().")
      .def(
          "request_path", [](const PySetup& s) { return s.services().request_path(); },
          "Asks for a collision-free path to the current goal; in tick(). Returns whether one\n"
          "will be searched. Later ticks have another goal: at first one where the arm waits, then "
          "one\n"
          "with the path, or the goal itself if none was found; goal[\"path_search\"] says which.")
      .def("clearance", &setup_clearance, arg("q"), py::kw_only(), arg("time_ahead") = 0.0,
           arg("at_least") = -1.0e9,
           "Smallest distance at q, shape (n,) or (N, n), from obstacles and of the arm from "
           "itself\n"
           "[m]; exact from `at_least` up to influence_m.")
      .def(
          "motion_clear", &setup_motion_clear, arg("q0"), arg("q1"),
          "Whether the straight joint motion from q0 to q1 is proved clear; obstacles stand still.")
      .def("distance", &setup_distance, arg("points"), py::kw_only(), arg("time_ahead") = 0.0,
           arg("limit") = 1.0, "Distances of points, shape (3,) or (N, 3), at most `limit` [m].")
      .def(
          "refresh", [](PySetup& s) { s.query.get("PlannerSetup").refresh(); },
          "Takes the newest snapshot of the world for clearance(), motion_clear(), distance().")
      .def("__repr__", [](const PySetup& s) {
        return fmt::format("<hamelin.PlannerSetup for '{}'>",
                           s.model ? s.model->model.robot().name : "");
      });
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

void add_planners(py::module_& module) {
  add_tick(module);
  add_command(module);
  add_setup(module);
  // The plugin python.hamelin.so passes the calls of a host on to these functions.
  static const hamelin_plugin plugin = planning::detail::Glue<PythonPlanner>::plugin(
      "python", HAMELIN_VERSION, "a planner that is written in Python", "{}");
  module.attr("_planner_plugin") = py::capsule(&plugin, "hamelin_plugin");
}

}  // namespace hamelin::python
