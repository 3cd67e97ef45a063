// Times of C++ calls, for libs/python/bench/overheads.py: prints JSON.
// cpp_times ROBOT SCENE STATES PLUGINS: STATES holds N x 2 x dof doubles, q and v of ticks.
#include <chrono>
#include <cstring>
#include <functional>
#include <string>

#include <fmt/format.h>

#include "hamelin/control/controller.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"

namespace {

using namespace hamelin;
using Eigen::VectorXd;

// The least time of several repetitions [s].
double least_time(int repetitions, const std::function<void()>& f) {
  double least = 1e300;
  for (int i = 0; i < repetitions; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    f();
    least = std::min(
        least, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  return least;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const model::Model model(description::read_robot(argv[1]));
  const Eigen::Index dof = model.dof();
  dynamics::Workspace ws(model);
  const VectorXd q = VectorXd::Constant(dof, 0.3), v = VectorXd::Constant(dof, 0.2),
                 tau = VectorXd::Constant(dof, 1.0);
  VectorXd a(dof);
  const double aba = least_time(20,
                                [&] {
                                  for (int i = 0; i < 10'000; ++i)
                                    dynamics::forward_dynamics(model, ws, q, v, tau, a);
                                }) /
                     10'000;

  constexpr Eigen::Index states = 100'000;
  dynamics::StatesXd Q = dynamics::StatesXd::Random(dof, states),
                     V = dynamics::StatesXd::Random(dof, states),
                     T = dynamics::StatesXd::Random(dof, states), A(dof, states);
  dynamics::BatchWorkspace batch(model);
  const double many = least_time(10, [&] { dynamics::forward_dynamics(model, batch, Q, V, T, A); });

  const std::string bytes = read_file(argv[3]);
  std::vector<double> ticks(bytes.size() / sizeof(double));
  std::memcpy(ticks.data(), bytes.data(), bytes.size());
  const auto count = static_cast<Eigen::Index>(ticks.size()) / (2 * dof);
  const auto replay = [&] {
    control::Controller controller(argv[2], {argv[4]});
    const auto begin = std::chrono::steady_clock::now();
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Map<const VectorXd> position(ticks.data() + 2 * dof * k, dof),
          velocity(ticks.data() + 2 * dof * k + dof, dof);
      controller.tick(static_cast<double>(k) * controller.period_s(), position, velocity);
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  double tick = 1e300;
  for (int i = 0; i < 5; ++i) tick = std::min(tick, replay() / static_cast<double>(count));
  fmt::print("{{\"aba_s\": {}, \"aba_many_s\": {}, \"tick_s\": {}}}\n", aba, many, tick);
  return 0;
}
