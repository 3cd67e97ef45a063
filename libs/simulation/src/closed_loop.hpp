#pragma once
#include <memory>
#include <string>
#include <vector>

#include "certificate.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/simulation/run.hpp"
#include "recorder.hpp"

namespace hamelin::simulation {

/// A scene made ready to run: plant, surroundings, planner, integrator. One object a run.
///
/// A tick, at node k: velocity → kinematics → closest points → goal and contact checks → planner → closing half-kick of
/// the last step's potential with the gradient now known, node velocity, opening half-kick → integrator step → proof
/// that the motion up to node k+1 stays clear. The planner sees the velocity with the last gradient in the closing
/// half-kick, so that it is asked only once a tick.
class ClosedLoop final : private planning::HostServices {
 public:
  ClosedLoop(const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories);
  [[nodiscard]] log::Result run(const Watch& watch);

 private:
  // planning::HostServices
  void log(std::int32_t level, std::string_view line) override;
  std::size_t closest_points(std::span<const double> q, double influence_m, std::span<hamelin_contact> out) override;

  struct GoalError {
    double metres = 0.0, radians = 0.0;
    bool has_metres = false, has_radians = false, reached = false;
  };

  void check_scene() const;
  [[nodiscard]] planning::SetupData setup_data(const model::Model& nominal, double influence) const;
  /// Contacts and clearances at q; poses of plant_ws_ follow.
  void look(const Eigen::VectorXd& q);
  [[nodiscard]] GoalError goal_error() const;
  /// Skips all goals that are reached; true if none is left.
  bool all_reached();
  /// The planner's answer for this node into command_; false if it failed.
  [[nodiscard]] bool call_planner();
  /// The same; ends the run if the planner gave up or failed.
  void ask_planner();
  /// The closing half-kick of the step that led here, with the gradient now known; then the node's energies are booked.
  void arrive();
  /// Arrives, and puts the planner's answer into channels, kicks and node velocity.
  void actuate();
  /// Arrives at the last node, where nothing acts any more.
  void settle();
  void actuate_sampled();
  void take_gyroscopic_terms();
  void limit_torques();
  [[nodiscard]] static hamelin_contact to_c(const scene::Contact& contact);
  [[nodiscard]] bool at_rest_away_from_goal();
  void finish(log::Outcome outcome, std::string cause);
  [[nodiscard]] std::string where_nearest() const;
  [[nodiscard]] Json header() const;
  /// The torques of each channel at this node, for the log: tau_ and channel_torques_.
  void gather_torques();
  void log_tick(bool certified);
  void fill_result();

  const scene::Scene& scene_;
  model::Model plant_;
  dynamics::Workspace ws_;
  integration::Options options_;
  std::unique_ptr<integration::Integrator> integrator_;
  std::unique_ptr<scene::Environment> environment_;
  std::unique_ptr<scene::Environment::Scratch> scratch_;
  std::unique_ptr<Certificate> certificate_;
  Json planner_params_;
  std::vector<log::Input> inputs_;
  double influence_ = 0.0;
  bool hidden_obstacles_ = false;  ///< the judge sees what the planner does not
  long control_steps_ = 1, delay_periods_ = 0, steps_ = 0;

  // what the planner is shown and answers
  std::vector<scene::Contact> contacts_;
  std::vector<hamelin_contact> shown_;
  std::size_t contact_count_ = 0;
  std::unique_ptr<planning::CommandBuffers> command_;
  Rng noise_;
  Eigen::VectorXd q_shown_, v_shown_;

  // motion
  integration::State state_;
  integration::Channels channels_;
  integration::StepReport report_;
  Eigen::VectorXd v_, q_before_, v_before_, gradient_, gradient_before_, impulse_, limits_, plant_damping_;
  std::vector<Eigen::VectorXd> delayed_;
  bool kicked_ = false;  ///< a closing half-kick is owed
  double speed_scale_ = 1.0;
  Eigen::VectorXd tau_;  ///< only where a log is written
  Json channel_torques_;

  // surroundings at this node
  std::vector<Eigen::Vector3d> centers_;
  std::vector<double> radii_, clearance_, clearance_before_;
  double clearance_now_ = 0.0;
  int nearest_sphere_ = -1, nearest_obstacle_ = scene::Contact::map;

  std::size_t goal_index_ = 0;
  double rest_s_ = 0.0;
  long certified_steps_ = 0, checked_steps_ = 0, saturated_ticks_ = 0;
  Ledger ledger_;
  log::Result result_;
  Recorder* recorder_ = nullptr;
  bool done_ = false;
  std::vector<std::string> early_events_;
  planning::LoadedPlanner planner_;  ///< last: it is made from the rest
};

}  // namespace hamelin::simulation
