#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>

#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "bound_integrator.hpp"
#include "frame_arguments.hpp"
#include "hamelin/core/error.hpp"
#include "interrupts.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace {

Json options_of(const py::kwargs& given) {
  Json options = Json::object();
  for (const auto& [key, value] : given)
    if (!value.is_none()) options[key.cast<std::string>()] = to_json(value);
  // As the program's --tolerance: each solver reads its own key.
  if (options.contains("tolerance") && !options.contains("feedback_tolerance"))
    options["feedback_tolerance"] = options["tolerance"];
  return options;
}

std::shared_ptr<BoundIntegrator> make_bound(const SharedModel& model, const std::string& name,
                                            const py::kwargs& options) {
  return std::make_shared<BoundIntegrator>(model, name, options_of(options));
}

Eigen::VectorXd free_vector(const char* argument, py::handle given) {
  if (given.is_none()) return {};
  const Numbers numbers("Channels", argument, given);
  return numbers.require_vector(numbers.dimensions() == 1 ? numbers.extent(0) : -1).vector();
}

std::vector<dynamics::GyroscopicTerm> terms_of(py::handle given) {
  std::vector<dynamics::GyroscopicTerm> terms;
  for (const auto& item : py::reinterpret_borrow<py::object>(given)) {
    const auto term = py::reinterpret_borrow<py::object>(item).cast<py::tuple>();
    if (term.size() != 3)
      refuse("Channels", "gyroscopic",
             fmt::format("a term of {} parts, expected (link, point, w)", term.size()));
    terms.push_back({term[0].cast<int>(), vector3_of("Channels", "gyroscopic", term[1]),
                     vector3_of("Channels", "gyroscopic", term[2])});
  }
  return terms;
}

// Calls a law of Python, which returns moments and forces, one row per wrench.
auto law_of(const py::object& law) {
  return [law](const dynamics::Workspace&, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
               std::span<dynamics::ExternalWrench> wrenches) {
    const py::gil_scoped_acquire locked;
    const py::object given = law(to_array(q), to_array(v));
    const Numbers numbers("Channels", "wrench_law", given);
    const auto count = static_cast<py::ssize_t>(wrenches.size());
    if (numbers.dimensions() != 2 || numbers.extent(0) != count || numbers.extent(1) != 6)
      refuse("Channels", "wrench_law",
             fmt::format("it returned shape {}, expected ({}, 6)", describe_shape(numbers.array()),
                         count));
    for (std::size_t i = 0; i < wrenches.size(); ++i)
      wrenches[i].wrench = Eigen::Map<const dynamics::Vector6d>(numbers.data() + 6 * i);
  };
}

std::shared_ptr<PyChannels> make_channels(py::handle damping, py::handle coulomb,
                                          double coulomb_speed, py::handle gyroscopic,
                                          py::handle held_torque, py::handle wrenches,
                                          const py::object& wrench_law) {
  Channels channels;
  channels.damping = free_vector("damping", damping);
  channels.coulomb = free_vector("coulomb", coulomb);
  channels.coulomb_speed = coulomb_speed;
  channels.gyroscopic = terms_of(gyroscopic);
  channels.held_torque = free_vector("held_torque", held_torque);
  channels.wrenches = wrenches_of("Channels", wrenches);
  if (!wrench_law.is_none()) channels.wrench_law = law_of(wrench_law);
  return boxed(std::move(channels));
}

// The rows of a motion.
class Motion {
 public:
  explicit Motion(Eigen::Index dof) : dof_(dof) {}

