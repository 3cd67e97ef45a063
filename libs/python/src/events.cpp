#include "hamelin/integration/events.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "bound_integrator.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace {

// hamelin.EventFinder.
struct BoundFinder : Whole {
  BoundFinder(std::shared_ptr<BoundIntegrator> given, std::vector<integration::Event> events,
              const integration::EventSettings& settings)
      : integrator(std::move(given)), finder(*integrator->scheme, std::move(events), settings) {}

  std::shared_ptr<BoundIntegrator> integrator;
  integration::EventFinder finder;
};

// A function, or a pair of a function and a direction.
integration::Event event_of(py::handle given) {
  integration::Event event;
  py::object function = py::reinterpret_borrow<py::object>(given);
  if (py::isinstance<py::tuple>(given)) {
    const auto pair = py::reinterpret_borrow<py::tuple>(given);
    if (pair.size() != 2)
      refuse("EventFinder", "events",
             fmt::format("a tuple of {} parts, expected (function, direction)", pair.size()));
    function = pair[0];
    event.direction = pair[1].cast<int>();
  }
  if (PyCallable_Check(function.ptr()) == 0)
    refuse(
        "EventFinder", "events",
        fmt::format("{}, expected a function of (time_s, q, v)", std::string(py::repr(function))));
  event.value = [function](double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    return function(time_s, to_array(q), to_array(v)).cast<double>();
  };
  return event;
}

std::shared_ptr<BoundFinder> make_finder(const std::shared_ptr<BoundIntegrator>& integrator,
                                         const py::iterable& events, int samples,
                                         double tolerance_s) {
  std::vector<integration::Event> given;
  for (const auto& event : events) given.push_back(event_of(event));
  return std::make_shared<BoundFinder>(integrator, std::move(given),
                                       integration::EventSettings{samples, tolerance_s});
}

py::tuple step_to_event(BoundFinder& bound, PyState& state, double h, const PyChannels* channels) {
  const Use use(*bound.integrator);
  const auto taken = bound.finder.step(state, given_or_none(channels), h);
  return py::make_tuple(boxed(taken.step),
                        taken.event < 0 ? py::object(py::none()) : py::int_(taken.event));
}

py::tuple motion_within(const BoundFinder& bound, double time_s) {
  const Eigen::Index dof = bound.integrator->model->model.dof();
  Eigen::VectorXd q(dof), v(dof);
  bound.finder.motion().at(time_s, q, v);
  return py::make_tuple(to_array(q), to_array(v));
}

}  // namespace

void add_events(py::module_& module) {
  using py::arg;
  py::class_<BoundFinder, std::shared_ptr<BoundFinder>>(
      module, "EventFinder",
      "Steps of an integrator that end where a function of time and state changes its sign.")
      .def(py::init(&make_finder), arg("integrator").none(false), arg("events"), py::kw_only(),
           arg("samples") = 8, arg("tolerance_s") = 1e-12,
           "events: functions (time_s, q, v) -> float, or pairs (function, direction), where a\n"
           "direction of 1 means only from negative to positive, -1 the reverse, 0 both.\n"
           "samples: per step; signs that change twice between two of them are not seen.\n"
           "tolerance_s: by how much the state may be later than the event.")
      .def("step", &step_to_event, arg("state"), arg("step"), arg("channels") = py::none(),
           "Advances the state by `step` [s], or to the first event within it, in place.\n\n"
           "Returns (StepReport, index of the event or None). The state at an event is one of the\n"
           "scheme; the next step does not find the event again.")
      .def("motion", &motion_within, arg("time_s"),
           "(q, v) at a time within the last step, by the polynomial of degree five through\n"
           "positions, velocities and accelerations at both nodes.");
}

}  // namespace hamelin::python
