#include "kinematics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "frame_arguments.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/dynamics/centroidal.hpp"
#include "hamelin/dynamics/frame_batch.hpp"
#include "hamelin/dynamics/frames.hpp"
#include "states.hpp"

namespace hamelin::python {

namespace {

using dynamics::Reference;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void write_pose(const geometry::SE3& pose, double* out) {
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(out);
  matrix = pose.matrix();
}

// The place of an element of a list that is given by its name or index.
template <class List>
int index_of(const char* function, const char* argument, py::handle given, const List& list,
             const char* what) {
  if (PyUnicode_Check(given.ptr()) != 0) {
    const auto name = given.cast<std::string_view>();
    for (std::size_t i = 0; i < list.size(); ++i)
      if (list[i].name == name) return static_cast<int>(i);
    const std::vector<std::string> names = names_of(list);
    refuse(function, argument,
           fmt::format("'{}' is not {}, expected one of {}{}", name, what, fmt::join(names, ", "),
                       did_you_mean(name, names)));
  }
  if (PyIndex_Check(given.ptr()) == 0)
    throw py::type_error(
        fmt::format("{}: {}: expected a name, an index or None", function, argument));
  const py::ssize_t index = PyNumber_AsSsize_t(given.ptr(), PyExc_IndexError);
  if (index == -1 && PyErr_Occurred() != nullptr) throw py::error_already_set();
  if (index < 0 || index >= static_cast<py::ssize_t>(list.size()))
    refuse(function, argument, fmt::format("{}, expected 0 to {}", index, list.size() - 1));
  return static_cast<int>(index);
}

std::optional<int> link_of(const char* function, const model::Model& model, py::handle link) {
  if (link.is_none()) return std::nullopt;
  return index_of(function, "link", link, model.robot().links, "a moving link");
}

py::array_t<double> forward_kinematics(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in("forward_kinematics", dof);
  in.add("q", q);
  return for_each_posture(bound, in, {dof, 4, 4}, [&](auto& ws, double* y) {
    for (int link = 0; link < dof; ++link)
      write_pose(dynamics::link_pose(bound.model, ws, link), y + 16 * link);
  });
}

py::array_t<double> tip_pose(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in("tip_pose", dof);
  in.add("q", q);
  return for_each_posture(bound, in, {4, 4}, [&](auto& ws, double* y) {
    write_pose(dynamics::tip_pose(bound.model, ws), y);
  });
}

py::array_t<double> frame_pose(BoundModel& bound, py::handle q, py::handle frame) {
  const py::ssize_t dof = bound.model.dof();
  const int index = frame_index("frame_pose", bound.model, frame);
  States in("frame_pose", dof);
  in.add("q", q);
  if (in.single())
    return for_each_posture(bound, in, {4, 4}, [&](auto& ws, double* y) {
      write_pose(dynamics::frame_pose(bound.model, ws, index), y);
    });
  Blocks out(in, 4, 4);
  dynamics::FrameBatch batch(bound.model, index);
  const std::array<double, block_states> zeros{};
  std::array<double, block_states> ones;
  ones.fill(1.0);
  const Unlocked unlocked(in.count());
  dynamics::StatesXd at(dof, block_states), poses(12, block_states);
  for (py::ssize_t first = 0; first < in.count(); first += block_states) {
    const py::ssize_t states = std::min(block_states, in.count() - first);
    in.gather(0, first, states, at);
    batch.poses(at.leftCols(states), poses.leftCols(states));
    for (py::ssize_t column = 0; column < 4; ++column) {
      for (py::ssize_t row = 0; row < 3; ++row)
        out.write(first, states, row, column, poses.row(3 * column + row).data());
      out.write(first, states, 3, column, (column < 3 ? zeros : ones).data());
    }
  }
  return out.array();
}

py::array_t<double> frame_poses(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  const auto count = static_cast<int>(bound.model.frames().size());
  States in("frame_poses", dof);
  in.add("q", q);
  return for_each_posture(bound, in, {count, 4, 4}, [&](auto& ws, double* y) {
    for (int frame = 0; frame < count; ++frame)
      write_pose(dynamics::frame_pose(bound.model, ws, frame), y + 16 * frame);
  });
}

py::array_t<double> frame_jacobian(BoundModel& bound, py::handle q, py::handle frame,
                                   std::string_view reference) {
  const py::ssize_t dof = bound.model.dof();
  const int index = frame_index("frame_jacobian", bound.model, frame);
  const Reference terms = reference_of("frame_jacobian", reference);
  States in("frame_jacobian", dof);
  in.add("q", q);
  if (in.single())
    return for_each_posture(bound, in, {6, dof},
                            [&, J = dynamics::Matrix6Xd(6, dof)](auto& ws, double* y) mutable {
                              dynamics::frame_jacobian(bound.model, ws, index, terms, J);
                              Eigen::Map<RowMatrix>(y, 6, dof) = J;
                            });
  std::array<Blocks, 1> out{Blocks(in, 6, dof)};
  dynamics::FrameBatch batch(bound.model, index, {.reference = terms});
  evaluate_in_blocks(in, out, [&](const auto& given, const auto& results) {
    batch.jacobians(given(0), results(0));
  });
  return out[0].array();
}

// A twist or its rate at each state: f(ws, rows of the arguments).
template <class F>
py::array_t<double> twists(BoundModel& bound, const States& in, const F& f) {
  std::array<Eigen::VectorXd, 3> x;
  return for_each_state(bound, in, {6}, [&](auto& ws, py::ssize_t i, double* y) {
    dynamics::forward_kinematics(bound.model, ws, in.row(0, i, x[0]));
    Eigen::Map<dynamics::Vector6d> out(y);
    out = f(ws, [&](std::size_t argument) { return in.row(argument, i, x[argument]); });
  });
}

py::array_t<double> frame_velocity(BoundModel& bound, py::handle q, py::handle v, py::handle frame,
                                   std::string_view reference) {
  const int index = frame_index("frame_velocity", bound.model, frame);
  const Reference terms = reference_of("frame_velocity", reference);
  States in("frame_velocity", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  return twists(bound, in, [&](auto& ws, const auto& row) {
    return dynamics::frame_velocity(bound.model, ws, index, terms, row(1));
  });
}

py::array_t<double> frame_drift(BoundModel& bound, py::handle q, py::handle v, py::handle frame,
                                std::string_view reference) {
  const int index = frame_index("frame_drift", bound.model, frame);
  const Reference terms = reference_of("frame_drift", reference);
  States in("frame_drift", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  return twists(bound, in, [&](auto& ws, const auto& row) {
    return dynamics::frame_drift(bound.model, ws, index, terms, row(1));
  });
}

py::array_t<double> frame_acceleration(BoundModel& bound, py::handle q, py::handle v, py::handle a,
                                       py::handle frame, std::string_view reference) {
  const int index = frame_index("frame_acceleration", bound.model, frame);
  const Reference terms = reference_of("frame_acceleration", reference);
  States in("frame_acceleration", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  in.add("a", a);
  return twists(bound, in, [&](auto& ws, const auto& row) {
    return dynamics::frame_acceleration(bound.model, ws, index, terms, row(1), row(2));
  });
}

py::array_t<double> jacobian(BoundModel& bound, py::handle q, py::handle link, py::handle point) {
  const py::ssize_t dof = bound.model.dof();
  const auto chosen = link_of("jacobian", bound.model, link);
  const int index = chosen.value_or(bound.model.robot().tip.link);
  std::optional<Eigen::Vector3d> in_link;
  if (!point.is_none()) in_link = vector3_of("jacobian", "point", point);
  States in("jacobian", dof);
  in.add("q", q);
  return for_each_posture(
      bound, in, {6, dof}, [&, J = dynamics::Matrix6Xd(6, dof)](auto& ws, double* y) mutable {
        const Eigen::Vector3d at = in_link
                                       ? dynamics::point_position(bound.model, ws, index, *in_link)
                                   : chosen ? dynamics::link_pose(bound.model, ws, index).p()
                                            : dynamics::tip_pose(bound.model, ws).p();
        dynamics::frame_jacobian(bound.model, ws, index, at, J);
        Eigen::Map<RowMatrix>(y, 6, dof) = J;
      });
}

py::array_t<double> shape_centers(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in("shape_centers", dof);
  in.add("q", q);
  const auto count = static_cast<py::ssize_t>(bound.model.shapes().size());
  return for_each_posture(bound, in, {count, 3},
                          [&, centers = std::vector<Eigen::Vector3d>(bound.model.shapes().size())](
                              auto& ws, double* y) mutable {
                            dynamics::shape_centers(bound.model, ws, centers);
                            for (std::size_t s = 0; s < centers.size(); ++s)
                              Eigen::Map<Eigen::Vector3d>(y + 3 * s) = centers[s];
                          });
}

py::array_t<double> center_of_mass(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in("center_of_mass", dof);
  in.add("q", q);
  return for_each_posture(bound, in, {3}, [&](auto& ws, double* y) {
    Eigen::Map<Eigen::Vector3d> out(y);
    out = dynamics::center_of_mass(bound.model, ws);
  });
}

py::array_t<double> centroidal_momentum(BoundModel& bound, py::handle q, py::handle v) {
  States in("centroidal_momentum", bound.model.dof());
  in.add("q", q);
  in.add("v", v);
  return twists(bound, in, [&](auto& ws, const auto& row) {
    return dynamics::centroidal_momentum(bound.model, ws, row(1));
  });
}

py::array_t<double> centroidal_matrix(BoundModel& bound, py::handle q) {
  const py::ssize_t dof = bound.model.dof();
  States in("centroidal_matrix", dof);
  in.add("q", q);
  return for_each_posture(bound, in, {6, dof},
                          [&, A = dynamics::Matrix6Xd(6, dof)](auto& ws, double* y) mutable {
                            dynamics::centroidal_matrix(bound.model, ws, A);
                            Eigen::Map<RowMatrix>(y, 6, dof) = A;
                          });
}

void add_centroidal(py::class_<BoundModel, SharedModel>& type) {
  using py::arg;
  type.def("center_of_mass", &center_of_mass, arg("q"),
           "Centre of mass of all moving links in the world, shape (3,) or (N, 3) [m].")
      .def("centroidal_momentum", &centroidal_momentum, arg("q"), arg("v"),
           "Momentum of all moving links: angular about their centre of mass, then linear, world\n"
           "axes, shape (6,) or (N, 6) [Nm s, N s]. Rotors do not count.")
      .def("centroidal_matrix", &centroidal_matrix, arg("q"),
           "A with A v the centroidal momentum, shape (6, n) or (N, 6, n).");
}

void add_frames(py::class_<BoundModel, SharedModel>& type) {
  using py::arg;
  constexpr const char* aligned = "local_world_aligned";
  type.def_property_readonly(
          "frame_names",
          [](const BoundModel& m) {
            py::list out;
            for (const auto& frame : m.model.frames()) out.append(frame.name);
            return out;
          },
          "Names of the frames: the tip, then those of the links of the robot's file, also of\n"
          "links that do not move or were lumped into others.")
      .def("frame_pose", &frame_pose, arg("q"), arg("frame") = py::none(),
           "World pose of a frame, shape (4, 4) or (N, 4, 4).\n\n"
           "frame: its name, or its index into frame_names; None: the tip. N states are computed\n"
           "in SIMD lanes; the result is in Fortran order if q is.")
      .def("frame_poses", &frame_poses, arg("q"),
           "World poses of all frames, in the order of frame_names, shape (F, 4, 4) or\n"
           "(N, F, 4, 4).")
      .def("frame_jacobian", &frame_jacobian, arg("q"), arg("frame") = py::none(), py::kw_only(),
           arg("reference") = aligned,
           "J with J v the twist of a frame: shape (6, n) or (N, 6, n), angular rows first.\n\n"
           "frame, and N states: as in frame_pose.\n"
           "reference: 'local_world_aligned', of the frame's origin in world axes; 'local', of\n"
           "that origin in the frame's axes; or 'world', of the body's point at the world's\n"
           "origin.")
      .def("frame_velocity", &frame_velocity, arg("q"), arg("v"), arg("frame") = py::none(),
           py::kw_only(), arg("reference") = aligned,
           "Twist J v of a frame, shape (6,) or (N, 6): angular, then linear [rad/s, m/s].")
      .def("frame_drift", &frame_drift, arg("q"), arg("v"), arg("frame") = py::none(),
           py::kw_only(), arg("reference") = aligned,
           "Rate of the twist of a frame at accelerations of zero, dJ/dt v, shape (6,) or\n"
           "(N, 6).")
      .def("frame_acceleration", &frame_acceleration, arg("q"), arg("v"), arg("a"),
           arg("frame") = py::none(), py::kw_only(), arg("reference") = aligned,
           "Rate of the twist of a frame, J a + dJ/dt v, shape (6,) or (N, 6).");
}

}  // namespace

int frame_index(const char* function, const model::Model& model, py::handle frame) {
  if (frame.is_none()) return model::Model::tip_frame;
  return index_of(function, "frame", frame, model.frames(), "a frame");
}

Reference reference_of(const char* function, std::string_view name) {
  if (const auto found = dynamics::reference_named(name)) return *found;
  refuse(function, "reference",
         fmt::format("'{}', expected 'world', 'local' or 'local_world_aligned'", name));
}

void add_kinematics(py::class_<BoundModel, SharedModel>& type) {
  using py::arg;
  type.def("forward_kinematics", &forward_kinematics, arg("q"),
           "World poses of the links' centre-of-mass frames, shape (n, 4, 4) or (N, n, 4, 4).")
      .def("tip_pose", &tip_pose, arg("q"), "World pose of the tip, shape (4, 4) or (N, 4, 4).")
      .def("jacobian", &jacobian, arg("q"), arg("link") = py::none(), arg("point") = py::none(),
           "Jacobian of a point: shape (6, n) or (N, 6, n), angular rows first, world axes.\n\n"
           "link: name or index of a moving link; None: the link of the tip.\n"
           "point: shape (3,), in the link's centre-of-mass frame [m]; None: that frame's origin,\n"
           "or the tip if no link is given.")
      .def("shape_centers", &shape_centers, arg("q"),
           "World centres of all collision shapes, shape (S, 3) or (N, S, 3) [m].");
  add_frames(type);
  add_centroidal(type);
}

}  // namespace hamelin::python