  void add_node(BoundIntegrator& integrator, const State& state, double time_s) {
    Eigen::VectorXd v(dof_);
    integrator.scheme->velocity(state, v);
    const auto energy = integrator.scheme->energy(state, v);
    time_.push_back(time_s);
    q_.insert(q_.end(), state.q.data(), state.q.data() + dof_);
    v_.insert(v_.end(), v.data(), v.data() + dof_);
    kinetic_.push_back(energy.kinetic_J);
    potential_.push_back(energy.potential_J);
  }
  void add_report(const StepReport& report) {
    const StepReport merged = pending_ ? merge(*pending_, report) : report;
    pending_ = merged;
  }
  // Ends the interval since the last node.
  void end_interval() {
    const StepReport& report = pending_ ? *pending_ : none_;
    updates_.push_back(report.updates);
    evaluations_.push_back(report.evaluations);
    factorizations_.push_back(report.factorizations);
    halvings_.push_back(report.halvings);
    rejected_.push_back(report.rejected);
    residual_.push_back(report.residual);
    dissipated_.push_back(report.dissipated_J);
    held_work_.push_back(report.held_work_J);
    external_work_.push_back(report.external_work_J);
    pending_.reset();
  }
  [[nodiscard]] py::dict to_python(bool completed) const {
    py::dict out;
    out["completed"] = completed;
    out["time_s"] = column(time_);
    out["q"] = column(q_).reshape({static_cast<py::ssize_t>(time_.size()), dof_});
    out["v"] = column(v_).reshape({static_cast<py::ssize_t>(time_.size()), dof_});
    out["kinetic_J"] = column(kinetic_);
    out["potential_J"] = column(potential_);
    out["updates"] = column(updates_);
    out["evaluations"] = column(evaluations_);
    out["factorizations"] = column(factorizations_);
    out["halvings"] = column(halvings_);
    out["rejected"] = column(rejected_);
    out["residual"] = column(residual_);
    out["dissipated_J"] = column(dissipated_);
    out["held_work_J"] = column(held_work_);
    out["external_work_J"] = column(external_work_);
    return out;
  }

 private:
  template <class T>
  static py::array_t<T> column(const std::vector<T>& values) {
    return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
  }

  Eigen::Index dof_;
  std::vector<double> time_, q_, v_, kinetic_, potential_;
  std::vector<std::int64_t> updates_, evaluations_, factorizations_, halvings_, rejected_;
  std::vector<double> residual_, dissipated_, held_work_, external_work_;
  std::optional<StepReport> pending_;
  StepReport none_;
};

struct Steps {
  double step_s, duration_s;
  long every;
  const Channels& channels;
  py::object on_step;
};

void check_steps(const Steps& steps, bool adaptive) {
  const auto positive = [](const char* argument, double value) {
    if (!(value > 0.0) || !std::isfinite(value))
      refuse("simulate", argument, fmt::format("{}, expected a positive number", value));
  };
  positive("step", steps.step_s);
  positive("duration", steps.duration_s);
  if (steps.every < 1)
    refuse("simulate", "every", fmt::format("{}, expected 1 or more", steps.every));
  const double count = steps.duration_s / steps.step_s;
  if (!adaptive && std::abs(count - std::round(count)) > 1e-9 * std::max(1.0, count))
    refuse("simulate", "duration",
           fmt::format("{} s is not an integer multiple of the step {} s", steps.duration_s,
                       steps.step_s));
}

bool wants_to_end(const py::object& on_step, const State& state, const StepReport& report) {
  if (on_step.is_none()) return false;
  const py::gil_scoped_acquire locked;
  const py::object answer = on_step(boxed(state), boxed(report));
  return answer.ptr() == Py_True;
}

// Integrates; returns whether all steps converged.
bool take_steps(BoundIntegrator& integrator, State& state, const Steps& steps, Motion& motion) {
  const bool adaptive = integrator.scheme->adaptive();
  const double end = state.time_s + steps.duration_s;
  const long count = adaptive ? 0 : std::lround(steps.duration_s / steps.step_s);
  motion.add_node(integrator, state, state.time_s);
  const py::gil_scoped_release unlocked;
  InterruptCheck interrupts;
  for (long i = 1;; ++i) {
    const double left = end - state.time_s;
    const StepReport report = adaptive
                                  ? integrator.scheme->advance(state, steps.channels, left)
                                  : integrator.scheme->step(state, steps.channels, steps.step_s);
    if (!report.converged) return false;
    motion.add_report(report);
    // The time that is left of the last step is rounding.
    const bool at_end = adaptive ? end - state.time_s <= 1e-12 * steps.duration_s : i == count;
    const bool last = wants_to_end(steps.on_step, state, report) || at_end;
    if (last || i % steps.every == 0) {
      // As in logs, without the rounding of a sum of steps.
      motion.add_node(integrator, state,
                      adaptive ? state.time_s : static_cast<double>(i) * steps.step_s);
      motion.end_interval();
    }
    if (last) return true;
    if (i % 1000 == 0) interrupts.raise();
  }
}

py::dict simulate(BoundIntegrator& integrator, py::handle q0, py::handle v0, double step,
                  double duration, const PyChannels* channels, long every,
                  const py::object& on_step) {
  const Eigen::Index dof = integrator.model->model.dof();
  const Eigen::VectorXd q = vector_of("simulate", "q0", q0, dof);
  const Eigen::VectorXd v =
      v0.is_none() ? Eigen::VectorXd::Zero(dof) : vector_of("simulate", "v0", v0, dof);
  const Steps steps{step, duration, every, given_or_none(channels), on_step};
  check_steps(steps, integrator.scheme->adaptive());
  const Use use(integrator);
  State state = integrator.scheme->start(q, v);
  if (integrator.scheme->adaptive()) state.step_next = step;
  Motion motion(dof);
  const bool completed = take_steps(integrator, state, steps, motion);
  return motion.to_python(completed);
}

