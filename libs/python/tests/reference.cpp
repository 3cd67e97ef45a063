// Prints what the libraries compute for the states of a file, as bytes of doubles: the reference
// for the tests of the Python package, which must give the same bits.
// reference ROBOT SPHERES SCENE STATES: STATES holds N x 3 x dof doubles (q, v and a third vector).
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "hamelin/control/preparation.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/dynamics_batch.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace {

using namespace hamelin;
using Eigen::VectorXd;

void print(const double* x, Eigen::Index count) {
  std::fwrite(x, sizeof(double), static_cast<std::size_t>(count), stdout);
}
template <class Matrix>
void print_rows(const Matrix& x) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = x;
  print(rows.data(), rows.size());
}

void print_state(const model::Model& model, dynamics::Workspace& ws, const VectorXd& q,
                 const VectorXd& v, const VectorXd& x) {
  const Eigen::Index dof = model.dof();
  VectorXd y(dof);
  dynamics::inverse_dynamics(model, ws, q, v, x, y);
  print_rows(y);
  dynamics::forward_dynamics(model, ws, q, v, x, y);
  print_rows(y);
  dynamics::gravity_torque(model, ws, q, y);
  print_rows(y);
  dynamics::bias_torque(model, ws, q, v, y);
  print_rows(y);
  dynamics::momentum(model, ws, q, v, y);
  print_rows(y);
  dynamics::solve_mass(model, ws, q, v, y);
  print_rows(y);
  Eigen::MatrixXd M(dof, dof);
  dynamics::mass_matrix(model, ws, q, M);
  print_rows(M);
  const double energies[2] = {dynamics::kinetic_energy(model, ws, q, v),
                              dynamics::potential_energy(model, ws, q)};
  print(&energies[0], 2);
  dynamics::forward_kinematics(model, ws, q);
  for (int i = 0; i < dof; ++i) print_rows(dynamics::link_pose(model, ws, i).matrix());
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  print_rows(tip.matrix());
  dynamics::Matrix6Xd J(6, dof);
  dynamics::frame_jacobian(model, ws, model.robot().tip.link, tip.p(), J);
  print_rows(J);
}

void print_distances(const scene::Environment& environment, const scene::SelfField& self,
                     const model::Model& model, dynamics::Workspace& ws, const VectorXd& q) {
  dynamics::forward_kinematics(model, ws, q);
  scene::PlacedShapes arm(model);
  arm.place(model, ws);
  std::vector<scene::SelfContact> nearest(1);
  const bool any = self.closest(arm.view(), 1.0, nearest) > 0;
  const Eigen::Vector3d tip = dynamics::tip_pose(model, ws).p();
  const double radius = 0.0;
  const double out[3] = {environment.clearance(arm.view(), 0.0, 1.0),
                         any ? nearest[0].distance : 1.0,
                         environment.clearance({{&tip, 1}, {&radius, 1}}, 0.0, 1.0)};
  print(&out[0], 3);
}

// Matrices of all states, in lanes; each in C order.
void print_matrices(const model::Model& model, const dynamics::StatesXd& q,
                    const dynamics::StatesXd& v, const dynamics::StatesXd& x) {
  const Eigen::Index n = model.dof(), states = q.cols();
  dynamics::StatesXd a(n, states), M(n * n, states), A = M, B = M, C = M;
  dynamics::DynamicsBatch batch(model);
  const auto print_all = [&](const dynamics::StatesXd& matrices) {
    for (Eigen::Index i = 0; i < states; ++i) {
      const VectorXd entries = matrices.col(i);
      print_rows(Eigen::Map<const Eigen::MatrixXd>(entries.data(), n, n));
    }
  };
  batch.mass_matrix(q, M);
  print_all(M);
  batch.inverse_dynamics_derivatives(q, v, x, A, B, C);
  for (const auto* matrices : {&A, &B, &C}) print_all(*matrices);
  batch.forward_dynamics_derivatives(q, v, x, a, A, B, C);
  for (const auto* matrices : {&A, &B, &C}) print_all(*matrices);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const model::Model model(description::read_robot(argv[1], {{}, argv[2]}));
  const scene::Scene scene = scene::read_scene(argv[3]);
  const model::Model in_scene = control::load_model(scene);
  const scene::Environment environment = scene::make_environment(scene, in_scene, 0.2);
  const scene::SelfField self(in_scene);
  const std::string bytes = read_file(argv[4]);
  const Eigen::Index dof = model.dof();
  const auto states = static_cast<Eigen::Index>(bytes.size() / sizeof(double)) / (3 * dof);
  std::vector<double> numbers(bytes.size() / sizeof(double));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  dynamics::Workspace ws(model), scene_ws(in_scene);
  dynamics::StatesXd q(dof, states), v(dof, states), x(dof, states), y(dof, states);
  for (Eigen::Index i = 0; i < states; ++i) {
    const double* const at = numbers.data() + 3 * dof * i;
    q.col(i) = Eigen::Map<const VectorXd>(at, dof);
    v.col(i) = Eigen::Map<const VectorXd>(at + dof, dof);
    x.col(i) = Eigen::Map<const VectorXd>(at + 2 * dof, dof);
    print_state(model, ws, q.col(i).eval(), v.col(i).eval(), x.col(i).eval());
    print_distances(environment, self, in_scene, scene_ws, q.col(i).eval());
  }
  // In lanes.
  dynamics::BatchWorkspace batch(model);
  dynamics::inverse_dynamics(model, batch, q, v, x, y);
  print_rows(y.transpose());
  dynamics::forward_dynamics(model, batch, q, v, x, y);
  print_rows(y.transpose());
  print_matrices(model, q, v, x);
  return 0;
}
