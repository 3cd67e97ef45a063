// Ticks a controller while three other threads change its world, goals and parameters at random and
// stream poses of obstacles.
// Counts what the ticks allocate and lock, and computes a sample of the answers again with other
// calls, from the snapshot and the goals that the answer names.
//
//     hamelin_under_load TICKS SEED PLANNER
//
// With the planner `reporting` it also compares what the planner was shown.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <optional>
#include <set>

#include "hamelin/control/preparation.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/locks.hpp"
#include "updates.hpp"

namespace {

using namespace hamelin;
using Eigen::VectorXd;
using SnapshotPointer = std::shared_ptr<const control::WorldSnapshot>;

constexpr long samples_per_run = 5000;
constexpr std::size_t checked_min = 1000;
constexpr std::uint64_t snapshots_min = 100, goals_min = 20;
constexpr long observations_min = 100;
constexpr std::size_t series_count = 5;  // of the planner `reporting`

/// What the controller answered in one tick.
struct Sample {
  double time_s = 0.0;
  VectorXd q;
  std::uint64_t snapshot = 0, goals_number = 0;
  std::size_t goal_index = 0;
  bool reached = false;
  double clearance_m = 0.0;
  std::optional<std::int32_t> nearest;        ///< id of the nearest obstacle
  std::array<double, series_count> series{};  ///< of the planner `reporting`
};

/// What the threads did, by number. The threads write, and the checker reads.
struct History {
  std::mutex mutex;
  std::map<std::uint64_t, SnapshotPointer> snapshots;
  std::map<std::uint64_t, std::vector<scene::Goal>> goals;
  std::set<double> params;  ///< values of the parameter that they set
};

/// Computes samples again.
class Checker {
 public:
  /// @param reporting whether the planner is the one of that name
  Checker(const scene::Scene& scene, double influence_m, bool reporting)
      : model_(control::load_model(scene)),
        ws_(model_),
        arm_(model_),
        influence_m_(influence_m),
        reporting_(reporting) {}

  /// Compares a sample with what `snapshot` and `goals` give. Differences are in faults().
  void check(const Sample& sample, const control::WorldSnapshot& snapshot,
             const std::vector<scene::Goal>& goals) {
    ++checked_;
    if (sample.goal_index > 0) ++advanced_;
    const Nearest nearest = nearest_of(sample, snapshot);
    const auto expect = [&](bool right, const char* what) {
      if (!right) faults_.push_back(fmt::format("tick at {} s: {}", sample.time_s, what));
    };
    expect(sample.clearance_m == nearest.distance_m, "another clearance than its snapshot has");
    expect(sample.nearest == nearest.id, "another nearest obstacle than its snapshot has");
    expect(sample.goal_index <= goals.size(), "a goal index beyond its list");
    expect(sample.reached == (sample.goal_index == goals.size()), "reached, but not all goals");
    if (!reporting_) return;
    const auto [world, distance, obstacle, gain, goal] = sample.series;
    const bool near = nearest.id.has_value();
    expect(world == static_cast<double>(sample.snapshot), "the planner was told another snapshot");
    expect(near ? distance == nearest.distance_m && obstacle == *nearest.id : std::isinf(distance),
           "the planner was shown another nearest contact");
    const scene::Goal& current = goals[std::min(sample.goal_index, goals.size() - 1)];
    expect(goal == (current.type == scene::GoalType::joint ? current.q[0] : current.pose.p()[0]),
           "the planner was shown another goal");
    gains_.insert(gain);
  }
  /// Whether another snapshot would have given another answer, so that check() can tell them apart.
  void compare(const Sample& sample, const control::WorldSnapshot& other) {
    if (sample.clearance_m != nearest_of(sample, other).distance_m) ++distinguished_;
  }

  [[nodiscard]] std::size_t checked() const { return checked_; }
  [[nodiscard]] std::size_t distinguished() const { return distinguished_; }
  /// How many samples were not at the first goal of their list.
  [[nodiscard]] std::size_t advanced() const { return advanced_; }
  [[nodiscard]] const std::set<double>& gains() const { return gains_; }
  [[nodiscard]] const std::vector<std::string>& faults() const { return faults_; }

