#include "rollout_pool.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::mppi {

RolloutPool::RolloutPool(const planning::Host& host, const planning::Setup& setup,
                         const model::Model& model, Eigen::Index point_count, int samples,
                         int threads, Task& task)
    : task_(task),
      blocks_(static_cast<std::size_t>(samples) / lane_count, Rollouts(model.dof(), point_count)) {
  for (int i = 0; i < std::max(1, threads); ++i) {
    evaluators_.push_back(std::make_unique<Evaluator>(host, setup, model, point_count));
    samplers_.emplace_back(model.dof(), point_count);
  }
  if (threads > 0) workers_.emplace(threads, [this](int worker, int unit) { work(worker, unit); });
}

void RolloutPool::refresh() {
  for (auto& evaluator : evaluators_) evaluator->refresh();
}

void RolloutPool::start() {
  done_ = 0;
  active_ = true;
  if (workers_) workers_->start(static_cast<int>(blocks_.size()));
}

void RolloutPool::share(double of_whole) {
  if (workers_ || !active_) return;
  const auto target = std::min(
      sample_count(),
      static_cast<Eigen::Index>(std::ceil(of_whole * static_cast<double>(sample_count()))));
  for (; done_ < target; ++done_) {
    const auto block = static_cast<std::size_t>(done_ / lane_count);
    if (done_ % lane_count == 0) begin(0, block);
    evaluator().evaluate(task_, blocks_[block], done_ % lane_count);
  }
}

void RolloutPool::finish() {
  if (workers_)
    workers_->wait();
  else
    share(1.0);
  active_ = false;
}

void RolloutPool::begin(std::size_t worker, std::size_t block) {
  if (block == 0)
    samplers_[worker].propose(task_, blocks_[block]);
  else
    samplers_[worker].sample(task_, block, blocks_[block]);
  evaluators_[worker]->begin(task_, blocks_[block]);
}

void RolloutPool::work(int worker, int unit) {
  const auto w = static_cast<std::size_t>(worker), block = static_cast<std::size_t>(unit);
  begin(w, block);
  for (Eigen::Index lane = 0; lane < lane_count; ++lane)
    evaluators_[w]->evaluate(task_, blocks_[block], lane);
}

}  // namespace hamelin::mppi
