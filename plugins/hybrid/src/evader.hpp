#pragma once
#include <array>
#include <optional>

#include "evasion.hpp"
#include "look_ahead.hpp"
#include "parts.hpp"

namespace hamelin::hybrid {

/// What the arm does about moving obstacles: looks ahead at fixed times, keeps the evasion in
/// force, and adds the rows of moving obstacles to the safety filter. It costs nothing where
/// nothing moves, and does not allocate after construction.
class Evader {
 public:
  Evader(const planning::Host& host, const planning::Setup& setup, const model::Model& model,
         Law& law, const PointMargins& margins);
  /// @param budget configurations that a look examines @param steps of them per tick, at least so
  ///        many that the look ends in time
  void set_params(const LookAheadParams& params, int budget, int steps) noexcept;
  void reset();

  /// State of the arm at a tick. ws contains the forward kinematics at q.
  struct Arm {
    const dynamics::Workspace& ws;
    const Eigen::VectorXd &q, &v;
    const Eigen::MatrixXd &M, &M_inv;
  };
  /// Takes the moving obstacles of a tick, and the result of a look that ends with it:
  /// docs/theory.md (10.35).
  /// @param way the arm's own way
  void update(const planning::Tick& tick, const Arm& arm, const Way& way);

  /// Whether anything moves.
  [[nodiscard]] bool active() const noexcept { return movers_.count() > 0; }
  /// Whether the arm leaves its own way.
  [[nodiscard]] bool evades() const noexcept { return evasion_.act != Act::own; }
  [[nodiscard]] Act act() const noexcept { return evasion_.act; }
  /// Whether the obstacle with this id moves.
  [[nodiscard]] bool moves(int obstacle) const noexcept {
    return active() && movers_.contains(obstacle);
  }
  /// Whether rows of moving obstacles act. They do not on ways that were found clear without them.
  [[nodiscard]] bool has_rows() const noexcept { return evasion_.rows || !evasion_.clear; }
  /// The least distance from what moves that the last look found, on the way that the arm takes
  /// [m]; none before the first look, and if nothing is near.
  [[nodiscard]] std::optional<double> clearance_ahead() const noexcept { return clearance_ahead_; }
  /// Where moving obstacles were.
  /// Sets u to the velocity of the evasion; only where the arm evades.
  void velocity(const Eigen::VectorXd& q, Eigen::VectorXd& u) {
    evasion_velocity(evasion_, trail_, q, trail_age_, u);
  }
  /// Adds the predicted rows, docs/theory.md (10.34). @param w velocity from which the arm brakes
  void add_rows(const Arm& arm, const Eigen::VectorXd& w, SafetyFilter& filter);

 private:
  void go_own_way();
  void take_look(double time_s);

  const model::Model& model_;
  double period_s_;
  std::uint64_t look_ticks_;  ///< between the starts of two looks
  std::uint64_t ticks_ = 0;   ///< in which something moved, since the start
  Movers movers_;
  scene::PlacedShapes arm_;
  std::array<Movers::Places, 2> places_;
  Trail trail_;
  Evasion evasion_;  ///< in force
  LookAhead look_;
  Way way_;             ///< along which it looks
  bool looks_ = false;  ///< whether a look is under way
  int budget_ = 1, steps_ = 1;
  Eigen::Index trail_age_ = 0;
  double since_s_ = 0.0;  ///< since when the evasion is in force
  std::optional<double> clearance_ahead_;
  Eigen::VectorXd row_;
};

}  // namespace hamelin::hybrid
