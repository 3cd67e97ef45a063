#include <fmt/format.h>
#include <pybind11/stl.h>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "counter.hpp"
#include "hamelin/accuracy/accuracy.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace {

py::tuple measure(const BoundModel& bound, const std::string& name, py::handle q0, py::handle v0,
                  py::handle damping, double duration, const std::string& integrators,
                  const std::vector<double>& steps, const std::vector<double>& rtols,
                  const std::vector<double>& tolerances, const std::optional<double>& atol,
                  long every, bool reference, const py::object& progress) {
  const int dof = bound.model.dof();
  accuracy::Options options;
  options.name = name;
  options.q0 = q0.is_none() ? Eigen::VectorXd(Eigen::VectorXd::Zero(dof))
                            : vector_of("accuracy", "q0", q0, dof);
  options.v0 = v0.is_none() ? Eigen::VectorXd(Eigen::VectorXd::Zero(dof))
                            : vector_of("accuracy", "v0", v0, dof);
  options.channels.damping = optional_vector("accuracy", "damping", damping, dof);
  options.duration_s = duration;
  options.schemes = accuracy::read_schemes(integrators);
  options.steps_s = steps;
  options.rtols = rtols;
  options.tolerances = tolerances;
  options.atol = atol;
  if (every < 0) refuse("accuracy", "every", fmt::format("{}, expected 0 or more", every));
  options.every = every;
  options.reference = reference;
  Counter counter(progress);
  options.poll = [&counter] { counter.interrupts.raise(); };
  options.progress = [&counter](std::size_t done, std::size_t all) {
    counter.show(done, all);
    if (counter.interrupts.stop) counter.interrupts.raise();
  };
  accuracy::Measurement measurement;
  {
    const py::gil_scoped_release unlocked;
    measurement = accuracy::measure(bound.model, options);
  }
  counter.interrupts.rethrow();
  return py::make_tuple(to_python(accuracy::to_json(measurement)), accuracy::to_table(measurement));
}

}  // namespace

void add_accuracy(py::module_& module) {
  using py::arg;
  module.def("_measure", &measure, arg("model"), arg("name"), arg("q0"), arg("v0"), arg("damping"),
             arg("duration"), arg("integrators"), arg("steps"), arg("rtols"), arg("tolerances"),
             arg("atol"), arg("every"), arg("reference"), arg("progress"),
             "Document and table of `hamelin accuracy`.");
}

}  // namespace hamelin::python
