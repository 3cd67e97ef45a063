// hamelin_peers [--json FILE] [speed] [energy] [precision] [--quick]
// Measures speed, energy and work-precision of hamelin and of other programs on the same robots, in
// one process and one run.
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <set>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/make_chain.hpp"
#include "peer.hpp"

namespace hamelin::peers {
namespace {

constexpr int states = 64;

double cpu_s() {
  std::timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::string text_of(double x) {
  return std::isfinite(x) ? fmt::format("{:.3g}", x) : "-";
}
Json number(double x) {
  return std::isfinite(x) ? Json(x) : Json(nullptr);
}

struct Named {
  std::string name;
  model::Robot robot;
};

model::Robot chain(int links, const std::string& axes) {
  return model::make_chain({links, axes, 0.2, 1.0, 0.03});
}
/// A spatial chain with the links of example 5.1 of the paper (unit masses and inertias, 0.1 m
/// apart) and joint axes x, y, z.
model::Robot unit_chain_xyz() {
  model::Robot robot = model::make_chain({3, "x,y,z", 0.1, 1.0, 0.03});
  for (auto& link : robot.links) link.inertia_kg_m2.setIdentity();
  return robot;
}
model::Robot data_robot(const char* file) {
  return description::read_robot(std::string(HAMELIN_SOURCE_DIR "/data/robots/") + file);
}

std::vector<VectorXd> random_states(std::uint64_t seed, int n, double size) {
  Rng rng(seed);
  std::vector<VectorXd> all(states, VectorXd::Zero(n));
  for (auto& x : all)
    for (int i = 0; i < n; ++i) x[i] = rng.uniform(-size, size);
  return all;
}

/// Checks that a peer's model equals hamelin's. Prints the largest relative differences of inverse
/// and forward dynamics over random states. @throws Error invalid if the inverse dynamics differs
/// by more than 1e-9
void validate(const model::Robot& robot, Peer& ours, Peer& peer) {
  const int n = robot.dof();
  const auto q = random_states(1, n, 3.0), v = random_states(2, n, 2.0),
             a = random_states(3, n, 5.0);
  VectorXd tau(n), theirs(n), back(n);
  double inverse = 0.0, forward = 0.0;
  for (std::size_t k = 0; k < states; ++k) {
    ours.inverse_dynamics(q[k], v[k], a[k], tau);
    peer.inverse_dynamics(q[k], v[k], a[k], theirs);
    inverse = std::max(inverse, (tau - theirs).norm() / tau.norm());
    peer.forward_dynamics(q[k], v[k], tau, back);
    forward = std::max(forward, (back - a[k]).norm() / a[k].norm());
  }
  fmt::print(
      "# {}, {}: relative difference of inverse dynamics {:.1e}, of forward dynamics {:.1e}\n",
      robot.name, peer.name(), inverse, forward);
  if (!(inverse <= 1e-9))
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: the model of {} differs: relative difference of inverse dynamics {:.3g}, "
                    "expected at most 1e-9",
                    robot.name, peer.name(), inverse));
}

/// A measurement of time: one block makes `calls` calls.
struct Timing {
  std::string task, program;
  int calls;
  std::function<void()> block;
  double best_ns = std::numeric_limits<double>::infinity();
};

/// Takes the minimum over many short blocks. The blocks of all measurements are interleaved, so a
/// change of the clock frequency affects all of them.
void run_timings(std::vector<Timing>& all, bool quick) {
  using Clock = std::chrono::steady_clock;
  for (int round = 0; round < (quick ? 4 : 40); ++round)
    for (auto& timed : all) {
      const auto until = Clock::now() + std::chrono::milliseconds(4);
      do {
        const auto start = Clock::now();
        timed.block();
        const double ns = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
        timed.best_ns = std::min(timed.best_ns, ns / timed.calls);
      } while (Clock::now() < until);
    }
}

Json speed(bool quick) {
  std::vector<Named> robots{
      {"arm7", data_robot("arm7.urdf")}, {"planar3", data_robot("planar3.json")},
      {"chain7", chain(7, "x,z,x")},     {"planar7", chain(7, "x")},
      {"chain20", chain(20, "x,z,x")},   {"chain100", chain(100, "x,z,x")},
      {"chain200", chain(200, "x,z,x")}};
  Json rows = Json::array();
  for (auto& [label, robot] : robots) {
    robot.name = label;
    const int n = robot.dof();
    const auto q = random_states(1, n, 3.0), v = random_states(2, n, 2.0),
               x = random_states(3, n, 5.0);
    auto peers = make_all(robot);
    for (std::size_t i = 1; i < peers.size(); ++i) validate(robot, *peers[0], *peers[i]);
    VectorXd out(n);
    std::vector<Timing> all;
    for (auto& peer : peers) {
      all.push_back({"forward dynamics", peer->name(), states, [&, p = peer.get()] {
                       for (std::size_t k = 0; k < states; ++k)
                         p->forward_dynamics(q[k], v[k], x[k], out);
                     }});
      all.push_back({"inverse dynamics", peer->name(), states, [&, p = peer.get()] {
                       for (std::size_t k = 0; k < states; ++k)
                         p->inverse_dynamics(q[k], v[k], x[k], out);
                     }});
    }
    const model::Model model(robot);
    dynamics::BatchWorkspace batch(model);
    dynamics::StatesXd Q(n, states), V(n, states), X(n, states), Y(n, states);
    for (int k = 0; k < states; ++k) {
      Q.col(k) = q[static_cast<std::size_t>(k)];
      V.col(k) = v[static_cast<std::size_t>(k)];
      X.col(k) = x[static_cast<std::size_t>(k)];
    }
    all.push_back({"forward dynamics", "hamelin, batch", states,
                   [&] { dynamics::forward_dynamics(model, batch, Q, V, X, Y); }});
    all.push_back({"inverse dynamics", "hamelin, batch", states,
                   [&] { dynamics::inverse_dynamics(model, batch, Q, V, X, Y); }});
    run_timings(all, quick);

    // Steps of 1 ms along a motion, from the same start for each stepper, after 8 steps of warm-up.
    std::vector<std::unique_ptr<Stepper>> steppers;
    std::vector<Timing> steps;
    const VectorXd q0 = VectorXd::Constant(n, 0.3), v0 = VectorXd::Constant(n, 0.1);
    const int calls = n > 50 ? 8 : 32;
    const long span = n > 50 ? 64 : 1000;  // some steppers diverge later
    for (auto& peer : peers)
      for (const auto& name : peer->steppers()) {
        auto stepper = peer->stepper(name);
        stepper->set(q0, v0);
        bool moves = true;
        const double before = cpu_s();
        for (int k = 0; k < 8 && moves; ++k) moves = stepper->step(1e-3);
        constexpr double longest_s = 2e-3;
        if (!moves || cpu_s() - before > 8 * longest_s) {
          fmt::print("# {}, {}: left out, {}\n", peer->name(), name,
                     moves ? fmt::format("a step takes more than {} s", longest_s)
                           : "its first steps fail");
          continue;
        }
        // the motion continues, which keeps multi-step guesses valid, and restarts after `span`
        // steps
        steps.push_back({"step of 1 ms", peer->name() + ", " + name, calls,
                         [s = stepper.get(), q0, v0, calls, span, at = 0L]() mutable {
                           for (int k = 0; k < calls; ++k) (void)s->step(1e-3);
                           if ((at += calls) < span) return;
                           s->set(q0, v0);
                           for (at = 0; at < 8; ++at) (void)s->step(1e-3);
                         }});
        steppers.push_back(std::move(stepper));
      }
    run_timings(steps, quick);
    all.insert(all.end(), steps.begin(), steps.end());

    std::stable_sort(all.begin(), all.end(),
                     [](const Timing& a, const Timing& b) { return a.task < b.task; });
    double own_forward = 0.0, own = 0.0;
    for (const Timing& t : all)
      if (t.task == "forward dynamics" && t.program == "hamelin") own_forward = t.best_ns;
    fmt::print("\n{:<18} {:<36} {:>11} {:>16} {:>14}\n", label, "", "ns per call", "/ own forward",
               "hamelin / it");
    for (const Timing& t : all) {
      if (t.program == "hamelin") own = t.best_ns;
      const bool step = t.task[0] == 's';
      fmt::print("{:<18} {:<36} {:>11.0f} {:>16.2f} {:>14}\n", t.task, t.program, t.best_ns,
                 t.best_ns / own_forward, step ? "" : fmt::format("{:.2f}", own / t.best_ns));
      rows.push_back({{"robot", label},
                      {"what", t.task},
                      {"who", t.program},
                      {"ns", t.best_ns},
                      {"ratio_to_our_forward_dynamics", t.best_ns / own_forward}});
    }
    fmt::print("\n");
  }
  return rows;
}

struct Case {
  std::string name;
  model::Robot robot;
  VectorXd q0;
  double step_s = 0.0, duration_s = 0.0;
};

VectorXd vector(std::initializer_list<double> x) {
  return Eigen::Map<const VectorXd>(x.begin(), static_cast<Eigen::Index>(x.size()));
}

/// Measures energy errors. hamelin computes all energies at the states of the programs, because the
/// programs' own values may be wrong (DART's potential energy omits the offset of the COM) or old
/// (MuJoCo's belongs to the last mj_forward).
Json energy(bool quick) {
  std::vector<Case> cases{
      {"planar example 5.1", data_robot("planar3.json"), VectorXd::Zero(3), 0.01, 100.0},
      {"planar3, 10^6 steps", data_robot("planar3.json"), VectorXd::Zero(3), 0.01, 1e4},
      {"spatial 3, 1 ms", unit_chain_xyz(), vector({0.5, 1.0, -0.7}), 1e-3, 200.0},
      {"spatial 3, 10 ms", unit_chain_xyz(), vector({0.5, 1.0, -0.7}), 1e-2, 1000.0},
  };
  Json rows = Json::array();
  for (auto& c : cases) {
    c.robot.name = c.name;
    const int n = c.robot.dof();
    const auto steps = std::lround((quick ? 0.01 : 1.0) * c.duration_s / c.step_s);
    auto peers = make_all(c.robot);
    for (std::size_t i = 1; i < peers.size(); ++i) validate(c.robot, *peers[0], *peers[i]);
    const model::Model model(c.robot);
    dynamics::Workspace ws(model);
    fmt::print("\n{}: {} steps of {} s\n{:<36} {:>12} {:>12} {:>16} {:>12}\n", c.name, steps,
               c.step_s, "", "max |dE| J", "end dE J", "drift J/s", "us per step");
    for (auto& peer : peers)
      for (const auto& name : peer->steppers()) {
        const auto stepper = peer->stepper(name);
        VectorXd q = c.q0, v = VectorXd::Zero(n);
        stepper->set(q, v);
        const double first =
            dynamics::kinetic_energy(model, ws, q, v) + dynamics::potential_energy(model, ws, q);
        double largest = 0.0, last = 0.0, sum_t = 0.0, sum_e = 0.0, sum_tt = 0.0, sum_te = 0.0,
               spent = 0.0;
        bool good = true;
        long k = 0;
        // One step of each block is timed, because reading the clock costs as much as a step.
        constexpr long block = 100;
        for (; k < steps && good; ++k) {
          const double before = k % block == 0 ? cpu_s() : 0.0;
          good = stepper->step(c.step_s);
          if (k % block == 0) spent += cpu_s() - before;
          stepper->get(q, v);
          last = dynamics::kinetic_energy(model, ws, q, v) +
                 dynamics::potential_energy(model, ws, q) - first;
          good = good && std::isfinite(last);
          const double t = static_cast<double>(k + 1) * c.step_s;
          largest = std::max(largest, std::abs(last));
          sum_t += t, sum_e += last, sum_tt += t * t, sum_te += t * last;
        }
        const auto m = static_cast<double>(k);
        const double drift = (m * sum_te - sum_t * sum_e) / (m * sum_tt - sum_t * sum_t);
        const double us = 1e6 * spent / std::ceil(m / block);
        fmt::print("{:<36} {:>12} {:>12} {:>16} {:>12.2f}{}\n", peer->name() + ", " + name,
                   text_of(largest), text_of(last), text_of(drift), us,
                   good ? "" : fmt::format("  stopped at step {}", k));
        std::fflush(stdout);
        rows.push_back({{"case", c.name},
                        {"who", peer->name() + ", " + name},
                        {"steps", k},
                        {"step_s", c.step_s},
                        {"energy_error_max_J", number(largest)},
                        {"energy_error_end_J", number(last)},
                        {"drift_J_per_s", number(drift)},
                        {"cpu_us_per_step", us},
                        {"completed", good}});
      }
  }
  return rows;
}

/// A point of the work-precision diagram.
struct Point {
  std::string scheme, setting;
  double error = 0.0, cpu_us = 0.0;
};

/// The least CPU time of several calls [µs].
template <class F>
double least_cpu_us(F&& once, bool quick) {
  double best = std::numeric_limits<double>::infinity(), spent = 0.0;
  for (int i = 0; i < 200 && (i < (quick ? 1 : 5)) | (spent < (quick ? 0.0 : 0.02)); ++i) {
    const double start = cpu_s();
    once();
    const double took = cpu_s() - start;
    spent += took;
    best = std::min(best, took);
  }
  return 1e6 * best;
}

Json precision(bool quick) {
  const VectorXd ready = vector({0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785});
  const VectorXd bent = vector({0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6});
  std::vector<Case> cases{{"arm7, T = 0.2 s", data_robot("arm7.urdf"), ready, 0.0, 0.2},
                          {"arm7, T = 1 s", data_robot("arm7.urdf"), ready, 0.0, 1.0},
                          {"chain7, T = 1 s", chain(7, "x,z,x"), bent, 0.0, 1.0}};
  Json rows = Json::array();
  for (auto& c : cases) {
    c.robot.name = c.name;
    const int n = c.robot.dof();
    const VectorXd rest = VectorXd::Zero(n);
    auto peers = make_all(c.robot);
    for (std::size_t i = 1; i < peers.size(); ++i) validate(c.robot, *peers[0], *peers[i]);
    const model::Model model(c.robot);

    const auto end_of = [&](Stepper& stepper, long steps, VectorXd& q, VectorXd& v) {
      stepper.set(c.q0, rest);
      for (long k = 0; k < steps; ++k)
        if (!stepper.step(c.duration_s / static_cast<double>(steps))) return false;
      stepper.get(q, v);
      return q.allFinite();
    };
    VectorXd reference(n), coarse(n), v(n), q(n);
    const long fine = std::lround(c.duration_s / (quick ? 5e-5 : 1e-5));
    const auto rk4 = peers[0]->stepper("rk4");
    if (!end_of(*rk4, fine, reference, v) || !end_of(*rk4, fine / 2, coarse, v))
      throw Error(ErrorCode::invalid, c.name + ": the reference solution diverges");
    const double own_error = (reference - coarse).lpNorm<Eigen::Infinity>();
    fmt::print("\n{}: reference rk4 with {} steps, accurate to {:.1e}\n", c.name, fine, own_error);

    std::vector<Point> points;
    for (auto& peer : peers)
      for (const auto& name : peer->steppers()) {
        const auto stepper = peer->stepper(name);
        for (const double h : {2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4}) {
          if (quick && h < 1e-3) continue;
          const long steps = std::lround(c.duration_s / h);
          if (!end_of(*stepper, steps, q, v)) continue;
          const double error = (q - reference).lpNorm<Eigen::Infinity>();
          points.push_back({peer->name() + ", " + name, fmt::format("h = {} s", h), error,
                            least_cpu_us([&] { (void)end_of(*stepper, steps, q, v); }, quick)});
        }
      }
    for (const auto& name : integration::integrator_names()) {
      const auto* scheme = integration::find_scheme(name);
      if (!scheme->step_control) continue;
      std::vector<int> orders = scheme->orders;
      if (orders.empty()) orders.push_back(0);
      for (const int order : orders)
        for (int digits = 2; digits <= 14; ++digits) {
          integration::Parameters options;
          options.rtol = options.atol = std::pow(10.0, -digits);
          if (order > 0) options.order = order;
          const auto integrator = integration::make_integrator(name, model, options);
          bool good = true;
          const auto once = [&] {
            auto state = integrator->start(c.q0, rest);
            state.step_next = 1e-3;
            good = integrator->step(state, {}, c.duration_s).converged;
            q = state.q;
          };
          once();
          if (!good) continue;
          const double error = (q - reference).lpNorm<Eigen::Infinity>();
          points.push_back({fmt::format("hamelin, {}{} adaptive", name,
                                        order > 0 ? fmt::format(" {}", order) : ""),
                            fmt::format("rtol = atol = {:.0e}", *options.rtol), error,
                            least_cpu_us(once, quick)});
        }
    }
    for (const Point& p : points)
      rows.push_back({{"case", c.name},
                      {"who", p.scheme},
                      {"setting", p.setting},
                      {"error_q", number(p.error)},
                      {"reference_error", own_error},
                      {"cpu_us", p.cpu_us}});

    // The cheapest setting of each scheme whose error stays below a bound.
    std::vector<std::string> schemes;
    for (const Point& p : points)
      if (std::find(schemes.begin(), schemes.end(), p.scheme) == schemes.end())
        schemes.push_back(p.scheme);
    fmt::print("{:<36}", "least CPU us for an error below");
    for (int digits = 2; digits <= 10; ++digits) fmt::print(" {:>9}", fmt::format("1e-{}", digits));
    fmt::print("\n");
    for (const auto& scheme : schemes) {
      fmt::print("{:<36}", scheme);
      for (int digits = 2; digits <= 10; ++digits) {
        double best = std::numeric_limits<double>::infinity();
        for (const Point& p : points)
          if (p.scheme == scheme && p.error <= std::pow(10.0, -digits))
            best = std::min(best, p.cpu_us);
        fmt::print(" {:>9}", std::isfinite(best) ? fmt::format("{:.0f}", best) : "-");
      }
      fmt::print("\n");
    }
    std::fflush(stdout);
  }
  return rows;
}

int run(int argc, char** argv) {
  std::set<std::string> parts;
  std::optional<std::string> json;
  bool quick = false;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--json" && i + 1 < argc) {
      json = argv[++i];
    } else if (argument == "--quick") {
      quick = true;
    } else if (argument == "speed" || argument == "energy" || argument == "precision") {
      parts.insert(argument);
    } else {
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: expected speed, energy, precision, --quick or --json FILE", argument));
    }
  }
  if (const char* isa = std::getenv("HAMELIN_ISA"))
    set_default_isa(isa_from_name(isa, "HAMELIN_ISA"));
  const auto wanted = [&](const char* part) { return parts.empty() || parts.count(part) != 0; };
  Json sets = Json::object();
  for (const auto& peer : make_all(chain(1, "x"))) {
    sets[peer->name()] = peer->instruction_set();
    fmt::print("# {}: instruction set {}\n", peer->name(), peer->instruction_set());
  }
  Json out{{"instruction_sets", sets}, {"quick", quick}};
  if (wanted("speed")) out["speed"] = speed(quick);
  if (wanted("energy")) out["energy"] = energy(quick);
  if (wanted("precision")) out["precision"] = precision(quick);
  if (json) std::ofstream(*json) << out.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace hamelin::peers

int main(int argc, char** argv) {
  try {
    return hamelin::peers::run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "hamelin_peers: {}\n", e.what());
    return 2;
  }
}
