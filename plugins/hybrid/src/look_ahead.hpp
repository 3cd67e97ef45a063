#pragma once
#include <vector>

#include "evasion.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/planning/joint_path.hpp"
#include "parts.hpp"

namespace hamelin::hybrid {

/// The arm's own way: towards the goal, a via, or along a path; or it stands and waits.
struct Way {
  const hamelin_goal* goal = nullptr;
  const Eigen::VectorXd* via = nullptr;  ///< replaces the goal, or null
  /// Leads to the goal or the end of an escape, or null.
  const planning::JointPath* path = nullptr;
  double position = 0.0;  ///< arc length on the path
  double ahead = 0.0;     ///< distance of the carrot on the path
  bool waits = false;
  std::uint64_t goal_number = 0;  ///< as hamelin_tick.goal_number

  /// Whether it leads the same way, from wherever.
  [[nodiscard]] bool operator==(const Way& other) const {
    return goal_number == other.goal_number && via == other.via && path == other.path &&
           waits == other.waits;
  }
};

struct LookAheadParams {
  double velocity_gain, follow_gain, drive_acceleration, acceleration_max, approach_rate;
};

/// Predicted rows of moving obstacles: docs/theory.md (10.34).
struct MoverRows {
  static constexpr std::array<double, 3> times_s{0.1, 0.2, 0.3};
  static constexpr double margin_m = 0.02, softness = 0.2, speed_m_s = 2.5;
};

/// Simulates the arm ahead against the predicted moving obstacles, and looks for an evasion where
/// its own way is not clear: docs/theory.md (10.35)–(10.37). A look starts at one tick, examines so
/// many configurations per tick, and is used at a later one, so that its result does not depend on
/// how the work is split. Only the constructor allocates.
class LookAhead {
 public:
  static constexpr double horizon_s = 1.0, step_s = 0.05;

  /// All must outlive this, but for the host.
  LookAhead(const planning::Setup& setup, const model::Model& model, Law& law,
            const PointMargins& margins, const planning::Host& host);
  void set_params(const LookAheadParams& params) noexcept { params_ = params; }
  void reset();

  /// Takes the moving obstacles of a tick. @param count hamelin_tick.moving_count
  /// @return whether the arm, if it stood still, would come near one within the horizon
  [[nodiscard]] bool is_near(const scene::Shapes& arm, std::size_t count);
  /// Starts a look from a configuration and a velocity, after is_near().
  /// @param trail where the arm came along
  /// @param lead_s time until its result is used @param budget configurations in all
  void begin(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::MatrixXd& M,
             const Eigen::MatrixXd& M_inv, const Way& way, const Trail& trail,
             const Evasion& in_force, bool keep, double lead_s, int budget);
  /// Examines up to `units` configurations.
  void advance(int units);
  [[nodiscard]] bool done() const noexcept { return done_; }
  [[nodiscard]] const Evasion& result() const noexcept { return best_; }
  /// The least distance from the moving obstacles on the way of the result [m].
  [[nodiscard]] double clearance() const noexcept { return best_clearance_; }
  /// Configurations examined since the start.
  [[nodiscard]] long units() const noexcept { return units_; }

 private:
  static constexpr int steps = 20, row_steps = 6, places = steps + row_steps + 1;

  [[nodiscard]] bool next_candidate();
  void start_candidate();
  void finish_candidate();
  void step();
  void set_velocity(double& gain, double& acceleration);
  void add_standing_rows();
  void add_mover_rows(const scene::Shapes& arm);
  void set_box();
  void draw_aside();
  [[nodiscard]] bool has_arrived() const;

  const planning::Setup& setup_;
  const model::Model& model_;
  Law& law_;
  const PointMargins& margins_;
  Surroundings surroundings_;
  Movers movers_;  ///< of the look
  Trail trail_;    ///< of the look
  LookAheadParams params_{};
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  Obstacles obstacles_;
  SafetyFilter filter_;
  Rng rng_;
  std::uint64_t seed_;
  std::vector<Movers::Places> places_;  ///< at the times of the steps

  // of the look
  Eigen::VectorXd start_q_, start_v_;
  Eigen::MatrixXd M_, M_inv_;
  Way way_;
  Evasion in_force_, best_, candidate_;

  bool keep_ = false, done_ = true;
  int budget_ = 0, next_ = 0;
  double best_clearance_ = 0.0;
  long units_ = 0;

  // of the candidate
  Eigen::VectorXd q_, v_, u_, via_, row_, lower_, upper_;
  double position_ = 0.0, clearance_ = 0.0;
  Eigen::Index age_ = 0;
  int step_ = 0;
  bool starts_at_goal_ = false;
};

}  // namespace hamelin::hybrid
