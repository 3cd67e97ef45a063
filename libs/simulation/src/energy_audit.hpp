#pragma once
#include <string>

#include "hamelin/planning/plugin_host.hpp"
#include "recorder.hpp"
#include "simulated_arm.hpp"

namespace hamelin::simulation {

/// Books the energies of a run node by node, and checks what must hold where the accounts close by construction:
/// ideal actuation with hamel-variational.
class EnergyAudit {
 public:
  /// @param closes whether the scheme's gyroscopic work is zero and its account closes
  EnergyAudit(Recorder& recorder, bool closes) : recorder_(recorder), closes_(closes) {}

  /// Books a node's energies. @param control_J value of the planner's control potential
  void book_node(SimulatedArm& arm, double control_J);
  /// As book_node, with the control potential's last known value.
  void book_node(SimulatedArm& arm) { book_node(arm, ledger_.control); }
  /// A control potential acted: how it changes in time is the planner's own, so the balance is only reported from then.
  void note_potential() noexcept { has_potential_ = true; }
  /// Work of a node velocity, and the planner's split of it.
  void book_node_velocity(double work_J, const hamelin_command& answer) noexcept;
  void book_filter(const hamelin_command& answer) noexcept;
  void book_step(const integration::StepReport& report) noexcept { ledger_.book(report); }

  /// What is wrong with the node's account or the last step's gyroscopic work; empty if nothing is.
  [[nodiscard]] std::string fault(const SimulatedArm& arm) const;
  /// What is wrong with the planner's own accounts; empty if nothing is.
  [[nodiscard]] std::string fault_of_planner(const hamelin_command& answer) const;

  [[nodiscard]] const Ledger& ledger() const noexcept { return ledger_; }

 private:
  Recorder& recorder_;
  bool closes_;
  bool has_potential_ = false;
  double exchanged_J_ = 1.0;  ///< 1 J and all that ever went from one account to another
  Ledger ledger_;
};

}  // namespace hamelin::simulation
