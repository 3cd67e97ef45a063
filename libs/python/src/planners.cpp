#include <fmt/format.h>

#include <cstring>
#include <memory>
#include <string>
#include <thread>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#include "planner_arguments.hpp"
#include "planner_object.hpp"

namespace hamelin::python {

using planning::Command;
using planning::Host;
using planning::Query;
using planning::Setup;
using planning::Tick;

namespace {

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
    return planner_influence_m(params);
  }

  void tick(const Tick& tick, Command& command) override {
    const py::gil_scoped_acquire locked;
    PyTick& t = *python_->tick;
    PyCommand& c = *python_->command;
    t.copy_state(tick);
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
    c.copy_to(command);
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
    python_->object = make_planner_object(params);
    guarded(planner_name(params), [&] {
      python_->name = py::str(py::type::of(python_->object).attr("__name__"));
      python_->tick_object = py::cast(std::make_shared<PyTick>(setup));
      python_->tick = python_->tick_object.cast<PyTick*>();
      python_->command_object = py::cast(std::make_shared<PyCommand>(dof_));
      python_->command = python_->command_object.cast<PyCommand*>();
      python_->setup_object = py::cast(std::make_shared<PySetup>(setup, query_));
      python_->setup = python_->setup_object.cast<PySetup*>();
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
    if (python_->setup != nullptr) python_->setup->query.set(nullptr);
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

}  // namespace

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
