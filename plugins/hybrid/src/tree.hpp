#pragma once
#include <array>
#include <vector>

#include "search.hpp"

namespace hamelin::hybrid {

/// Two trees of rollouts, from where the arm stands and from where it may end, grown towards random joint vectors and
/// towards each other until they meet; then the way is straightened where lines are clear. What it finds the law can
/// follow, for its edges are the law's own rollouts.
class Tree final : public Search {
 public:
  Tree(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box, const Margins& margins,
       Surroundings& surroundings, int budget);

  void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const Way* path, double from) override;
  [[nodiscard]] bool advance(int units) override;
  [[nodiscard]] const Way& way() const override { return way_; }
  [[nodiscard]] bool arrives() const override { return !way_.empty(); }
  [[nodiscard]] double along() const override { return along_; }
  [[nodiscard]] long units() const override { return units_; }

 private:
  struct Branches {
    Eigen::MatrixXd q;        ///< one column a node
    std::vector<int> parent;  ///< −1: a root
    [[nodiscard]] int size() const { return static_cast<int>(parent.size()); }
  };
  enum class Phase { roots, direct, extend, connect, straighten, over };

  int add(int side, const Eigen::Ref<const Eigen::VectorXd>& q, int parent);
  [[nodiscard]] int nearest(int side, const Eigen::VectorXd& q) const;
  void start_direct();
  void start_extension();
  /// One look of the rollout under way; when that is over decides what comes next.
  void roll();
  void rolled(bool arrived);
  void join(int node, int other_node);
  void straighten();
  void next_cut();

  const JointBox& box_;
  const Margins& margins_;
  Rollout& rollout_;
  Roots& roots_;
  Surroundings& surroundings_;
  Rng rng_;
  int budget_;
  std::array<Branches, 2> trees_;  ///< from the arm; from the roots
  Way way_;
  Eigen::VectorXd via_, point_, from_, to_;
  Phase phase_ = Phase::over;
  int side_ = 0, node_ = 0, first_node_ = 0, other_ = 0, direct_ = 0, rounds_ = 0, left_ = 0;
  int cuts_ = 0, cut_step_ = 0, cut_steps_ = 0;
  double cut_a_ = 0.0, cut_b_ = 0.0, along_ = 0.0;
  bool local_ = false;
  long units_ = 0;
};

}  // namespace hamelin::hybrid
