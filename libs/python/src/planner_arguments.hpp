#pragma once
#include <fmt/format.h>
#include <pybind11/numpy.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/planning/plugin.hpp"
#include "whole.hpp"

/// What a planner that is written in Python is given, and writes to.
namespace hamelin::python {

namespace py = pybind11;

/// A view of a struct that is valid during one call of the planner.
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

/// hamelin.Tick
struct PyTick : Whole {
  explicit PyTick(const planning::Setup& setup);
  void copy_state(const planning::Tick& from);

  DuringCall<const planning::Tick> tick;
  std::size_t dof;
  std::vector<std::int32_t> links;  ///< of the shapes
  py::array_t<double> q, v;         ///< read-only for Python

  [[nodiscard]] const planning::Tick& get() const { return tick.get("Tick"); }
};

/// hamelin.Command: arrays that a planner writes, copied to the host after its tick.
struct PyCommand : Whole {
  explicit PyCommand(std::size_t n);
  void clear();
  /// @throws Error usage if Python has changed the size of an array in place
  void copy_to(planning::Command& host) const;

  DuringCall<planning::Command> command;
  py::array_t<double> potential_gradient, damping, held_torque;
  std::optional<Eigen::VectorXd> node_velocity;

  [[nodiscard]] planning::Command& get() const { return command.get("Command"); }
};

/// hamelin.PlannerSetup: what is fixed for a run, and the services of the host.
struct PySetup : Whole {
  PySetup(const planning::Setup& setup, planning::Query& answers);

  const planning::Host* host = nullptr;  ///< during a call of the planner
  std::thread::id thread;                ///< of that call
  DuringCall<planning::Query> query;
  SharedModel model;
  py::dict facts;
  bool starting = false;  ///< during start()

  /// Services of the host, which belong to the thread of the planner's calls.
  [[nodiscard]] const planning::Host& services() const {
    if (host == nullptr || thread != std::this_thread::get_id())
      throw Error(
          ErrorCode::usage,
          "PlannerSetup: log(), warn(), declare_series(), draw_path() and request_path() are "
          "used outside of the planner's calls, expected in start() or tick()");
    return *host;
  }
};

/// A copy as an array; None without values.
[[nodiscard]] inline py::object array_or_none(
    const std::optional<planning::ConstVectorMap>& values) {
  if (!values) return py::none();
  return to_array(Eigen::VectorXd(*values));
}

/// A goal as a dict.
[[nodiscard]] py::dict goal_dict(const hamelin_goal& goal, std::size_t dof);

void add_tick(py::module_& module);
void add_command(py::module_& module);
void add_setup(py::module_& module);

}  // namespace hamelin::python
