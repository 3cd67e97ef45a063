#include <algorithm>
#include <exception>
#include <mutex>
#include <thread>

#include "hamelin/core/error.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/pairs.hpp"

namespace hamelin::sweep {

namespace {

scene::Scene scene_of(const scene::Scene& scene, const Pair& pair) {
  scene::Scene copy = scene;
  scene::Goal goal;
  goal.type = scene::GoalType::joint;
  goal.tolerance_rad = 0.05;
  goal.speed_max = 0.05;
  if (!scene.goals.empty() && scene.goals.front().type == scene::GoalType::joint)
    goal = scene.goals.front();
  goal.q = pair.goal;
  copy.goals = {goal};
  copy.start_q = pair.start;
  copy.start_v = Eigen::VectorXd();
  return copy;
}

/// State that the threads share: the pairs still to be run, and the results, which are reported in
/// the order of the pairs.
class Queue {
 public:
  Queue(std::size_t count, const PairRuns& runs) : runs_(runs), results_(count) {}

  [[nodiscard]] std::optional<std::size_t> take() {
    const std::scoped_lock lock(mutex_);
    if (next_ == results_.size() || failure_ || (runs_.stop != nullptr && runs_.stop->load()))
      return std::nullopt;
    return next_++;
  }

  void put(std::size_t index, log::Result result) {
    const std::scoped_lock lock(mutex_);
    results_[index] = std::move(result);
    for (; !failure_ && reported_ < results_.size() && results_[reported_]; ++reported_)
      if (runs_.on_result) runs_.on_result(reported_, *results_[reported_]);
  }

  void fail(std::exception_ptr failure) {
    const std::scoped_lock lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
  }

  /// To be called after all threads have ended. Every index that was taken has its result by then.
  [[nodiscard]] std::vector<log::Result> finish() {
    if (failure_) std::rethrow_exception(failure_);
    std::vector<log::Result> results;
    for (std::size_t i = 0; i < next_; ++i) results.push_back(std::move(*results_[i]));
    return results;
  }

 private:
  const PairRuns& runs_;
  std::mutex mutex_;
  std::vector<std::optional<log::Result>> results_;
  std::size_t next_ = 0, reported_ = 0;
  std::exception_ptr failure_;
};

}  // namespace

std::vector<log::Result> run_pairs(const scene::Scene& scene, const std::vector<Pair>& pairs,
                                   const PairRuns& runs) {
  if (runs.jobs == 0) throw Error(ErrorCode::usage, "0 jobs, expected at least 1");
  Queue queue(pairs.size(), runs);
  const auto work = [&] {
    try {
      while (const auto index = queue.take()) {
        simulation::Watch watch;
        watch.stop = runs.stop;
        queue.put(*index, simulation::run(scene_of(scene, pairs[*index]), runs.plugin_directories,
                                          watch, runs.plant_factory));
      }
    } catch (...) {
      queue.fail(std::current_exception());
    }
  };
  {
    std::vector<std::jthread> threads;
    const std::size_t count = std::min(runs.jobs, pairs.size());
    for (std::size_t i = 0; i < count; ++i) threads.emplace_back(work);
  }
  return queue.finish();
}

}  // namespace hamelin::sweep
