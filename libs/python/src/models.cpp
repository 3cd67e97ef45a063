#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <limits>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "derivatives.hpp"
#include "frame_arguments.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/centroidal.hpp"
#include "hamelin/dynamics/dynamics_batch.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/scene/shapes.hpp"
#include "kinematics.hpp"
#include "module.hpp"
#include "states.hpp"
#include "wrenches.hpp"

namespace hamelin::python {

namespace {

using dynamics::StatesXd;

// A call of three joint vectors with kernels for one state and for many.
template <class Single, class Many>
py::array_t<double> call_in_lanes(BoundModel& bound, const States& in, const Single& single,
                                  const Many& many) {
  const py::ssize_t dof = in.dof();
  if (in.single()) {
    auto out = new_array({dof});
    Eigen::Map<Eigen::VectorXd> y(out.mutable_data(), dof);
    single(bound.ws, Eigen::Map<const Eigen::VectorXd>(in[0].data(), dof),
           Eigen::Map<const Eigen::VectorXd>(in[1].data(), dof),
           Eigen::Map<const Eigen::VectorXd>(in[2].data(), dof), y);
    return out;
  }
  const py::ssize_t count = in.count();
  if (in.by_columns()) {  // in place
    py::array_t<double> out(py::array::ShapeContainer{count, dof},
                            py::array::StridesContainer{py::ssize_t{sizeof(double)},
                                                        py::ssize_t{sizeof(double)} * count});
    double* const y = out.mutable_data();
    const Unlocked unlocked(count);
    dynamics::BatchWorkspace ws(bound.model);
    const auto states = [&](std::size_t i) {
      return Eigen::Map<const StatesXd>(in[i].data(), dof, count);
    };
    many(ws, states(0), states(1), states(2), Eigen::Map<StatesXd>(y, dof, count));
    return out;
  }
  auto out = new_array({count, dof});
  double* const y = out.mutable_data();
  const Unlocked unlocked(count);
  dynamics::BatchWorkspace ws(bound.model);
  std::array<StatesXd, 4> block;
  for (auto& x : block) x.resize(dof, block_states);
  for (py::ssize_t first = 0; first < count; first += block_states) {
    const py::ssize_t states = std::min(block_states, count - first);
    for (std::size_t i = 0; i < 3; ++i) in.gather(i, first, states, block[i]);
    many(ws, block[0].leftCols(states), block[1].leftCols(states), block[2].leftCols(states),
         block[3].leftCols(states));
    for (py::ssize_t j = 0; j < dof; ++j) {
      const double* const from = block[3].data() + j * block_states;
      double* const to = y + first * dof + j;
      for (py::ssize_t i = 0; i < states; ++i) to[i * dof] = from[i];
    }
  }
  return out;
}

py::array_t<double> rnea(BoundModel& bound, py::handle q, py::handle v, py::handle a,
                         py::handle wrenches) {
  const auto given = wrenches_of("rnea", wrenches);
  States in("rnea", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  in.add("a", a);
  if (!given.empty())
    return for_each_three(bound, in, {in.dof()},
                          [&](auto& ws, const auto& x, const auto& y, const auto& z, double* out) {
                            dynamics::inverse_dynamics(bound.model, ws, x, y, z, given,
                                                       Eigen::Map<Eigen::VectorXd>(out, in.dof()));
                          });
  return call_in_lanes(
      bound, in,
      [&](auto& ws, const auto& x, const auto& y, const auto& z, auto& out) {
        dynamics::inverse_dynamics(bound.model, ws, x, y, z, out);
      },
      [&](auto& ws, const auto& x, const auto& y, const auto& z, auto&& out) {
        dynamics::inverse_dynamics(bound.model, ws, x, y, z, out);
      });
}

py::array_t<double> aba(BoundModel& bound, py::handle q, py::handle v, py::handle tau,
                        py::handle wrenches) {
  const auto given = wrenches_of("aba", wrenches);
  States in("aba", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  in.add("tau", tau);
  if (!given.empty())
    return for_each_three(bound, in, {in.dof()},
                          [&](auto& ws, const auto& x, const auto& y, const auto& z, double* out) {
                            dynamics::forward_dynamics(bound.model, ws, x, y, z, given,
                                                       Eigen::Map<Eigen::VectorXd>(out, in.dof()));
                          });
  return call_in_lanes(
      bound, in,
      [&](auto& ws, const auto& x, const auto& y, const auto& z, auto& out) {
        dynamics::forward_dynamics(bound.model, ws, x, y, z, out);
      },
      [&](auto& ws, const auto& x, const auto& y, const auto& z, auto&& out) {
        dynamics::forward_dynamics(bound.model, ws, x, y, z, out);
      });
}

using OfOne = void (*)(const model::Model&, dynamics::Workspace&, const dynamics::ConstVectorRef&,
                       dynamics::VectorRef);
using OfTwo = void (*)(const model::Model&, dynamics::Workspace&, const dynamics::ConstVectorRef&,
                       const dynamics::ConstVectorRef&, dynamics::VectorRef);

template <OfOne function>
py::array_t<double> joint_vector(BoundModel& bound, const char* name, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in(name, dof);
  in.add("q", q);
  return for_each_state(
      bound, in, {dof}, [&, x = Eigen::VectorXd()](auto& ws, py::ssize_t i, double* y) mutable {
        function(bound.model, ws, in.row(0, i, x), Eigen::Map<Eigen::VectorXd>(y, dof));
      });
}

template <OfTwo function>
py::array_t<double> joint_vector(BoundModel& bound, const char* name, py::handle q,
                                 const char* second, py::handle v) {
  const py::ssize_t dof = bound.model.dof();
  States in(name, dof);
  in.add("q", q);
  in.add(second, v);
  return for_each_state(bound, in, {dof},
                        [&, x = Eigen::VectorXd(), y = Eigen::VectorXd()](auto& ws, py::ssize_t i,
                                                                          double* out) mutable {
                          function(bound.model, ws, in.row(0, i, x), in.row(1, i, y),
                                   Eigen::Map<Eigen::VectorXd>(out, dof));
                        });
}

py::array_t<double> crba(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in("crba", dof);
  in.add("q", q);
  if (in.single()) {
    auto out = new_array({dof, dof});
    // symmetric, so that rows and columns are the same
    dynamics::mass_matrix(bound.model, bound.ws, in[0].vector(),
                          Eigen::Map<Eigen::MatrixXd>(out.mutable_data(), dof, dof));
    return out;
  }
  std::array<Blocks, 1> out{Blocks(in, dof, dof)};
  dynamics::DynamicsBatch batch(bound.model);
  evaluate_in_blocks(in, out, [&](const auto& given, const auto& results) {
    batch.mass_matrix(given(0), results(0));
  });
  return out[0].array();
}

// Energies of one state are numbers, of many states arrays.
template <class F>
py::object energies(BoundModel& bound, const States& in, const F& energy) {
  auto out = for_each_state(bound, in, {},
                            [&](auto& ws, py::ssize_t i, double* y) { *y = energy(ws, i); });
  if (in.single()) return py::float_(*out.data());
  return out;
}

py::object kinetic_energy(BoundModel& bound, py::handle q, py::handle v) {
  States in("kinetic_energy", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  Eigen::VectorXd x, y;
  return energies(bound, in, [&](auto& ws, py::ssize_t i) {
    return dynamics::kinetic_energy(bound.model, ws, in.row(0, i, x), in.row(1, i, y));
  });
}

py::object potential_energy(BoundModel& bound, py::handle q) {
  States in("potential_energy", bound.model.dof());
  in.add("q", q);
  Eigen::VectorXd x;
  return energies(bound, in, [&](auto& ws, py::ssize_t i) {
    return dynamics::potential_energy(bound.model, ws, in.row(0, i, x));
  });
}

py::array_t<double> per_joint(const BoundModel& bound, std::optional<double> model::Joint::*member,
                              double none) {
  Eigen::VectorXd x(bound.model.dof());
  for (int i = 0; i < bound.model.dof(); ++i)
    x[i] = (bound.model.robot().links[static_cast<std::size_t>(i)].joint.*member).value_or(none);
  return to_array(x);
}

py::array_t<double> per_joint(const BoundModel& bound, double model::Joint::*member) {
  Eigen::VectorXd x(bound.model.dof());
  for (int i = 0; i < bound.model.dof(); ++i)
    x[i] = bound.model.robot().links[static_cast<std::size_t>(i)].joint.*member;
  return to_array(x);
}

template <class F>
py::list names(const BoundModel& bound, const F& name) {
  py::list out;
  for (const auto& link : bound.model.robot().links) out.append(name(link));
  return out;
}

py::dict shapes(const BoundModel& bound) {
  const auto& all = bound.model.shapes();
  const auto count = static_cast<py::ssize_t>(all.size());
  py::array_t<std::int64_t> link(count);
  auto center = new_array({count, 3}), half_axis = new_array({count, 3}),
       radius = new_array({count});
  for (py::ssize_t i = 0; i < count; ++i) {
    const auto& shape = all[static_cast<std::size_t>(i)];
    link.mutable_data()[i] = shape.link;
    radius.mutable_data()[i] = shape.radius;
    for (int k = 0; k < 3; ++k) {
      center.mutable_data()[3 * i + k] = shape.center[k];
      half_axis.mutable_data()[3 * i + k] = shape.half_axis[k];
    }
  }
  py::dict out;
  out["link"] = link;
  out["center_m"] = center;
  out["half_axis_m"] = half_axis;
  out["radius_m"] = radius;
  return out;
}

SharedModel make_model(py::handle robot, py::handle base, py::handle gravity) {
  const Eigen::Vector3d g = gravity.is_none() ? Eigen::Vector3d(0.0, 0.0, -9.81)
                                              : vector3_of("Model", "gravity", gravity);
  const geometry::SE3 pose = pose_of("Model", "base", base);
  return std::make_shared<BoundModel>(
      model::Model(description::robot_from_json(to_json(robot), "Model: robot"), pose, g));
}

SharedModel make_chain(int links, const std::string& axes, double length_m, double mass_kg,
                       double radius_m, py::handle base, py::handle gravity) {
  const Eigen::Vector3d g = gravity.is_none() ? Eigen::Vector3d(0.0, 0.0, -9.81)
                                              : vector3_of("make_chain", "gravity", gravity);
  return std::make_shared<BoundModel>(
      model::Model(model::make_chain({links, axes, length_m, mass_kg, radius_m}),
                   pose_of("make_chain", "base", base), g));
}

std::string repr_of_model(const BoundModel& bound) {
  return fmt::format("<hamelin.Model '{}': {} joints, {}, {:.4g} kg, {} collision shapes>",
                     bound.model.robot().name, bound.model.dof(),
                     bound.model.planar() ? "planar" : "spatial", dynamics::total_mass(bound.model),
                     bound.model.shapes().size());
}

py::tuple state_of(const BoundModel& bound) {
  return py::make_tuple(description::robot_to_json(bound.model.robot()).dump(),
                        to_array(bound.model.base()),
                        to_array(Eigen::Vector3d(bound.model.gravity())));
}

SharedModel from_state(const py::tuple& state) {
  if (state.size() != 3) throw py::value_error("Model: the state of a pickle has three parts");
  const Json robot = parse_json(state[0].cast<std::string>(), "Model: pickle");
  return std::make_shared<BoundModel>(
      model::Model(description::robot_from_json(robot, "Model: pickle"),
                   pose_of("Model", "base", state[1]), vector3_of("Model", "gravity", state[2])));
}

void add_joint_properties(py::class_<BoundModel, SharedModel>& type) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  using Joint = model::Joint;
  type.def_property_readonly(
          "joint_names",
          [](const BoundModel& m) { return names(m, [](const auto& l) { return l.joint.name; }); },
          "Names of the joints, from the base to the tip.")
      .def_property_readonly(
          "joint_types",
          [](const BoundModel& m) {
            return names(m, [](const auto& l) {
              return std::string(l.joint.type == model::JointType::revolute ? "revolute"
                                                                            : "prismatic");
            });
          },
          "'revolute' or 'prismatic' for each joint.")
      .def_property_readonly(
          "lower", [](const BoundModel& m) { return per_joint(m, &Joint::lower, -infinity); },
          "Lower position limits, shape (n,) [rad or m]; -inf without a limit.")
      .def_property_readonly(
          "upper", [](const BoundModel& m) { return per_joint(m, &Joint::upper, infinity); },
          "Upper position limits, shape (n,) [rad or m]; inf without a limit.")
      .def_property_readonly(
          "velocity_max",
          [](const BoundModel& m) { return per_joint(m, &Joint::velocity_max, infinity); },
          "Velocity limits, shape (n,) [rad/s or m/s]; inf without a limit.")
      .def_property_readonly(
          "effort_max",
          [](const BoundModel& m) { return per_joint(m, &Joint::effort_max, infinity); },
          "Effort limits, shape (n,) [Nm or N]; inf without a limit.")
      .def_property_readonly(
          "damping", [](const BoundModel& m) { return per_joint(m, &Joint::damping); },
          "Viscous damping, shape (n,) [Nms/rad or Ns/m]; not part of the dynamics below.")
      .def_property_readonly(
          "friction", [](const BoundModel& m) { return per_joint(m, &Joint::friction); },
          "Dry friction, shape (n,) [Nm or N]; not part of the dynamics below.")
      .def_property_readonly(
          "armature", [](const BoundModel& m) { return per_joint(m, &Joint::armature); },
          "Rotor inertia at the joints, shape (n,) [kg m^2 or kg].");
}

void add_properties(py::class_<BoundModel, SharedModel>& type) {
  type.def_property_readonly(
          "name", [](const BoundModel& m) { return m.model.robot().name; }, "Name of the robot.")
      .def_property_readonly(
          "dof", [](const BoundModel& m) { return m.model.dof(); }, "Number of joints n.")
      .def_property_readonly(
          "planar", [](const BoundModel& m) { return m.model.planar(); },
          "Whether all joints move in one plane; the algorithms then use SE(2).")
      .def_property_readonly(
          "link_names",
          [](const BoundModel& m) { return names(m, [](const auto& l) { return l.name; }); },
          "Names of the moving links, from the base to the tip.")
      .def_property_readonly(
          "tip_name", [](const BoundModel& m) { return m.model.robot().tip.name; },
          "Name of the frame that goals refer to.")
      .def_property_readonly(
          "mass", [](const BoundModel& m) { return dynamics::total_mass(m.model); },
          "Mass of all moving links [kg].")
      .def_property_readonly(
          "reach", [](const BoundModel& m) { return m.model.reach(); },
          "Upper bound of the distance from the base to any point [m].")
      .def_property_readonly(
          "base", [](const BoundModel& m) { return to_array(m.model.base()); },
          "Pose of the base in the world, shape (4, 4).")
      .def_property_readonly(
          "gravity",
          [](const BoundModel& m) { return to_array(Eigen::Vector3d(m.model.gravity())); },
          "Acceleration of free fall in the world, shape (3,) [m/s^2].")
      .def_property_readonly("shapes", &shapes,
                             "Collision shapes as a dict of arrays: 'link' (index), 'center_m' and "
                             "'half_axis_m' in the link's joint-aligned frame, 'radius_m'.")
      .def_property_readonly(
          "notes", [](const BoundModel& m) { return m.model.robot().notes; },
          "What the reader of the robot file lumped, locked or skipped.")
      .def_property_readonly(
          "warnings", [](const BoundModel& m) { return m.model.robot().warnings; },
          "Doubtful input that the reader accepted.");
}

void add_dynamics(py::class_<BoundModel, SharedModel>& type) {
  using py::arg;
  type.def("rnea", &rnea, arg("q"), arg("v"), arg("a"), py::kw_only(), arg("wrenches") = py::none(),
           "Inverse dynamics: tau = M(q) a + C(q, v) v + dU(q) [Nm or N].\n\n"
           "wrenches: of the surroundings, as wrench() makes them; the joints exert less by\n"
           "external_torque(q, wrenches).\n"
           "q, v, a: shape (n,), or (N, n) for N states in SIMD lanes. Returns the same shape.\n"
           "Arrays (N, n) in Fortran order are used in place; arrays in C order are transposed\n"
           "block by block.")
      .def("aba", &aba, arg("q"), arg("v"), arg("tau"), py::kw_only(), arg("wrenches") = py::none(),
           "Forward dynamics: the acceleration a with rnea(q, v, a) = tau [rad/s^2 or m/s^2].\n\n"
           "wrenches: as in rnea.\n"
           "q, v, tau: shape (n,), or (N, n) for N states in SIMD lanes, as in rnea. Returns the\n"
           "same shape.")
      .def("crba", &crba, arg("q"),
           "Mass matrix M(q), shape (n, n); or (N, n, n) for q of shape (N, n), of states in SIMD\n"
           "lanes, in Fortran order if q is.")
      .def(
          "gravity_torque",
          [](BoundModel& m, py::handle q) {
            return joint_vector<&dynamics::gravity_torque>(m, "gravity_torque", q);
          },
          arg("q"), "Torque dU(q) that holds the arm against gravity, shape (n,) or (N, n).")
      .def(
          "bias_torque",
          [](BoundModel& m, py::handle q, py::handle v) {
            return joint_vector<&dynamics::bias_torque>(m, "bias_torque", q, "v", v);
          },
          arg("q"), arg("v"), "C(q, v) v + dU(q), shape (n,) or (N, n) [Nm or N].")
      .def(
          "momentum",
          [](BoundModel& m, py::handle q, py::handle v) {
            return joint_vector<&dynamics::momentum>(m, "momentum", q, "v", v);
          },
          arg("q"), arg("v"), "Momentum M(q) v, shape (n,) or (N, n) [Nm s or N s].")
      .def(
          "solve_mass",
          [](BoundModel& m, py::handle q, py::handle y) {
            return joint_vector<&dynamics::solve_mass>(m, "solve_mass", q, "y", y);
          },
          arg("q"), arg("y"), "x with M(q) x = y, in O(n), shape (n,) or (N, n).")
      .def("kinetic_energy", &kinetic_energy, arg("q"), arg("v"),
           "Kinetic energy [J]: a number, or shape (N,) for N states.")
      .def("potential_energy", &potential_energy, arg("q"),
           "Potential energy of gravity [J]: a number, or shape (N,) for N states.");
}

}  // namespace

void add_models(py::module_& module) {
  py::class_<BoundModel, SharedModel> type(
      module, "Model",
      "A robot placed in a world, prepared for the algorithms of dynamics.\n\n"
      "load_robot() makes one from a file. Immutable; pickles. A joint vector has shape (n,); N\n"
      "states have shape (N, n). Arguments are not checked for NaN or infinity, and give results\n"
      "that are not finite. Calls with 16 states or more release Python's lock.");
  type.def(py::init(&make_model), py::arg("robot"), py::kw_only(), py::arg("base") = py::none(),
           py::arg("gravity") = py::none(),
           "Makes a model from a document of schema hamelin.robot/1, as to_dict() returns it.\n\n"
           "base: pose of the robot's base in the world, shape (4, 4); None: identity.\n"
           "gravity: shape (3,) [m/s^2]; None: (0, 0, -9.81).");
  add_properties(type);
  add_joint_properties(type);
  add_dynamics(type);
  add_derivatives(type);
  add_kinematics(type);
  add_wrenches(module, type);
  type.def(
          "to_dict",
          [](const BoundModel& m) {
            return to_python(description::robot_to_json(m.model.robot()));
          },
          "The robot as a document of schema hamelin.robot/1, without base and gravity.")
      .def("__repr__", &repr_of_model)
      .def(py::pickle(&state_of, &from_state));
  module.def(
      "make_chain", &make_chain, py::kw_only(), py::arg("links") = 7, py::arg("axes") = "x,z,x",
      py::arg("length_m") = 0.2, py::arg("mass_kg") = 1.0, py::arg("radius_m") = 0.03,
      py::arg("base") = py::none(), py::arg("gravity") = py::none(),
      "Makes a chain of equal links along +y.\n\n"
      "axes: joint axes at q = 0, repeated cyclically. length_m, mass_kg, radius_m: of each\n"
      "link, a solid cylinder. base, gravity: as for Model.");
}

}  // namespace hamelin::python
