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
  std::size_t closest_self(std::span<const double> q, double influence_m, std::span<hamelin_self_contact> out) override;

  struct GoalError {
    double metres = 0.0, radians = 0.0;
    bool has_metres = false, has_radians = false, reached = false;
  };

  void check_scene() const;
  [[nodiscard]] planning::SetupData setup_data(const model::Model& nominal, double influence) const;
  /// Contacts and clearances at q; poses of plant_ws_ follow.
  void look(const Eigen::VectorXd& q);
  void look_at_obstacles();
  void look_at_itself();
  /// Of the tip's point at this node [m/s].
  [[nodiscard]] double tip_speed() const;
  [[nodiscard]] GoalError goal_error() const;
  /// Skips all goals that are reached; true if none is left.
  bool all_reached();
  /// The planner's answer for this node into command_; false if it failed.
  [[nodiscard]] bool call_planner();
  /// The same; ends the run if the planner gave up or failed.
  void ask_planner();
  /// The closing half-kick of the step that led here, with the gradient now known; then the node's energies are booked.
  void arrive();
  /// The node's energies, and what went from one account to another since the last one.
  void book_node(double control_J);
  /// Arrives, and puts the planner's answer into channels, kicks and node velocity.
  void actuate();
  /// Arrives at the last node, where nothing acts any more.
  void settle();
  void actuate_sampled();
  void take_gyroscopic_terms();
  /// Cuts the held torque at the limits and scales what turns motion as a whole.
  void limit_torques();
  /// How much of the node's change of velocity the torque limits leave, 0 to 1.
  [[nodiscard]] double room_for_node_velocity();
  /// Ends the run as a defect if the planner's accounts say what no filter may do.
  void check_accounts();
  /// The same for the energy account, and for the work of the last step's gyroscopic terms.
  void check_energy();
  [[nodiscard]] static hamelin_contact to_c(const scene::Contact& contact);
  [[nodiscard]] static hamelin_self_contact to_c(const scene::SelfContact& contact);
  [[nodiscard]] bool at_rest_away_from_goal();
  void finish(log::Outcome outcome, std::string cause);
  /// Whether the step that led here stayed clear, from what was looked at here and at the node before. A map that
  /// changed in between asks for it twice: with both nodes looked at before the change, and after.
  [[nodiscard]] Certificate::Verdict certify();
  [[nodiscard]] std::string where_touching() const;
  /// Warns of goals that stand in contact.
  void look_at_goals(const Watch& watch);
  [[nodiscard]] Json header() const;
  /// The torques of each channel at this node, for the log: tau_ and channel_torques_.
  void gather_torques();
  void log_tick(bool certified);
  void fill_result();
  [[nodiscard]] bool torques_limited() const noexcept {
    return limits_.size() > 0 || scene_.actuation.torque_rate_max_Nm_s.has_value();
  }

  const scene::Scene& scene_;
  model::Model plant_;
  dynamics::Workspace ws_;
  integration::Options options_;
  std::unique_ptr<integration::Integrator> integrator_;
  std::unique_ptr<scene::Environment> environment_;
  std::unique_ptr<scene::Environment::Scratch> scratch_;
  std::unique_ptr<scene::SelfField> self_;  ///< null where self-collision is not modelled
  std::unique_ptr<Certificate> certificate_;
  Json planner_params_;
  std::vector<log::Input> inputs_;
  double influence_ = 0.0, self_influence_ = 0.0;
  bool hidden_obstacles_ = false;   ///< the judge sees what the planner does not
  std::vector<std::uint8_t> seen_;  ///< obstacles that came into sight, see Environment::see
  long control_steps_ = 1, delay_periods_ = 0, steps_ = 0;

  // what the planner is shown and answers
  std::vector<scene::Contact> contacts_;
  std::vector<hamelin_contact> shown_;
  std::vector<scene::SelfContact> self_contacts_;
  std::vector<hamelin_self_contact> self_shown_;
  std::size_t contact_count_ = 0, self_contact_count_ = 0;
  std::unique_ptr<planning::CommandBuffers> command_;
  Rng noise_;
  Eigen::VectorXd q_shown_, v_shown_, q_asked_;

  // motion
  integration::State state_;
  integration::Channels channels_;
  integration::StepReport report_;
  Eigen::VectorXd v_, q_before_, v_before_, gradient_, gradient_before_, impulse_, limits_, plant_damping_;
  Eigen::VectorXd node_velocity_, turning_;  ///< what the node's velocity really becomes; gyroscopic torque at the node
  std::vector<Eigen::VectorXd> delayed_;
  Eigen::VectorXd torque_before_;  ///< of the last tick, where its rate is limited
  bool kicked_ = false;            ///< a closing half-kick is owed
  double speed_scale_ = 1.0;
  Eigen::VectorXd tau_;  ///< only where a log is written
  Json channel_torques_;

  // surroundings at this node
  scene::PlacedShapes arm_, arm_before_, asked_;  ///< at this node, at the last, where the planner asks
  std::vector<double> clearance_, clearance_before_, self_clearance_, self_clearance_before_;
  double clearance_now_ = 0.0, self_clearance_now_ = 0.0;
  double time_before_s_ = 0.0;
  int nearest_pair_ = -1;
  scene::Contact nearest_;  ///< sphere −1: nothing is near

  std::size_t goal_index_ = 0;
  double rest_s_ = 0.0;
  long certified_steps_ = 0, checked_steps_ = 0, saturated_steps_ = 0;
  bool saturated_ = false;      ///< a limit cut the planner's answer that acts now
  bool proves_energy_ = false;  ///< the scheme's gyroscopic work is zero and its account closes
  bool has_potential_ = false;  ///< a control potential acted in this run
  double exchanged_J_ = 1.0;    ///< 1 J and all that ever went from one account to another
  Ledger ledger_;
  log::Result result_;
  Recorder* recorder_ = nullptr;
  bool done_ = false;
  std::vector<std::string> early_events_;
  planning::LoadedPlanner planner_;  ///< last: it is made from the rest
};

}  // namespace hamelin::simulation