std::string repr_of_integrator(const BoundIntegrator& integrator) {
  return fmt::format("<hamelin.Integrator '{}' of order {} for '{}'{}>", integrator.scheme->name(),
                     integrator.scheme->order(), integrator.model->model.robot().name,
                     integrator.scheme->adaptive() ? ", step control" : "");
}

void add_state(py::module_& module) {
  py::class_<PyState, std::shared_ptr<PyState>>(
      module, "State",
      "The memory of an integrator between steps. Integrator.start() makes one. It belongs to the\n"
      "scheme and the model; integrators of others refuse it with an Error.")
      .def_property_readonly(
          "time_s", [](const PyState& s) { return s.time_s; }, "Time since the start [s].")
      .def_property_readonly(
          "k", [](const PyState& s) { return s.k; }, "Number of steps taken.")
      .def_property_readonly(
          "q", [](const PyState& s) { return to_array(s.q); },
          "Joint positions, shape (n,) [rad or m]; a copy.")
      .def_property_readonly(
          "momentum", [](const PyState& s) { return to_array(s.p); },
          "Momenta at the node, shape (n,) [Nm s or N s], of schemes that step them; a copy.")
      .def_property_readonly(
          "step_next", [](const PyState& s) { return s.step_next; },
          "Next step under step control [s].")
      .def(
          "copy", [](const PyState& s) { return boxed<State>(s); }, "A copy, to keep and restore.")
      .def(
          "__copy__", [](const PyState& s) { return boxed<State>(s); }, "A copy.")
      .def(
          "__deepcopy__", [](const PyState& s, const py::dict&) { return boxed<State>(s); },
          py::arg("memo"), "A copy.")
      .def("__repr__", [](const PyState& s) {
        return fmt::format("<hamelin.State k = {}, time_s = {:.6g}, q = [{:.6g}]>", s.k, s.time_s,
                           fmt::join(s.q.data(), s.q.data() + s.q.size(), ", "));
      });
}

void add_report(py::module_& module) {
  py::class_<PyReport, std::shared_ptr<PyReport>>(module, "StepReport",
                                                  "The outcome and the cost of one step.")
      .def_readonly("converged", &StepReport::converged, "If false, the state is unchanged.")
      .def_readonly("updates", &StepReport::updates, "Corrections of the displacement.")
      .def_readonly("factorizations", &StepReport::factorizations,
                    "Factorisations, or multiplications by the inverse mass matrix.")
      .def_readonly("evaluations", &StepReport::evaluations,
                    "Residuals, stages, or forward dynamics of explicit schemes.")
      .def_readonly("halvings", &StepReport::halvings, "How often the step was halved.")
      .def_readonly("rejected", &StepReport::rejected, "Tries that step control rejected.")
      .def_readonly("step_s", &StepReport::step_s, "Time by which the state advanced [s].")
      .def_readonly("residual", &StepReport::residual,
                    "The value that Integrator.criterion bounds.")
      .def_readonly("gyroscopic_work_J", &StepReport::gyroscopic_work_J,
                    "Work of gyroscopic terms [J]: rounding.")
      .def_readonly("dissipated_J", &StepReport::dissipated_J,
                    "Work of damping and dry friction [J], positive.")
      .def_readonly("held_work_J", &StepReport::held_work_J, "Work of the held torque [J].")
      .def_readonly("external_work_J", &StepReport::external_work_J, "Work of the wrenches [J].")
      .def("__repr__", [](const PyReport& r) {
        return fmt::format("<hamelin.StepReport {}, {:.6g} s, {} updates, residual {:.3g}>",
                           r.converged ? "converged" : "not converged", r.step_s, r.updates,
                           r.residual);
      });
}

