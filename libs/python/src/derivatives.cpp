#include "derivatives.hpp"

#include <array>
#include <utility>

#include "frame_arguments.hpp"
#include "hamelin/dynamics/dynamics_batch.hpp"
#include "hamelin/dynamics/regressor.hpp"
#include "states.hpp"

namespace hamelin::python {

namespace {

using dynamics::DerivativesWorkspace;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

using Three = std::array<py::array_t<double>, 3>;

void transpose_in_place(double* matrix, py::ssize_t n) {
  for (py::ssize_t i = 0; i < n; ++i)
    for (py::ssize_t j = 0; j < i; ++j) std::swap(matrix[i * n + j], matrix[j * n + i]);
}

// Three n × n matrices at each state, one after the other: f(ws, q, v, x, matrices).
template <class F>
Three one_by_one(BoundModel& bound, const States& in, const F& f) {
  const py::ssize_t dof = in.dof();
  const auto made = [&] {
    return in.single() ? new_array({dof, dof}) : new_array({in.count(), dof, dof});
  };
  Three out{made(), made(), made()};
  const std::array<double*, 3> data{out[0].mutable_data(), out[1].mutable_data(),
                                    out[2].mutable_data()};
  const auto fill = [&](DerivativesWorkspace& ws) {
    std::array<Eigen::VectorXd, 3> x;
    for (py::ssize_t s = 0; s < in.count(); ++s) {
      const auto matrix = [&](std::size_t i) {
        return Eigen::Map<Eigen::MatrixXd>(data[i] + s * dof * dof, dof, dof);
      };
      f(ws, in.row(0, s, x[0]), in.row(1, s, x[1]), in.row(2, s, x[2]), matrix);
      for (std::size_t i = 0; i < 3; ++i)
        transpose_in_place(data[i] + s * dof * dof, dof);  // to C order
    }
  };
  if (in.count() < states_without_lock) {
    fill(bound.derivatives());
  } else {
    const py::gil_scoped_release unlocked;
    DerivativesWorkspace ws(bound.model);
    fill(ws);
  }
  return out;
}

// The same in SIMD lanes: f(batch, given, results).
template <class F>
Three in_lanes(const BoundModel& bound, const States& in, const F& f) {
  const py::ssize_t dof = in.dof();
  std::array<Blocks, 3> out{Blocks(in, dof, dof), Blocks(in, dof, dof), Blocks(in, dof, dof)};
  dynamics::DynamicsBatch batch(bound.model);
  evaluate_in_blocks(in, out,
                     [&](const auto& given, const auto& results) { f(batch, given, results); });
  return {out[0].array(), out[1].array(), out[2].array()};
}

py::tuple tuple_of(const Three& matrices) {
  return py::make_tuple(matrices[0], matrices[1], matrices[2]);
}

py::tuple rnea_derivatives(BoundModel& bound, py::handle q, py::handle v, py::handle a,
                           py::handle wrenches) {
  const auto external = wrenches_of("rnea_derivatives", wrenches);
  States in("rnea_derivatives", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  in.add("a", a);
  if (!in.single() && external.empty())
    return tuple_of(in_lanes(bound, in, [](auto& batch, const auto& given, const auto& results) {
      batch.inverse_dynamics_derivatives(given(0), given(1), given(2), results(0), results(1),
                                         results(2));
    }));
  return tuple_of(one_by_one(
      bound, in, [&](auto& ws, const auto& x, const auto& y, const auto& z, const auto& out) {
        dynamics::inverse_dynamics_derivatives(bound.model, ws, x, y, z, external, out(0), out(1),
                                               out(2));
      }));
}

py::tuple aba_derivatives(BoundModel& bound, py::handle q, py::handle v, py::handle tau,
                          py::handle wrenches) {
  const auto external = wrenches_of("aba_derivatives", wrenches);
  States in("aba_derivatives", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  in.add("tau", tau);
  if (!in.single() && external.empty()) {
    dynamics::StatesXd acceleration;
    return tuple_of(in_lanes(bound, in, [&](auto& batch, const auto& given, const auto& results) {
      acceleration.resize(given(0).rows(), given(0).outerStride());
      batch.forward_dynamics_derivatives(given(0), given(1), given(2),
                                         acceleration.leftCols(given(0).cols()), results(0),
                                         results(1), results(2));
    }));
  }
  Eigen::VectorXd acceleration(in.dof());
  return tuple_of(one_by_one(
      bound, in, [&](auto& ws, const auto& x, const auto& y, const auto& z, const auto& out) {
        dynamics::forward_dynamics_derivatives(bound.model, ws, x, y, z, external, acceleration,
                                               out(0), out(1), out(2));
      }));
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
  type.def(
          "rnea_derivatives", &rnea_derivatives, arg("q"), arg("v"), arg("a"), py::kw_only(),
          arg("wrenches") = py::none(),
          "Derivatives of rnea by q, v and a: three matrices of shape (n, n) or (N, n, n), row i\n"
          "the torque of joint i. Wrenches count as constant in their terms.\n"
          "N states without wrenches are computed in SIMD lanes; the results are in Fortran order\n"
          "if q, v and a are.")
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