 private:
  struct Nearest {
    double distance_m;
    std::optional<std::int32_t> id;
  };
  Nearest nearest_of(const Sample& sample, const control::WorldSnapshot& snapshot) {
    dynamics::forward_kinematics(model_, ws_, sample.q);
    arm_.place(model_, ws_);
    const scene::Environment& environment = snapshot.environment;
    scene::Environment::Scratch scratch(environment, model_.shapes().size());
    contacts_.resize(environment.contacts_max(model_.shapes().size()));
    const std::size_t count =
        environment.closest(arm_.view(), influence_m_, sample.time_s, scratch, contacts_);
    Nearest nearest{influence_m_, std::nullopt};
    for (std::size_t i = 0; i < std::min(count, contacts_.size()); ++i) {
      const scene::Contact& contact = contacts_[i];
      if (contact.distance >= nearest.distance_m) continue;
      const bool listed = contact.obstacle >= 0;
      nearest = {contact.distance,
                 listed ? snapshot.obstacle_ids[static_cast<std::size_t>(contact.obstacle)]
                        : contact.obstacle};
    }
    return nearest;
  }

  model::Model model_;
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  double influence_m_;
  bool reporting_;
  std::vector<scene::Contact> contacts_;
  std::size_t checked_ = 0, distinguished_ = 0, advanced_ = 0;
  std::set<double> gains_;
  std::vector<std::string> faults_;
};

/// The samples of the thread that ticks, which allocates nothing for them.
struct Samples {
  Samples(long count, Eigen::Index dof) : all(static_cast<std::size_t>(count)) {
    for (auto& sample : all) sample.q.setZero(dof);
  }
  std::vector<Sample> all;
  std::atomic<std::size_t> count{0};
  std::atomic<std::uint64_t> seen{0};  ///< newest snapshot that was answered; set after `count`

  void add(control::Controller& controller, double time_s, const VectorXd& q) {
    const std::size_t i = count.load(std::memory_order_relaxed);
    if (i == all.size()) return;
    const control::Answer& answer = controller.answer();
    const control::WorldView& view = controller.view();
    Sample& sample = all[i];
    sample.time_s = time_s;
    sample.q = q;
    sample.snapshot = answer.snapshot;
    sample.goals_number = answer.goals_number;
    sample.goal_index = answer.goal_index;
    sample.reached = answer.state == control::ControlState::reached;
    sample.clearance_m = view.clearance_m();
    sample.nearest.reset();
    if (view.nearest() != nullptr) sample.nearest = view.obstacle_id(view.nearest()->obstacle);
    std::copy_n(answer.series.begin(), std::min(answer.series.size(), series_count),
                sample.series.begin());
    count.store(i + 1, std::memory_order_release);
  }
};

/// Checks samples on a thread of its own while ticks go on, so that few snapshots need to be kept.
class Follower {
 public:
  Follower(const Samples& samples, History& history, Checker& checker)
      : samples_(samples), history_(history), checker_(checker), thread_([this] { work(); }) {}
  /// Checks what is left. @return how many samples had a snapshot that no thread recorded, because
  /// the other one replaced it at once
  std::size_t finish() {
    done_ = true;
    thread_.join();
    return waiting_.size();
  }