void add_channels(py::module_& module) {
  py::class_<PyChannels, std::shared_ptr<PyChannels>>(
      module, "Channels", "The forces on the arm during a step, besides gravity.")
      .def(py::init(&make_channels), py::kw_only(), py::arg("damping") = py::none(),
           py::arg("coulomb") = py::none(), py::arg("coulomb_speed") = 0.01,
           py::arg("gyroscopic") = py::tuple(), py::arg("held_torque") = py::none(),
           py::arg("wrenches") = py::none(), py::arg("wrench_law") = py::none(),
           "damping: viscous, shape (n,) [Nms/rad or Ns/m]. coulomb: dry friction, shape (n,)\n"
           "[Nm or N], viscous below coulomb_speed [rad/s or m/s]. Steps refuse negative ones.\n"
           "gyroscopic: terms (link, point, w), with the point in the link's centre-of-mass frame\n"
           "[m] and w in the world [N s/m]. held_torque: shape (n,) [Nm or N].\n"
           "wrenches: as Model.wrench() makes them, held over a step. wrench_law(q, v): returns\n"
           "their moments and forces at a state, shape (number of wrenches, 6); it is called\n"
           "several times per step.")
      .def_property_readonly(
          "damping", [](const PyChannels& c) { return to_array(c.damping); },
          "Viscous damping, shape (n,) or (0,); a copy.")
      .def_property_readonly(
          "coulomb", [](const PyChannels& c) { return to_array(c.coulomb); },
          "Dry friction, shape (n,) or (0,); a copy.")
      .def_readonly("coulomb_speed", &Channels::coulomb_speed,
                    "Speed below which dry friction is viscous [rad/s or m/s].")
      .def_property_readonly(
          "held_torque", [](const PyChannels& c) { return to_array(c.held_torque); },
          "Held torque, shape (n,) or (0,); a copy.")
      .def("__repr__", [](const PyChannels& c) {
        return fmt::format(
            "<hamelin.Channels damping {}, coulomb {}, gyroscopic {}, held_torque {}>",
            c.damping.size(), c.coulomb.size(), c.gyroscopic.size(), c.held_torque.size());
      });
}

std::shared_ptr<PyReport> step(BoundIntegrator& integrator, PyState& state, double h,
                               const PyChannels* channels) {
  const Use use(integrator);
  return boxed(integrator.scheme->step(state, given_or_none(channels), h));
}

std::shared_ptr<PyReport> advance(BoundIntegrator& integrator, PyState& state, double limit,
                                  const PyChannels* channels) {
  const Use use(integrator);
  return boxed(integrator.scheme->advance(state, given_or_none(channels), limit));
}

std::shared_ptr<PyState> start(BoundIntegrator& integrator, py::handle q0, py::handle v0) {
  const Eigen::Index dof = integrator.model->model.dof();
  const Eigen::VectorXd q = vector_of("start", "q0", q0, dof);
  const Eigen::VectorXd v =
      v0.is_none() ? Eigen::VectorXd::Zero(dof) : vector_of("start", "v0", v0, dof);
  const Use use(integrator);
  return boxed(integrator.scheme->start(q, v));
}

// A matrix as an array in C order.
py::array_t<double> rows_of(const Eigen::MatrixXd& from) {
  auto out = new_array({from.rows(), from.cols()});
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      out.mutable_data(), from.rows(), from.cols()) = from;
  return out;
}

py::dict step_derivatives(BoundIntegrator& integrator, const PyState& state,
                          const PyChannels* channels) {
  const Use use(integrator);
  if (!integrator.differentiator)
    integrator.differentiator =
        integration::make_step_differentiator(integrator.model->model, integrator.options);
  integration::StepDerivatives found(integrator.model->model.dof());
  integrator.differentiator->differentiate(state, given_or_none(channels), found);
  py::dict out;
  out["step_s"] = found.step_s;
  out["by_state"] = rows_of(found.by_state);
  out["by_torque"] = rows_of(found.by_torque);
  out["by_step"] = to_array(found.by_step);
  return out;
}

py::array_t<double> velocity(BoundIntegrator& integrator, const PyState& state) {
  const Use use(integrator);
  Eigen::VectorXd v(integrator.model->model.dof());
  integrator.scheme->velocity(state, v);
  return to_array(v);
}

py::tuple energy(BoundIntegrator& integrator, const PyState& state) {
  const Use use(integrator);
  const auto energy = integrator.scheme->energy(state);
  return py::make_tuple(energy.kinetic_J, energy.potential_J);
}

void kick(BoundIntegrator& integrator, PyState& state, py::handle dp) {
  const Eigen::VectorXd impulse = vector_of("kick", "dp", dp, integrator.model->model.dof());
  const Use use(integrator);
  integrator.scheme->kick(state, impulse);
}

void set_velocity(BoundIntegrator& integrator, PyState& state, py::handle v) {
  const Eigen::VectorXd value = vector_of("set_velocity", "v", v, integrator.model->model.dof());
  const Use use(integrator);
  integrator.scheme->set_velocity(state, value);
}

