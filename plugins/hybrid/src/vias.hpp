#pragma once
#include "search.hpp"

namespace hamelin::hybrid {

/// Rollouts through random vias: towards the via, then towards the goal, from here or from the best end so far. The
/// first that arrives wins; else the one that comes nearest to the goal, if that is nearer than here; else one towards
/// a random via.
class Vias final : public Search {
 public:
  Vias(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box);

  void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const Way* path, double from) override;
  [[nodiscard]] bool advance(int units) override;
  [[nodiscard]] const Way& way() const override { return best_; }
  [[nodiscard]] bool arrives() const override { return arrives_; }
  [[nodiscard]] double along() const override { return along_; }
  [[nodiscard]] long units() const override { return units_; }

 private:
  enum class Phase { roots, to_via, to_target, over };
  void next_via();
  void head_for_target();
  void over(bool arrived);
  void roll();

  const JointBox& box_;
  Rollout& rollout_;
  Roots& roots_;
  Rng rng_;
  const hamelin_goal* goal_ = nullptr;
  bool path_ = false;
  Way trial_, best_;
  Eigen::VectorXd start_, via_, point_, to_;
  Phase phase_ = Phase::over;
  Eigen::Index begin_ = 0, via_end_ = 0;
  int tried_ = 0, target_ = 0, stalls_ = 0;
  double best_distance_ = 0.0, along_ = 0.0;
  bool arrives_ = false, nearer_ = false;
  long units_ = 0;
};

}  // namespace hamelin::hybrid
