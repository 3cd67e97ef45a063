#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "evaluator.hpp"
#include "sampler.hpp"
#include "workers.hpp"

namespace hamelin::mppi {

/// Makes and evaluates the rollouts of one plan at a time, on worker threads or in shares on the
/// thread of the tick. What it computes does not depend on the number
/// of threads, nor on their timing.
class RolloutPool {
 public:
  /// @param threads 0: all work is done by share() and finish()
  RolloutPool(const planning::Host& host, const planning::Setup& setup, const model::Model& model,
              Eigen::Index point_count, int samples, int threads, Task& task);

  /// Takes the newest snapshot of the world. Only while no plan is in work.
  void refresh();
  /// Starts the work on the task, which must not change until finish().
  void start();
  /// Without threads: does the work up to a share of the whole (0 to 1).
  void share(double of_whole);
  /// Returns when the work is done.
  void finish();

  [[nodiscard]] Eigen::Index sample_count() const {
    return static_cast<Eigen::Index>(blocks_.size()) * lane_count;
  }
  [[nodiscard]] double cost(Eigen::Index sample) const {
    return block(sample).cost[sample % lane_count];
  }
  [[nodiscard]] double clearance_m(Eigen::Index sample) const {
    return block(sample).clearance_m[sample % lane_count];
  }
  [[nodiscard]] bool collides(Eigen::Index sample) const {
    return block(sample).collides[static_cast<std::size_t>(sample % lane_count)];
  }
  void get_points(Eigen::Index sample, Eigen::MatrixXd& out) const {
    block(sample).get_lane(sample % lane_count, out);
  }
  [[nodiscard]] const std::vector<Rollouts>& blocks() const noexcept { return blocks_; }
  /// The evaluator of the tick's thread, while no plan is in work.
  [[nodiscard]] Evaluator& evaluator() noexcept { return *evaluators_.front(); }

 private:
  void begin(std::size_t worker, std::size_t block);
  void work(int worker, int unit);
  [[nodiscard]] const Rollouts& block(Eigen::Index sample) const {
    return blocks_[static_cast<std::size_t>(sample / lane_count)];
  }

  Task& task_;
  std::vector<std::unique_ptr<Evaluator>> evaluators_;
  std::vector<Sampler> samplers_;
  std::vector<Rollouts> blocks_;
  Eigen::Index done_ = 0;  ///< rollouts evaluated by share()
  bool active_ = false;
  std::optional<Workers> workers_;  ///< last, so that they end before what they use
};

}  // namespace hamelin::mppi
