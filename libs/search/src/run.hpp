#pragma once
#include <optional>
#include <vector>

#include "hamelin/search/search.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "roots.hpp"
#include "shortening.hpp"
#include "tree.hpp"

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
  void add_root(const Root& root);
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
  void finish();
  void end(std::string cause);
  [[nodiscard]] long used() const { return query_->checks() - before_ + finder_.checks(); }

  const Settings& settings_;
  Eigen::VectorXd weights_;
  dynamics::JointBox box_, bounds_;
  Roots finder_;
  Shortening shortening_;
  Tree from_start_, from_goal_;
  Problem problem_;
  Query* query_ = nullptr;
  TipConstraints* constraints_ = nullptr;  ///< of the query
  Rng rng_{0};
  Phase phase_ = Phase::ended;
  bool asked_ = false;  ///< a motion is being proved
  long before_ = 0;     ///< checks of the query
  double start_clearance_ = 0.0, self_most_ = 0.0;
  std::size_t attempt_ = 0;  ///< of the margins
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
