#pragma once
#include <array>
#include <vector>

#include "search.hpp"

namespace hamelin::hybrid {

/// Grows two trees of rollouts, one from the arm's configuration and one from the roots, towards
/// random joint vectors and towards each other until they meet. Then it shortens the path where
/// straight lines are clear. The law can follow the path because its edges are rollouts of the law.
class Tree final : public Search {
 public:
  Tree(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box,
       const Margins& margins, Surroundings& surroundings, int budget);

  void reset() override { rng_ = Rng(seed_); }
  void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* goal_path,
             double from) override;
  [[nodiscard]] bool advance(int units) override;
  [[nodiscard]] const JointPath& path() const override { return path_; }
  [[nodiscard]] bool arrives() const override { return !path_.empty(); }
  [[nodiscard]] double rejoin_arc_length() const override { return rejoin_arc_length_; }
  [[nodiscard]] long units() const override { return units_; }

 private:
  struct Branches {
    Eigen::MatrixXd q;        ///< one column per node
    std::vector<int> parent;  ///< −1: a root
    [[nodiscard]] int size() const { return static_cast<int>(parent.size()); }
  };
  enum class Phase { roots, direct, extend, connect, straighten, done };

  int add(int side, const Eigen::Ref<const Eigen::VectorXd>& q, int parent);
  [[nodiscard]] int nearest(int side, const Eigen::VectorXd& q) const;
  void start_direct();
  void start_extension();
  /// Takes one step of the current rollout; at its end finish_rollout() starts the next phase.
  void advance_rollout();
  void finish_rollout(bool arrived);
  void join(int node, int other_node);
  void straighten();
  void next_cut();

  const JointBox& box_;
  const Margins& margins_;
  Rollout& rollout_;
  Roots& roots_;
  Surroundings& surroundings_;
  std::uint64_t seed_;
  Rng rng_;
  int budget_;
  std::array<Branches, 2> trees_;  ///< from the arm; from the roots
  JointPath path_;
  Eigen::VectorXd via_, point_, from_, to_;
  Phase phase_ = Phase::done;
  int side_ = 0, node_ = 0, first_node_ = 0, other_ = 0, direct_ = 0, rounds_ = 0, budget_left_ = 0;
  int cuts_ = 0, cut_step_ = 0, cut_steps_ = 0;
  double cut_a_ = 0.0, cut_b_ = 0.0, rejoin_arc_length_ = 0.0;
  bool local_ = false;
  long units_ = 0;
};

}  // namespace hamelin::hybrid
