#include <fmt/format.h>
#include <pybind11/stl.h>

#include <array>
#include <string>

#include "bound_controller.hpp"

namespace hamelin::python {

namespace {

constexpr std::array state_names{"running", "reached", "stalled", "gave_up", "stopping"};
constexpr std::array reason_names{"planner", "late", "measurement", "tracking", "request"};

// What a tick answered.
struct AnswerCopy {
  control::ControlState state;
  control::StopReason reason;
  bool saturated, stopping, may_touch;
  std::uint64_t goals_number, snapshot, load, refused_load;
  std::size_t goal_index;
  std::string cause, load_refusal;
  Eigen::VectorXd torque, q_next, v_next, series;
  std::optional<control::TargetState> target;
  std::optional<control::ReferenceState> reference;
};

AnswerCopy copy_of(const control::Answer& a) {
  AnswerCopy out{a.state,
                 a.reason,
                 a.saturated,
                 a.stopping,
                 a.may_touch != nullptr,
                 a.goals_number,
                 a.snapshot,
                 a.load,
                 a.refused_load,
                 a.goal_index,
                 std::string(a.cause),
                 std::string(a.load_refusal),
                 a.torque,
                 a.q_next,
                 a.v_next,
                 Eigen::Map<const Eigen::VectorXd>(a.series.data(),
                                                   static_cast<Eigen::Index>(a.series.size())),
                 std::nullopt,
                 std::nullopt};
  if (a.target != nullptr) out.target = *a.target;
  if (a.reference != nullptr) out.reference = *a.reference;
  return out;
}

using PyAnswer = Boxed<AnswerCopy>;  // hamelin.Answer

const char* state_name(const PyAnswer& a) {
  return state_names.at(static_cast<std::size_t>(a.state));
}

py::object reason_of(const PyAnswer& a) {
  if (a.reason == control::StopReason::none) return py::none();
  return py::str(reason_names.at(static_cast<std::size_t>(a.reason) - 1));
}

py::object target_of(const PyAnswer& a) {
  if (!a.target) return py::none();
  py::dict out;
  out["pose"] = to_array(a.target->pose);
  out["waiting"] = a.target->waiting;
  out["lost"] = a.target->lost;
  return out;
}

py::object reference_of(const PyAnswer& a) {
  if (!a.reference) return py::none();
  py::dict out;
  out["q"] = to_array(a.reference->q);
  out["v"] = to_array(a.reference->v);
  return out;
}

// Numbers by the names of an enumeration.
template <class Key, std::size_t N>
py::dict by_name(const std::array<long, N>& counts) {
  py::dict out;
  for (std::size_t i = 0; i < N; ++i)
    out[py::str(std::string(to_string(static_cast<Key>(i))))] = counts[i];
  return out;
}

template <class Key>
py::object name_or_none(const std::optional<Key>& key) {
  if (!key) return py::none();
  return py::str(std::string(to_string(*key)));
}

}  // namespace

py::object make_answer(const control::Answer& answer) {
  return py::cast(boxed(copy_of(answer)));
}

py::object shield_counts(control::Controller& controller) {
  const auto report = controller.shield_report();
  if (!report) return py::none();
  const control::ShieldCounts& counts = report->counts;
  control::LineBuffer line;
  controller.describe_refusal(line);
  py::dict out;
  out["stopping"] = report->stopping;
  out["cause"] = name_or_none(report->cause);
  out["line"] = std::string(line.view());
  out["proof"] = name_or_none(report->proof);
  out["steps"] = counts.steps;
  out["refused"] = counts.refused;
  out["at_rest"] = counts.at_rest;
  out["stops"] = counts.stops;
  out["longest"] = counts.longest;
  out["causes"] = by_name<control::StopCause>(counts.causes);
  out["strayed"] = counts.strayed;
  out["strayed_share"] = counts.strayed_share;
  out["strayed_joint"] =
      counts.strayed_joint < 0 ? py::object(py::none()) : py::int_(counts.strayed_joint);
  out["overtaken"] = counts.overtaken;
  out["evasions"] = counts.evasions;
  out["proofs"] = by_name<control::MoverProof>(counts.proofs);
  return out;
}

py::object guide_counts(control::Controller& controller) {
  const control::GuideFigures* const figures = controller.guide_figures();
  if (figures == nullptr) return py::none();
  py::dict out;
  out["searches"] = figures->searches;
  out["found"] = figures->found;
  out["kept"] = figures->kept;
  out["checks"] = figures->checks;
  out["waited_s"] = figures->waited_s;
  out["length"] = figures->length;
  return out;
}

py::object verdict_of(control::Controller& controller) {
  const auto& verdict = controller.verdict();
  if (!verdict) return py::none();
  py::dict out;
  out["certified"] = verdict->certified;
  out["margin_m"] = verdict->margin_m;
  out["contact"] = verdict->contact;
  return out;
}

void add_answer(py::module_& module) {
  const auto array = [](auto member) {
    return [member](const PyAnswer& a) { return to_array(a.*member); };
  };
  py::class_<PyAnswer, std::shared_ptr<PyAnswer>>(module, "Answer",
                                                  "The answer of a tick of a Controller; a copy.")
      .def_property_readonly("state", &state_name,
                             "'running', 'reached', 'stalled', 'gave_up' or 'stopping'.")
      .def_property_readonly("reason", &reason_of,
                             "What the arm is stopped for: 'planner', 'late', 'measurement',\n"
                             "'tracking' or 'request'; None unless it is stopped.")
      .def_readonly("cause", &AnswerCopy::cause, "Why it gave up or stops; one line, or empty.")
      .def_property_readonly("torque", array(&AnswerCopy::torque),
                             "Joint torques to send to the arm, shape (n,) [Nm or N].")
      .def_property_readonly("q_next", array(&AnswerCopy::q_next),
                             "Joint positions one period ahead, shape (n,), with position=True.")
      .def_property_readonly("v_next", array(&AnswerCopy::v_next),
                             "Joint velocities one period ahead, shape (n,), with position=True.")
      .def_readonly("saturated", &AnswerCopy::saturated, "Whether a limit reduced the torque.")
      .def_readonly("stopping", &AnswerCopy::stopping,
                    "Whether the shield refused the planner's answer.")
      .def_readonly("may_touch", &AnswerCopy::may_touch,
                    "Whether the current goal may touch something, which no proof regards.")
      .def_readonly("goals_number", &AnswerCopy::goals_number,
                    "Number of the list of goals: 0 for the scene's, or of set_goals().")
      .def_readonly("goal_index", &AnswerCopy::goal_index, "Index of the current goal in it.")
      .def_property_readonly("target", &target_of,
                             "Where a follow goal's target is: a dict with pose, waiting (nothing\n"
                             "has arrived yet) and lost; None for other goals.")
      .def_property_readonly(
          "reference", &reference_of,
          "Where a trajectory goal should be now: a dict with q and v; None for\n"
          "other goals.")
      .def_readonly("snapshot", &AnswerCopy::snapshot, "Number of the world's snapshot.")
      .def_readonly("load", &AnswerCopy::load, "Number of what the arm carries.")
      .def_readonly("refused_load", &AnswerCopy::refused_load, "Number of the last refused load.")
      .def_readonly("load_refusal", &AnswerCopy::load_refusal, "Why it was refused.")
      .def_property_readonly("series", array(&AnswerCopy::series),
                             "The planner's own figures, in the order of Controller.series_names;\n"
                             "NaN where it set none.")
      .def("__repr__", [](const PyAnswer& a) {
        return fmt::format("<hamelin.Answer {}, goal {}{}>", state_name(a), a.goal_index,
                           a.cause.empty() ? "" : ": " + a.cause);
      });
}

}  // namespace hamelin::python
