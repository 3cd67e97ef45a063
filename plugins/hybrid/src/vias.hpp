#pragma once
#include "search.hpp"

namespace hamelin::hybrid {

/// Rollouts through random vias: towards the via and then towards the goal, from the start or from
/// the best end so far. The result is the first rollout that arrives, else the one that ends
/// nearest to the goal if that is nearer than the start, else the first that leads away from the
/// start.
class Vias final : public Search {
 public:
  Vias(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box);

  void reset() override {
    rng_ = Rng(seed_);
    stalls_ = 0;
  }
  void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* goal_path,
             double from) override;
  [[nodiscard]] bool advance(int units) override;
  [[nodiscard]] const JointPath& path() const override { return best_; }
  [[nodiscard]] bool arrives() const override { return arrives_; }
  [[nodiscard]] double rejoin_arc_length() const override { return rejoin_arc_length_; }
  [[nodiscard]] long units() const override { return units_; }

 private:
  enum class Phase { roots, to_via, to_target, done };
  void start_via_rollout();
  void start_target_rollout();
  void finish(bool arrived);
  void advance_rollout();

  const JointBox& box_;
  Rollout& rollout_;
  Roots& roots_;
  std::uint64_t seed_;
  Rng rng_;
  const hamelin_goal* goal_ = nullptr;
  bool follows_path_ = false;
  JointPath trial_, best_;
  Eigen::VectorXd start_, via_, point_, to_;
  Phase phase_ = Phase::done;
  Eigen::Index begin_ = 0, via_end_ = 0;
  int tried_ = 0, target_ = 0, stalls_ = 0;
  double best_distance_ = 0.0, rejoin_arc_length_ = 0.0;
  bool arrives_ = false, improved_ = false;
  long units_ = 0;
};

}  // namespace hamelin::hybrid
