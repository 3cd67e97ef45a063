#pragma once
#include <memory>
#include <string>
#include <vector>

#include "actuation.hpp"
#include "energy_audit.hpp"
#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/control/planner_host.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/simulation/run.hpp"
#include "recorder.hpp"
#include "simulated_arm.hpp"
#include "tick_log.hpp"

namespace hamelin::simulation {

/// A scene made ready to run: the control half (world, planner, goals), the arm that is simulated, and what carries
/// answers out. One object a run.
class ClosedLoop {
 public:
  /// @throws Error for bad input: robot, map, planner parameters, goals that do not fit the robot
  ClosedLoop(const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories);
  [[nodiscard]] log::Result run(const Watch& watch);

 private:
  void make_planner(const planning::Plugin& plugin);
  /// A line of the planner.
  void take_line(std::int32_t level, std::string_view line);
  /// An event, to the log and to whoever reads diagnostics.
  void tell(bool warning, const std::string& text);
  [[nodiscard]] bool diagnosed(int level) const;
  void start(const Watch& watch);
  void warn_of_goals_in_contact(const Watch& watch);

  /// Where the last step led: velocity, surroundings, proof of the way there, and the map's changes that are due.
  void look();
  void certify();
  void change_map();
  /// Whether the run is over at this node.
  void decide();
  /// Ends a run whose start is in contact.
  void refuse();
  /// The planner's answer for this node. @return false if it failed
  bool call_planner();
  void ask_planner();
  /// Books the node and puts the answer into effect.
  void act();
  /// Nothing acts any more, but the last node's energies still belong to the account.
  void settle();
  void write_tick();
  void step();

  void finish(log::Outcome outcome, std::string cause);
  void finish_if(std::string defect);
  void fill_result();

  const scene::Scene& scene_;
  model::Model model_;
  integration::Parameters options_;
  long steps_ = 0;
  SimulatedArm arm_;
  Json planner_params_;
  std::vector<log::Input> inputs_;
  log::Result result_;
  std::unique_ptr<control::WorldView> world_;
  std::unique_ptr<control::PlannerHost> planner_;
  control::GoalTracker goals_;
  std::unique_ptr<Actuation> actuation_;
  Rng noise_;
  Eigen::VectorXd q_measured_;

  // of a run
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<EnergyAudit> audit_;
  std::unique_ptr<TickLog> log_;
  const Watch* watch_ = nullptr;
  struct Line {
    bool warning;
    std::string text;
  };
  std::vector<Line> early_lines_;  ///< what the planner said before the log was open
  bool certified_ = true;          ///< of the step that led to this node
  bool touching_ = false;
  bool done_ = false;
  double min_clearance_ = 0.0, min_self_clearance_ = 0.0;
  long certified_steps_ = 0, checked_steps_ = 0, saturated_steps_ = 0;
};

}  // namespace hamelin::simulation