using IntegratorClass = py::class_<BoundIntegrator, std::shared_ptr<BoundIntegrator>>;

void add_steps(IntegratorClass& type) {
  using py::arg;
  type.def("start", &start, arg("q0"), arg("v0") = py::none(),
           "The state at time 0. q0, v0: shape (n,); v0 None: at rest.")
      .def("step", &step, arg("state"), arg("step"), arg("channels") = py::none(),
           "Advances the state by exactly `step` [s], in place; under step control by as many\n"
           "steps as needed. Returns a StepReport; if it did not converge, the state is unchanged.")
      .def("advance", &advance, arg("state"), arg("limit"), arg("channels") = py::none(),
           "Takes one step of at most `limit` [s]: of exactly that without step control.")
      .def("step_derivatives", &step_derivatives, arg("state"), arg("channels") = py::none(),
           "Exact derivatives of the last step that led to a state, for 'hamel-variational' and\n"
           "'gauss' with fixed steps; channels: those of the step.\n\n"
           "Returns a dict: 'by_state' (2 n, 2 n), of positions and momenta by those before;\n"
           "'by_torque' (2 n, n), by the held torque; 'by_step' (2 n,), by the length 'step_s'.")
      .def("velocity", &velocity, arg("state"),
           "Joint velocities at the node, shape (n,) [rad/s or m/s].")
      .def("energy", &energy, arg("state"), "(kinetic, potential) energy at the node [J].")
      .def("kick", &kick, arg("state"), arg("dp"),
           "Adds an impulse at the node, shape (n,) [Nm s or N s].")
      .def("set_velocity", &set_velocity, arg("state"), arg("v"),
           "Sets the velocity at the node, shape (n,).");
}

void add_integrator(py::module_& module) {
  using py::arg;
  IntegratorClass type(
      module, "Integrator",
      "A one-step scheme for a model. One call at a time may use it; a state may be copied.");
  type.def(py::init(&make_bound), arg("model").none(false), arg("name") = "hamel-variational",
           "name: one of integrator_names(), possibly with an order: 'gauss:8'.\n"
           "Options as those of `hamelin integrate`: order, solver, rtol, atol, alpha, start,\n"
           "tolerance, max_updates, max_halvings, newmark_beta, newmark_gamma. rtol and atol "
           "switch\n"
           "on step control.")
      .def_property_readonly(
          "name", [](const BoundIntegrator& i) { return i.scheme->name(); }, "Name of the scheme.")
      .def_property_readonly(
          "model", [](const BoundIntegrator& i) { return i.model; },
          "The model that it integrates.")
      .def_property_readonly(
          "order", [](const BoundIntegrator& i) { return i.scheme->order(); },
          "Order of the scheme.")
      .def_property_readonly(
          "adaptive", [](const BoundIntegrator& i) { return i.scheme->adaptive(); },
          "Whether it is under step control.")
      .def_property_readonly(
          "criterion", [](const BoundIntegrator& i) { return i.scheme->criterion(); },
          "The condition for StepReport.converged, as text.")
      .def_property_readonly(
          "mode", [](const BoundIntegrator& i) { return i.scheme->mode(); },
          "'structure' or 'accurate', see the C++ documentation.");
  add_steps(type);
  type.def(
          "simulate", &simulate, arg("q0"), arg("v0") = py::none(), py::kw_only(), arg("step"),
          arg("duration"), arg("channels") = py::none(), arg("every") = 1,
          arg("on_step") = py::none(),
          "Integrates the motion from q0, v0 without a loop in Python.\n\n"
          "step: fixed step [s]; under step control the first one. duration [s]: an integer\n"
          "multiple of a fixed step. every: steps between stored nodes. on_step(state, report) is\n"
          "called after each step with a copy of the state; if it returns True, the motion ends.\n"
          "Returns a dict of arrays: for N nodes 'time_s' (N,), 'q', 'v' (N, n), 'kinetic_J',\n"
          "'potential_J' (N,); for the intervals between them 'updates', 'evaluations',\n"
          "'factorizations', 'halvings', 'rejected', 'residual', 'dissipated_J', 'held_work_J',\n"
          "'external_work_J' (N - 1,); and 'completed', false if a step did not converge.")
      .def("__repr__", &repr_of_integrator);
}

}  // namespace

void add_integrators(py::module_& module) {
  add_state(module);
  add_report(module);
  add_channels(module);
  add_integrator(module);
  module.def(
      "integrator_names", [] { return integration::integrator_names(); },
      "Names of all integrators.");
}

}  // namespace hamelin::python
