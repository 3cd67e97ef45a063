#pragma once
#include <optional>
#include <string>
#include <vector>

#include "hamelin/search/search.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "roots.hpp"
#include "shortening.hpp"
#include "tree.hpp"
#include "way_follower.hpp"

namespace hamelin::search {

/// One search, docs/theory.md, chapter 17. Each step chooses a motion; when that is proved or not,
/// the search goes on with the answer.
class Search::Run {
 public:
  Run(const model::Model& model, const Settings& settings);
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;
  ~Run() = default;

  void begin(const Problem& problem, Query& query);
  bool advance(long checks);
  [[nodiscard]] const Path& path() const noexcept { return path_; }
  [[nodiscard]] const Margins& margins() const noexcept { return *margins_; }

 private:
  enum class Phase {
    follow_way,
    first_root,
    more_roots,
    straight,
    known_ahead,
    known_back,
    grow,
    connect,
    walk,
    shorten,
    improve,
    ended
  };
  void step();
  void take_answer(bool clear);
  void ask(const Eigen::VectorXd& a, const Eigen::VectorXd& b);
  void find_first_root();
  /// Takes up the search again with the next, smaller margin. Ends it if there is none.
  void next_margins();
  /// Why there is no root.
  [[nodiscard]] std::string no_root() const;
  /// The way of a goal that has one, at once.
  void follow_way();
  /// Begins with the stretch that leads away from the start. @return whether it is clear
  [[nodiscard]] bool retreat();
  /// @return whether its approach is clear
  [[nodiscard]] bool add_root(const Root& root);
  [[nodiscard]] bool approach(Root& root);
  /// @return the node of its last point
  static int add_chain(const Eigen::MatrixXd& points, Tree& tree);
  void set_margins();
  void take_straight(bool clear);
  void begin_growing();
  void follow_known();
  void take_known(bool clear);
  void find_more_roots();
  void grow();
  [[nodiscard]] bool step_towards(const Eigen::VectorXd& to);
  void connect();
  void take_connected(bool clear);
  void shorten();
  void draw();
  void set_center();
  void join(int in_start, int in_goal);
  void found_first(const Eigen::MatrixXd& points);
  void improve();
  void finish(const Eigen::MatrixXd& points);
  void end(std::string cause);
  [[nodiscard]] long used() const {
    return query_->checks() - before_ + finder_.checks() + followed_ + follower_.checks();
  }

  const Settings& settings_;
  const model::Model& model_;
  dynamics::Workspace ws_;
  Eigen::VectorXd weights_;
  dynamics::JointBox box_, bounds_;
  Roots finder_;
  WayFollower follower_;
  Shortening shortening_;
  Tree from_start_, from_goal_;
  Problem problem_;
  Query* query_ = nullptr;
  TipConstraints* constraints_ = nullptr;  ///< of the query
  Rng rng_{0};
  Phase phase_ = Phase::ended;
  bool asked_ = false;  ///< a motion is being proved
  long before_ = 0;     ///< checks of the query
  long followed_ = 0;   ///< minus those of the follower before the search
  double start_clearance_ = 0.0, self_most_ = 0.0;
  std::size_t attempt_ = 0;  ///< of the margins
  Eigen::MatrixXd head_;     ///< from the start to where the search begins
  std::string blocked_;      ///< why the last approach was
  std::vector<Root> roots_;
  std::size_t tried_ = 0;  ///< roots to which the straight line was tried
  bool tries_known_ = false, follows_known_ = false;  ///< as the first root; its lines
  bool knows_ = false;  ///< the end of the known path is the first root
  /// The way-points [from, to) of the known path are not in a tree yet; nodes beside them.
  Eigen::Index known_from_ = 0, known_to_ = 0;
  int known_start_ = 0, known_goal_ = 0;
  bool known_ends_ = false;  ///< the piece that is asked ends at a way-point
  long next_root_ = 0, improve_until_ = 0;
  std::optional<Margins> margins_;
  bool grows_start_ = true;
  int near_ = 0;                       ///< node from which a motion leads to the sample
  int node_ = 0;                       ///< that the other tree is to be connected with
  Eigen::VectorXd sample_, at_, aim_;  ///< aim_: to which the other tree walks
  Path path_;
};

}  // namespace hamelin::search
