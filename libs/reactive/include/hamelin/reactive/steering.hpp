#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/reactive/prediction.hpp"

namespace hamelin::reactive {

/// What a turn may be chosen from.
enum class TurnKinds { tangents, axes, all };
/// @param name that a parameter has for it
[[nodiscard]] TurnKinds turn_kinds(std::string_view name);

struct SteeringParams {
  TurnKinds kinds = TurnKinds::all;
  int candidates = 8;  ///< per look
};

/// Decides whether the desired velocity is turned, and how: by looks, which predict where the arm
/// comes without and with a turn: docs/theory.md (10.40). A look examines so many postures per
/// tick; it depends on counts alone. Only the constructor allocates.
class Steering {
 public:
  Steering(const planning::Host& host, const planning::Setup& setup, const model::Model& model,
           const LawParams& law, const PointMargins& margins, const SteeringParams& params);
  void set_params(const LawParams& law) noexcept {
    cruise_speed_ = law.cruise_speed;
    prediction_.set_params(law);
  }

  /// Forgets everything, for a new goal.
  void restart();
  /// Goes on with looks and with the turn for a tick. @param distance as Law::distance
  void advance(double time_s, const Eigen::VectorXd& q, double distance, const hamelin_goal& goal,
               bool moving);
  /// The turn in force; see Turn::on().
  [[nodiscard]] const Turn& turn() const noexcept { return turn_; }
  /// Turns the attraction, if a turn is in force. @param M mass matrix
  void apply(const Eigen::MatrixXd& M, Eigen::VectorXd& u);
  /// Whether the present course arrives, as was predicted last.
  [[nodiscard]] bool arrives() const noexcept { return arrives_; }
  /// Looks that tried candidates since the distance had its last new best.
  [[nodiscard]] int looks_in_vain() const noexcept { return looks_in_vain_; }
  /// So many looks in vain, of at least 8 s, try all of a long list about 40 times.
  static constexpr int looks_enough = 160;
  /// Since when the distance has had no new best [s].
  [[nodiscard]] double in_vain_since_s() const noexcept { return overall_.since_s; }
  /// Postures that were predicted.
  [[nodiscard]] long units() const noexcept { return units_; }

 private:
  enum class Phase { idle, straight, present, candidate };

  /// The least distance so far, and since when.
  struct Best {
    double distance, since_s = 0.0;
    /// @return whether this one is clearly less
    bool improves(double candidate, double time_s);
  };

  void note_stall(double time_s, const Eigen::VectorXd& q, double distance);
  void note_basin(const Eigen::VectorXd& end, double distance);
  void remember(const Eigen::VectorXd& stall) { stalls_[stall_count_++ % stalls_.size()] = stall; }
  void begin_look(double time_s, const Eigen::VectorXd& q, const hamelin_goal& goal, bool moving);
  void predict(const Turn& turn);
  void finish_prediction();
  [[nodiscard]] bool may_turn() const;
  void try_next();
  void finish_look();
  void draw_candidate();
  [[nodiscard]] double cost() const;

  const planning::Setup setup_;
  Surroundings surroundings_;
  Prediction prediction_;
  Turner turner_;
  SteeringParams params_;
  std::uint64_t seed_;
  Rng rng_;
  double period_s_, cruise_speed_;

  // of the look
  Phase phase_ = Phase::idle;
  Eigen::VectorXd q_;
  const hamelin_goal* goal_ = nullptr;
  bool moving_ = false;
  double begun_s_ = 0.0, straight_cost_ = 0.0, least_cost_ = 0.0;
  int tried_ = 0;
  bool found_ = false;

  Turn turn_, candidate_, best_turn_;
  Turn none_;
  Eigen::MatrixXd sideways_;
  int sideways_count_ = 0;
  int index_ = 0;  ///< of the cyclic list of candidates
  int looks_in_vain_ = 0;
  bool arrives_ = false;
  std::vector<Eigen::VectorXd> stalls_;
  std::size_t stall_count_ = 0;
  Best overall_;    ///< of the arm's distance, since the start
  Best standing_;   ///< of the arm's distance, since the last stall
  Best predicted_;  ///< of where the course without a turn ends
  long units_ = 0;
};

}  // namespace hamelin::reactive