 private:
  void work() {
    for (bool last = false; !last;) {
      last = done_;  // before the samples are read
      const std::uint64_t seen = samples_.seen.load(std::memory_order_acquire);
      const std::size_t count = samples_.count.load(std::memory_order_acquire);
      for (; next_ < count; ++next_) waiting_.push_back(&samples_.all[next_]);
      std::erase_if(waiting_, [this](const Sample* sample) { return check(*sample); });
      forget_before(seen);
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  }

  // @return whether snapshot and goals of the sample are recorded
  bool check(const Sample& sample) {
    SnapshotPointer snapshot, other;
    std::vector<scene::Goal> goals;
    {
      const std::lock_guard lock(history_.mutex);
      const auto found = history_.snapshots.find(sample.snapshot);
      const auto list = history_.goals.find(sample.goals_number);
      if (found == history_.snapshots.end() || list == history_.goals.end()) return false;
      snapshot = found->second;
      goals = list->second;
      if (const auto after = std::next(found); after != history_.snapshots.end())
        other = after->second;
    }
    checker_.check(sample, *snapshot, goals);
    if (other) checker_.compare(sample, *other);
    return true;
  }

  void forget_before(std::uint64_t seen) {
    std::set<std::uint64_t> needed;
    for (const Sample* sample : waiting_) needed.insert(sample->snapshot);
    const std::lock_guard lock(history_.mutex);
    std::erase_if(history_.snapshots, [&](const auto& entry) {
      return entry.first < seen && !needed.contains(entry.first);
    });
  }

  const Samples& samples_;
  History& history_;
  Checker& checker_;
  std::size_t next_ = 0;
  std::vector<const Sample*> waiting_;
  std::atomic<bool> done_{false};
  std::thread thread_;
};

/// What all ticks together did.
struct Totals {
  long ticks = 0, allocations = 0, locks = 0, backwards = 0, stopped = 0;
  std::uint64_t snapshots = 0, goals = 0;
};

test::Updates::Record recorder(History& history, const std::string& param) {
  return {[&](SnapshotPointer snapshot) {
            const std::lock_guard lock(history.mutex);
            history.snapshots[snapshot->number] = std::move(snapshot);
          },
          [&](std::uint64_t number, const std::vector<scene::Goal>& goals) {
            const std::lock_guard lock(history.mutex);
            history.goals[number] = goals;
          },
          [&history, param](const Json& params) {
            const std::lock_guard lock(history.mutex);
            history.params.insert(params.at(param).get<double>());
          }};
}

/// Ticks an arm whose servos follow every command. Goes on after `ticks` until enough snapshots and
/// goals were seen, in case the other threads have had no time.
Totals run(control::Controller& controller, const scene::Scene& scene, long ticks,
           std::atomic<double>& now_s, Samples& samples) {
  Totals totals;
  VectorXd q = scene.start_q, v = VectorXd::Zero(q.size());
  std::uint64_t snapshot = 0, goals = 0;
  const long stride = std::max(1L, ticks / samples_per_run);
  const auto enough = [&] {
    return totals.snapshots >= snapshots_min && totals.goals >= goals_min;
  };
  for (long k = 0; k < ticks || (!enough() && k < 100 * ticks); ++k) {
    const double time_s = controller.period_s() * static_cast<double>(k);
    now_s = time_s;
    const control::Answer* answer = nullptr;
    long allocations = 0;
    const long locks = test::locks_in([&] {
      allocations = test::allocations_in([&] { answer = &controller.tick(time_s, q, v); });
    });
    ++totals.ticks;
    totals.allocations += allocations;
    totals.locks += locks;
    if (answer->snapshot < snapshot || answer->goals_number < goals) ++totals.backwards;
    if (answer->snapshot != snapshot) ++totals.snapshots;
    if (answer->goals_number != goals) ++totals.goals;
    if (answer->state == control::ControlState::stopping) ++totals.stopped;
    snapshot = answer->snapshot;
    goals = answer->goals_number;
    if (k % stride == 0) samples.add(controller, time_s, q);
    samples.seen.store(snapshot, std::memory_order_release);
    q = answer->q_next;
    v = answer->v_next;
  }
  return totals;
}

// The counters must count, or zero would mean nothing.
bool counters_work(History& history) {
  const long locks = test::locks_in([&] { const std::lock_guard lock(history.mutex); });
  const long allocations = test::allocations_in([&] { history.params.insert(-1.0); });
  return locks == 1 && allocations == 1;
}

int fail(const std::string& line) {
  std::fputs(("under_load: " + line + "\n").c_str(), stderr);
  return 1;
}

int judge(const Totals& totals, const Checker& checker, const test::Updates::Counts& counts,
          const History& history) {
  if (!checker.faults().empty())
    return fail(
        fmt::format("{} faults, the first: {}", checker.faults().size(), checker.faults().front()));
  if (totals.allocations != 0 || totals.locks != 0)
    return fail(fmt::format("{} allocations and {} locks in ticks, expected none",
                            totals.allocations, totals.locks));
  if (totals.backwards != 0 || totals.stopped != 0)
    return fail(fmt::format("{} ticks went back to older data and {} had no valid answer",
                            totals.backwards, totals.stopped));
  if (counts.wrong != 0)
    return fail(fmt::format("{} updates were accepted or refused wrongly", counts.wrong.load()));
  for (const double gain : checker.gains())
    if (!history.params.contains(gain)) return fail("the planner used a gain that nobody set");
  if (totals.snapshots < snapshots_min || totals.goals < goals_min ||
      checker.checked() < checked_min || checker.distinguished() == 0 || checker.advanced() == 0 ||
      counts.params < 2 || counts.observations < observations_min || counts.refused == 0)
    return fail("too few updates were made for a verdict");
  return 0;
}

int under_load(long ticks, std::uint64_t seed, const std::string& planner) {
  const bool reporting = planner == "reporting";
  const test::Updates::Param param = reporting ? test::Updates::Param{"gain", 0.5, 8.0}
                                               : test::Updates::Param{"cruise_speed", 0.2, 2.0};
  scene::Scene scene =
      scene::read_scene(std::string(HAMELIN_SOURCE_DIR) + "/data/scenes/clutter.json");
  scene.planner->name = planner;
  scene.planner->params = nullptr;
  control::Controller::Options options;
  options.obstacles_max = 8;
  options.position = true;
  control::Controller controller(scene, {HAMELIN_TEST_PLUGIN_DIR, HAMELIN_TEST_ONLY_PLUGIN_DIR},
                                 options);

  History history;
  history.snapshots[0] = controller.world().latest();
  history.goals[0] = scene.goals;
  if (!counts_allocations())
    fmt::print("allocations and locks are not counted in this build\n");
  else if (!counters_work(history))
    return fail("the counters of allocations and locks do not count");
  history.params.insert(controller.planner_params().at(param.name).get<double>());

  Samples samples(2 * samples_per_run, scene.start_q.size());
  Checker checker(scene, controller.world().influence_m(), reporting);
  std::atomic<double> now_s{0.0};
  Follower follower(samples, history, checker);
  test::Updates updates(controller, scene, now_s, param, seed, recorder(history, param.name), 2);
  const Totals totals = run(controller, scene, ticks, now_s, samples);
  updates.stop();
  const std::size_t unrecorded = follower.finish();

  const auto& counts = updates.counts();
  fmt::print("{} ticks saw {} snapshots and {} lists of goals\n", totals.ticks, totals.snapshots,
             totals.goals);
  fmt::print(
      "updates: {} of obstacles, {} poses of streams, {} of the map, {} of goals, {} of "
      "parameters; "
      "{} refused\n",
      counts.obstacles.load(), counts.observations.load(), counts.maps.load(), counts.goals.load(),
      counts.params.load(), counts.refused.load());
  fmt::print(
      "{} answers computed again, of which {} would differ with the next recorded snapshot; "
      "{} left out\n",
      checker.checked(), checker.distinguished(), unrecorded);
  if (counts_allocations())
    fmt::print("{} allocations, {} locks\n", totals.allocations, totals.locks);
  return judge(totals, checker, counts, history);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return fail("expected three arguments: TICKS SEED PLANNER");
  try {
    return under_load(std::atol(argv[1]), static_cast<std::uint64_t>(std::atol(argv[2])), argv[3]);
  } catch (const std::exception& e) {
    return fail(e.what());
  }
}
