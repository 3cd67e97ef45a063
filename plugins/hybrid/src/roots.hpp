#pragma once
#include <vector>

#include "hamelin/core/rng.hpp"
#include "law.hpp"
#include "rollout.hpp"
#include "way.hpp"

namespace hamelin::hybrid {

/// A box in joint space to draw from: the joint limits, or a turn where a joint has none.
struct JointBox {
  explicit JointBox(const planning::Setup& setup, const Eigen::VectorXd& weights);
  void draw(Rng& rng, Eigen::VectorXd& q) const;
  /// Around a centre, at most `radius` away; joints that move little are drawn less widely.
  void draw_near(Rng& rng, const Eigen::VectorXd& center, double radius, Eigen::VectorXd& q) const;
  Eigen::VectorXd lower, upper, weights;
};

/// Joint vectors at which a search may end: the goal's own, solutions of a tip goal that stand clear, or places of a
/// path behind the stretch that is blocked. Found a little at a time.
class Roots {
 public:
  static constexpr int most = 6;
  Roots(const planning::Setup& setup, const model::Model& model, const LawParams& law, const JointBox& box,
        Surroundings& surroundings);

  /// @param path the goal's path, or null; `from` is how far along it the arm is
  void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const Way* path, double from);
  /// Works for so many configurations, at most; returns how many were used.
  int advance(int units, Rng& rng);
  [[nodiscard]] bool done() const noexcept { return done_; }
  [[nodiscard]] int count() const noexcept { return count_; }
  /// Nearest to where it began first.
  [[nodiscard]] auto q(int i) const { return q_.col(i); }
  /// How far along the path root i is.
  [[nodiscard]] double along(int i) const { return along_[static_cast<std::size_t>(i)]; }

 private:
  void add(const Eigen::Ref<const Eigen::VectorXd>& q, double along);
  void solve_tip(Rng& rng);
  void follow_path();
  void finish();

  const model::Model& model_;
  const JointBox& box_;
  Surroundings& surroundings_;
  dynamics::Workspace ws_;
  Law law_;
  const hamelin_goal* goal_ = nullptr;
  const Way* path_ = nullptr;
  bool done_ = true, met_block_ = false;
  int count_ = 0, attempt_ = 0, iteration_ = 0;
  double s_ = 0.0, exit_ = 0.0;
  Eigen::VectorXd start_, x_, u_;
  Eigen::MatrixXd q_;
  std::vector<double> along_;
};

}  // namespace hamelin::hybrid
