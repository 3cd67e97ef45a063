#pragma once
#include <atomic>
#include <memory>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::app {

/// A host without obstacles, which discards messages and counts query handles.
class EmptyHost final : public planning::HostServices {
 public:
  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }
  std::unique_ptr<planning::QueryServices> open_query() override {
    return std::make_unique<Counted>(open_, planning::HostServices::open_query());
  }
  [[nodiscard]] int open_queries() const noexcept { return open_; }

 private:
  /// A query of empty space that counts as open while it exists.
  class Counted final : public planning::QueryServices {
   public:
    Counted(std::atomic<int>& open, std::unique_ptr<planning::QueryServices> empty)
        : open_(open), empty_(std::move(empty)) {
      ++open_;
    }
    ~Counted() override { --open_; }
    Snapshot refresh() override { return empty_->refresh(); }
    void clearance(const double* q, std::size_t count, double time_ahead_s, double at_least_m,
                   double* out) override {
      empty_->clearance(q, count, time_ahead_s, at_least_m, out);
    }
    std::size_t contacts(const double*, double, double,
                         planning::ArrayOut<hamelin_contact>) override {
      return 0;
    }
    std::size_t self_contacts(const double*, double,
                              planning::ArrayOut<hamelin_self_contact>) override {
      return 0;
    }
    bool motion_clear(const double* q0, const double* q1, double t0_s, double t1_s,
                      double& margin_m) override {
      return empty_->motion_clear(q0, q1, t0_s, t1_s, margin_m);
    }
    void distance(const double* points, std::size_t count, double time_ahead_s, double limit_m,
                  double* distance_m, double* gradient) override {
      empty_->distance(points, count, time_ahead_s, limit_m, distance_m, gradient);
    }
    std::size_t boxes(const Eigen::Vector3d&, const Eigen::Vector3d&,
                      planning::ArrayOut<hamelin_box>) override {
      return 0;
    }
    std::size_t obstacles(double, planning::ArrayOut<hamelin_obstacle_state>) override { return 0; }

   private:
    std::atomic<int>& open_;
    std::unique_ptr<planning::QueryServices> empty_;
  };
  std::atomic<int> open_{0};
};

/// Lets a planner answer three ticks on a two-link arm: at rest, in motion, and next to an
/// obstacle.
/// @throws Error if the planner refuses to start, or for an invalid answer
void answer_ticks(const planning::Plugin& plugin, const Json& params, EmptyHost& host);

}  // namespace hamelin::app
