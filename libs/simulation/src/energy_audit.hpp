#pragma once
#include <string>

#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/simulation/plant.hpp"
#include "recorder.hpp"

namespace hamelin::simulation {

/// Books the energies of a run node by node and checks them where the accounts close by
/// construction: under ideal actuation with hamel-variational. docs/theory.md (8.11), (8.13).
class EnergyAudit {
 public:
  /// @param closes whether the scheme's gyroscopic work is zero and its account closes
  EnergyAudit(Recorder& recorder, bool closes) : recorder_(recorder), closes_(closes) {}

  /// Books the energies of node k. @param control_J value of the planner's control potential
  void book_node(long k, const integration::Energy& energy, double control_J);
  /// The same for the node at which a plant is.
  void book_node(Plant& plant, double control_J) {
    book_node(plant.node().k, plant.energy(), control_J);
  }
  /// As book_node, with the control potential's last known value.
  void book_node(Plant& plant) { book_node(plant, ledger_.control); }
  /// Notes that a control potential acted. The planner may change it over time, so from then on the
  /// balance is reported but not checked.
  void note_potential() noexcept { has_potential_ = true; }
  /// Books the work of a node velocity, docs/theory.md (8.6), and how the planner splits it.
  void book_node_velocity(double work_J, const hamelin_command& answer) noexcept;
  /// Books the energy that comes with what is attached, or goes with what is detached.
  void book_load(double energy_J) noexcept;
  void book_filter(const hamelin_command& answer) noexcept;
  /// @param stopping whether a stop of the shield held the torque
  void book_step(const integration::StepReport& report, bool stopping) noexcept {
    ledger_.book(report, stopping);
  }

  /// What is wrong with the node's account or the last step's gyroscopic work; empty if nothing.
  [[nodiscard]] std::string fault(const Plant& plant) const;
  /// What is wrong with the planner's own accounts; empty if nothing.
  [[nodiscard]] std::string fault_of_planner(const hamelin_command& answer) const;

  [[nodiscard]] const Ledger& ledger() const noexcept { return ledger_; }

 private:
  Recorder& recorder_;
  bool closes_;
  bool has_potential_ = false;
  double exchanged_J_ = 1.0;  ///< 1 J plus all energy exchanged between accounts so far
  Ledger ledger_;
};

}  // namespace hamelin::simulation
