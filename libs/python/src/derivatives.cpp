#include "derivatives.hpp"

#include <array>

#include "frame_arguments.hpp"
#include "hamelin/dynamics/regressor.hpp"
#include "states.hpp"

namespace hamelin::python {

namespace {

using dynamics::DerivativesWorkspace;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Three n × n matrices at each state: f(ws, q, v, x, matrices).
template <class F>
py::tuple three_matrices(BoundModel& bound, const char* function, std::array<const char*, 3> names,
                         std::array<py::handle, 3> given, const F& f) {
  const py::ssize_t dof = bound.model.dof();
  States in(function, dof);
  for (std::size_t i = 0; i < 3; ++i) in.add(names[i], given[i]);
  std::vector<py::ssize_t> shape{dof, dof};
  if (!in.single()) shape.insert(shape.begin(), in.count());
  std::array<py::array_t<double>, 3> out;
  std::array<double*, 3> data{};
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = py::array_t<double>(shape);
    data[i] = out[i].mutable_data();
  }
  const auto fill = [&](DerivativesWorkspace& ws) {
    std::array<Eigen::VectorXd, 3> x;
    std::array<Eigen::MatrixXd, 3> matrices;
    for (auto& each : x) each.resize(dof);
    for (auto& each : matrices) each.resize(dof, dof);
    for (py::ssize_t s = 0; s < in.count(); ++s) {
      f(ws, in.row(0, s, x[0]), in.row(1, s, x[1]), in.row(2, s, x[2]), matrices);
      for (std::size_t i = 0; i < 3; ++i)
        Eigen::Map<RowMatrix>(data[i] + s * dof * dof, dof, dof) = matrices[i];
    }
  };
  if (in.count() < states_without_lock) {
    fill(bound.derivatives());
  } else {
    const py::gil_scoped_release unlocked;
    DerivativesWorkspace ws(bound.model);
    fill(ws);
  }
  return py::make_tuple(out[0], out[1], out[2]);
}

py::tuple rnea_derivatives(BoundModel& bound, py::handle q, py::handle v, py::handle a,
                           py::handle wrenches) {
  const auto given = wrenches_of("rnea_derivatives", wrenches);
  return three_matrices(bound, "rnea_derivatives", {"q", "v", "a"}, {q, v, a},
                        [&](auto& ws, const auto& x, const auto& y, const auto& z, auto& out) {
                          dynamics::inverse_dynamics_derivatives(bound.model, ws, x, y, z, given,
                                                                 out[0], out[1], out[2]);
                        });
}

py::tuple aba_derivatives(BoundModel& bound, py::handle q, py::handle v, py::handle tau,
                          py::handle wrenches) {
  const auto given = wrenches_of("aba_derivatives", wrenches);
  Eigen::VectorXd acceleration(bound.model.dof());
  return three_matrices(bound, "aba_derivatives", {"q", "v", "tau"}, {q, v, tau},
                        [&](auto& ws, const auto& x, const auto& y, const auto& z, auto& out) {
                          dynamics::forward_dynamics_derivatives(bound.model, ws, x, y, z, given,
                                                                 acceleration, out[0], out[1],
                                                                 out[2]);
                        });
}

py::array_t<double> regressor(BoundModel& bound, py::handle q, py::handle v, py::handle a) {
  const py::ssize_t dof = bound.model.dof();
  States in("regressor", dof);
  in.add("q", q);
  in.add("v", v);
  in.add("a", a);
  const py::ssize_t count = dynamics::inertial_parameters_per_link * dof;
  return for_each_three(bound, in, {dof, count},
                        [&, Y = Eigen::MatrixXd(dof, count)](auto& ws, const auto& x, const auto& y,
                                                             const auto& z, double* out) mutable {
                          dynamics::inverse_dynamics_regressor(bound.model, ws, x, y, z, Y);
                          Eigen::Map<RowMatrix>(out, dof, count) = Y;
                        });
}

SharedModel with_parameters(const BoundModel& bound, py::handle parameters) {
  const Eigen::VectorXd given =
      vector_of("with_inertial_parameters", "parameters", parameters,
                dynamics::inertial_parameters_per_link * bound.model.dof());
  return std::make_shared<BoundModel>(
      model::Model(dynamics::with_inertial_parameters(bound.model, given), bound.model.base(),
                   bound.model.gravity()));
}

}  // namespace

void add_derivatives(py::class_<BoundModel, SharedModel>& type) {
  using py::arg;
  type.def("rnea_derivatives", &rnea_derivatives, arg("q"), arg("v"), arg("a"), py::kw_only(),
           arg("wrenches") = py::none(),
           "Derivatives of rnea by q, v and a: three matrices of shape (n, n) or (N, n, n), row i\n"
           "the torque of joint i. Wrenches count as constant in their terms.")
      .def("aba_derivatives", &aba_derivatives, arg("q"), arg("v"), arg("tau"), py::kw_only(),
           arg("wrenches") = py::none(),
           "Derivatives of aba by q, v and tau, as rnea_derivatives; the last is the inverse mass\n"
           "matrix.")
      .def("regressor", &regressor, arg("q"), arg("v"), arg("a"),
           "Y with Y @ inertial_parameters = rnea(q, v, a) for robots without rotor inertias,\n"
           "shape (n, 10 n) or (N, n, 10 n).")
      .def_property_readonly(
          "inertial_parameters",
          [](const BoundModel& m) { return to_array(dynamics::inertial_parameters(m.model)); },
          "Mass, first moment x, y, z and inertia xx, yy, zz, xy, xz, yz of each link about the\n"
          "origin of its joint-aligned frame, shape (10 n,) [kg, kg m, kg m^2].")
      .def("with_inertial_parameters", &with_parameters, arg("parameters"),
           "A model of the same robot with other masses, centres of mass and inertias.");
}

}  // namespace hamelin::python
