// Ten seconds of free fall: how far three integrators let the energy stray.
#include <fmt/core.h>

#include <algorithm>
#include <hamelin/description/robot_io.hpp>
#include <hamelin/integration/integrator.hpp>

int main() {
  using namespace hamelin;
  const model::Model arm(description::read_robot("data/robots/arm7.urdf"));
  const Eigen::VectorXd q0 = Eigen::VectorXd::Constant(7, 0.3), v0 = Eigen::VectorXd::Zero(7);
  for (const char* name : {"hamel-variational", "gauss:8", "rk4"}) {
    const auto integrator = integration::make_integrator(name, arm);
    integration::State state = integrator->start(q0, v0);
    const double start_J = integrator->energy(state).total();
    double strayed_J = 0.0;
    for (int k = 0; k < 10000; ++k) {
      if (!integrator->step(state, {}, 1e-3).converged) return 1;
      strayed_J = std::max(strayed_J, std::abs(integrator->energy(state).total() - start_J));
    }
    fmt::print("{}: {:.1e} J\n", name, strayed_J);
  }
}
