#pragma once
#include <vector>

#include "hamelin/core/rng.hpp"
#include "joint_path.hpp"
#include "parts.hpp"

namespace hamelin::hybrid {

/// The box in joint space from which random joint vectors are drawn: the joint limits, ±π where
/// there are none.
struct JointBox {
  explicit JointBox(const planning::Setup& setup, const Eigen::VectorXd& weights);
  void draw(Rng& rng, Eigen::VectorXd& q) const;
  /// Draws around a centre, at a distance of at most `radius`. Joints with a small weight vary
  /// less.
  void draw_near(Rng& rng, const Eigen::VectorXd& center, double radius, Eigen::VectorXd& q) const;
  Eigen::VectorXd lower, upper, weights;
};

/// Joint vectors at which a search may end: the joint goal, collision-free solutions of a tip goal,
/// or places on the goal's path behind its blocked stretch. They are found in small increments.
class Roots {
 public:
  static constexpr int max_count = 6;
  Roots(const planning::Setup& setup, const model::Model& model, const LawParams& law,
        const JointBox& box, Surroundings& surroundings);

  void set_params(const LawParams& law) noexcept { law_.set_params(law); }
  /// Starts to look for roots from q.
  /// @param path the goal's path, or null
  /// @param from the arc length at which the arm is on it
  void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* path,
             double from);
  /// Checks up to `units` configurations and returns how many it checked.
  int advance(int units, Rng& rng);
  [[nodiscard]] bool done() const noexcept { return done_; }
  [[nodiscard]] int count() const noexcept { return count_; }
  /// Root i. The roots of a tip goal are sorted by their distance from the start.
  [[nodiscard]] auto q(int i) const { return q_.col(i); }
  /// The arc length of root i on the goal's path.
  [[nodiscard]] double arc_length(int i) const { return arc_lengths_[static_cast<std::size_t>(i)]; }

 private:
  void add(const Eigen::Ref<const Eigen::VectorXd>& q, double arc_length);
  void solve_tip(Rng& rng);
  void search_path();
  void finish();

  const model::Model& model_;
  const JointBox& box_;
  Surroundings& surroundings_;
  dynamics::Workspace ws_;
  Law law_;
  const hamelin_goal* goal_ = nullptr;
  const JointPath* path_ = nullptr;
  bool done_ = true, found_block_ = false;
  int count_ = 0, attempt_ = 0, iteration_ = 0;
  double s_ = 0.0, exit_ = 0.0;
  Eigen::VectorXd start_, x_, u_;
  Eigen::MatrixXd q_;
  std::vector<double> arc_lengths_;
};

}  // namespace hamelin::hybrid
