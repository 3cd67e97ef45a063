#include "wrenches.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "frame_arguments.hpp"
#include "states.hpp"

namespace hamelin::python {

namespace {

std::shared_ptr<PyWrench> make_wrench(const BoundModel& bound, py::handle frame, py::handle force,
                                      py::handle moment, std::string_view reference) {
  dynamics::ExternalWrench out{frame_index("wrench", bound.model, frame),
                               reference_of("wrench", reference), dynamics::Vector6d::Zero()};
  if (!moment.is_none()) out.wrench.head<3>() = vector3_of("wrench", "moment", moment);
  if (!force.is_none()) out.wrench.tail<3>() = vector3_of("wrench", "force", force);
  return boxed(out);
}

py::array_t<double> external_torque(BoundModel& bound, py::handle q, py::handle wrenches) {
  const py::ssize_t dof = bound.model.dof();
  const auto given = wrenches_of("external_torque", wrenches);
  States in("external_torque", dof);
  in.add("q", q);
  return for_each_state(bound, in, {dof},
                        [&, x = Eigen::VectorXd()](auto& ws, py::ssize_t i, double* y) mutable {
                          dynamics::external_torque(bound.model, ws, in.row(0, i, x), given,
                                                    Eigen::Map<Eigen::VectorXd>(y, dof));
                        });
}

}  // namespace

std::vector<dynamics::ExternalWrench> wrenches_of(const char* function, py::handle given) {
  std::vector<dynamics::ExternalWrench> out;
  if (given.is_none()) return out;
  for (const auto& item : py::reinterpret_borrow<py::object>(given)) {
    py::detail::make_caster<PyWrench> wrench;
    if (item.is_none() || !wrench.load(item, false))
      throw py::type_error(
          fmt::format("{}: wrenches: expected wrenches, as Model.wrench() makes them", function));
    out.push_back(py::detail::cast_op<const PyWrench&>(wrench));
  }
  return out;
}

void add_wrenches(py::module_& module, py::class_<BoundModel, SharedModel>& type) {
  using py::arg;
  py::class_<PyWrench, std::shared_ptr<PyWrench>>(
      module, "Wrench", "A wrench on the link of a frame. Model.wrench() makes one.")
      .def_property_readonly(
          "frame", [](const PyWrench& w) { return w.frame; }, "Index into Model.frame_names.")
      .def_property_readonly(
          "reference", [](const PyWrench& w) { return dynamics::name_of(w.reference); },
          "'world', 'local' or 'local_world_aligned'.")
      .def_property_readonly(
          "wrench", [](const PyWrench& w) { return to_array(Eigen::VectorXd(w.wrench)); },
          "Moment, then force, shape (6,) [Nm, N]; a copy.")
      .def("__repr__", [](const PyWrench& w) {
        return fmt::format("<hamelin.Wrench on frame {}, {}: moment [{:.6g}], force [{:.6g}]>",
                           w.frame, dynamics::name_of(w.reference),
                           fmt::join(w.wrench.data(), w.wrench.data() + 3, ", "),
                           fmt::join(w.wrench.data() + 3, w.wrench.data() + 6, ", "));
      });
  type.def("wrench", &make_wrench, arg("frame") = py::none(), py::kw_only(),
           arg("force") = py::none(), arg("moment") = py::none(),
           arg("reference") = "local_world_aligned",
           "Makes a wrench that the surroundings exert on the link of a frame.\n\n"
           "frame: as in frame_pose. force, moment: shape (3,) [N], [Nm]; None: zero.\n"
           "reference: 'local_world_aligned', at the frame's origin in world axes; 'local', in\n"
           "the frame's axes, with which it turns; 'world', the moment about the world's origin.")
      .def("external_torque", &external_torque, arg("q"), arg("wrenches"),
           "Joint torques that wrenches exert, sum of J^T (moment, force), shape (n,) or (N, n)\n"
           "[Nm or N].");
}

}  // namespace hamelin::python
