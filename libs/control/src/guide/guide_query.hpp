#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/search/edge_check.hpp"
#include "hamelin/search/line_check.hpp"
#include "hamelin/search/search.hpp"
#include "world/world_query.hpp"

namespace hamelin::control {

/// A world as guides see it: the snapshot of the last refresh(), with obstacles where they are at
/// its time. One thread.
class GuideQuery final : public search::Query {
 public:
  /// All must outlive this.
  GuideQuery(const model::Model& model, const World& world, const WorldView& view);

  /// Takes the newest snapshot, as it is at a time; to be called once before anything else.
  /// @param allowance that of the goal that is searched for: WorldSnapshot::allowance
  /// @return its number
  std::uint64_t refresh(double time_s, std::uint64_t allowance = 0);

  /// WorldSnapshot::standing of the snapshot.
  [[nodiscard]] std::uint64_t standing() const noexcept { return query_.snapshot().standing; }

  [[nodiscard]] double clearance(const Eigen::VectorXd& q, double at_least_m) override;
  [[nodiscard]] double self_clearance(const Eigen::VectorXd& q, double most_m) override {
    ++clearances_;
    return edges_.self_clearance(q, most_m);
  }
  void set_margins(const search::Margins& margins) override { lines_.set_margins(margins); }
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b) override {
    poll();
    lines_.begin_motion(a, b);
  }
  [[nodiscard]] std::optional<bool> prove(long checks) override { return lines_.prove(checks); }
  [[nodiscard]] long checks() const override { return lines_.checks() + clearances_; }

  /// A function to be called now and then during searches. It may throw, which ends the search.
  void set_poll(std::function<void()> poll) { poll_ = std::move(poll); }

  /// The largest distance, but for 0.1 mm, that the arm is proved to keep on the line from a to b;
  /// at most the world's influence. Zero or below: the line is not proved clear. Does not count as
  /// checks.
  [[nodiscard]] double proved_clearance(const Eigen::VectorXd& a, const Eigen::VectorXd& b);

 private:
  void poll() {
    constexpr long calls_between = 256;
    if (poll_ && ++calls_ % calls_between == 0) poll_();
  }

  WorldQuery query_;
  search::LineCheck lines_;
  search::EdgeCheck edges_;
  double influence_, time_s_ = 0.0;
  long clearances_ = 0, calls_ = 0;
  std::function<void()> poll_;
};

/// How a scene's guide searches for an arm.
/// @param nominal the controller's model @param view of the world
/// @param reserve what a shield keeps
/// @param params of the planner: guides keep somewhat more than its margin_m
[[nodiscard]] search::Settings guide_settings(const scene::Scene& scene,
                                              const model::Model& nominal, const WorldView& view,
                                              const LimitReserve& reserve, const Json& params);

}  // namespace hamelin::control
