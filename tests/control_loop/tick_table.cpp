// Prints how long a tick of the planner hybrid takes, without updates and while two threads change
// obstacles, map, goals and parameters as fast as they can. Ticks follow each other without a
// pause. Without updates, eight obstacles stand still, and goals are replaced between ticks, so
// that the arm moves as much. Times are in microseconds.
//
//     hamelin_tick_table [TICKS]
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <optional>

#include "hamelin/control/preparation.hpp"
#include "updates.hpp"

namespace {

using namespace hamelin;
using Eigen::VectorXd;

constexpr long goal_ticks = 200;  // between two goals, without updates
constexpr int obstacles = 8;

double cpu_us() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

double wall_us() {
  return std::chrono::duration<double, std::micro>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

struct Times {
  std::vector<double> cpu, wall;
  long snapshots = 0, goals = 0;
};

void print(const char* updates, const char* clock, const Times& times, std::vector<double> us) {
  std::sort(us.begin(), us.end());
  const auto at = [&](double share) {
    const auto last = static_cast<double>(us.size() - 1);
    return us[static_cast<std::size_t>(share * last)];
  };
  fmt::print("{:<9}{:<7}{:>9}{:>11}{:>7}{:>9.1f}{:>9.1f}{:>9.1f}{:>11.1f}\n", updates, clock,
             us.size(), times.snapshots, times.goals, at(0.5), at(0.99), at(0.999), us.back());
}

Times measure(const scene::Scene& scene, long ticks, bool with_updates) {
  control::Controller::Options options;
  options.obstacles_max = obstacles;
  options.position = true;
  control::Controller controller(scene, {HAMELIN_TEST_PLUGIN_DIR}, options);
  const model::Robot robot = control::load_model(scene).robot();
  Rng rng(1);
  for (int i = 0; i < obstacles && !with_updates; ++i)
    controller.world().set_obstacle(test::random_obstacle(rng, "thing " + std::to_string(i)));

  Times times;
  times.cpu.reserve(static_cast<std::size_t>(ticks));
  times.wall.reserve(static_cast<std::size_t>(ticks));
  std::atomic<double> now_s{0.0};
  std::optional<test::Updates> updates;
  if (with_updates)
    updates.emplace(controller, scene, now_s, test::Updates::Param{"cruise_speed", 0.2, 2.0}, 1);
  VectorXd q = scene.start_q, v = VectorXd::Zero(q.size());
  std::uint64_t snapshot = 0, goals = 0;
  for (long k = 0; k < ticks; ++k) {
    if (!with_updates && k % goal_ticks == 0)
      controller.set_goal(scene::joint_goal(test::random_joints(rng, robot)));
    now_s = controller.period_s() * static_cast<double>(k);
    const double wall = wall_us(), cpu = cpu_us();
    const control::Answer& answer = controller.tick(now_s, q, v);
    times.cpu.push_back(cpu_us() - cpu);
    times.wall.push_back(wall_us() - wall);
    if (answer.snapshot != snapshot) ++times.snapshots;
    if (answer.goals_number != goals) ++times.goals;
    snapshot = answer.snapshot;
    goals = answer.goals_number;
    q = answer.q_next;
    v = answer.v_next;
  }
  return times;
}

void print_table(long ticks) {
  scene::Scene scene =
      scene::read_scene(std::string(HAMELIN_SOURCE_DIR) + "/data/scenes/clutter.json");
  fmt::print("{:<9}{:<7}{:>9}{:>11}{:>7}{:>9}{:>9}{:>9}{:>11}\n", "updates", "clock", "ticks",
             "snapshots", "goals", "p50", "p99", "p99.9", "max");
  for (const bool with_updates : {false, true}) {
    const Times times = measure(scene, ticks, with_updates);
    const char* name = with_updates ? "yes" : "no";
    print(name, "cpu", times, times.cpu);
    print(name, "wall", times, times.wall);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const long ticks = argc > 1 ? std::atol(argv[1]) : 200000;
  if (ticks < 1) {
    fmt::print(stderr, "usage: {} [TICKS]\n", argv[0]);
    return 2;
  }
  try {
    print_table(ticks);
  } catch (const std::exception& e) {
    fmt::print(stderr, "tick_table: {}\n", e.what());
    return 1;
  }
  return 0;
}
