#include "energy_audit.hpp"

#include <fmt/format.h>

#include <cmath>

namespace hamelin::simulation {

namespace {

// Sums that must be zero may reach this share of kinetic energy plus 1 J: far above rounding, far
// below any effect.
constexpr double rounding_share = 1e-9;
// The error of the energy account is the scheme's own: a second-order step that resolves the motion
// (frequency times h below 0.5) errs by (0.5)²/12 = 2 % of the kinetic and exchanged energy,
// docs/theory.md (8.13).
constexpr double account_share = 0.02;

}  // namespace

void EnergyAudit::book_node(long k, const integration::Energy& energy, double control_J) {
  ledger_.kinetic = energy.kinetic_J;
  ledger_.potential = energy.potential_J;
  ledger_.control = control_J;
  const Ledger& last = recorder_.last_node();
  if (k > 0)
    for (const auto account : {&Ledger::kinetic, &Ledger::potential, &Ledger::held, &Ledger::stop,
                               &Ledger::dissipated, &Ledger::node, &Ledger::external})
      exchanged_J_ += std::abs(ledger_.*account - last.*account);
  recorder_.node(ledger_);
}

void EnergyAudit::book_node_velocity(double work_J, const hamelin_command& answer) noexcept {
  ledger_.node += work_J;
  book_filter(answer);
}

void EnergyAudit::book_load(double energy_J) noexcept {
  ledger_.load += energy_J;
}

void EnergyAudit::book_filter(const hamelin_command& answer) noexcept {
  ledger_.filter += answer.filter_work_J;
  ledger_.recovery += answer.recovery_work_J;
}

std::string EnergyAudit::fault(const Plant& plant) const {
  if (!closes_ || plant.node().k == 0) return {};
  const double gyroscopic_work = plant.report().gyroscopic_work_J;
  if (std::abs(gyroscopic_work) > rounding_share * (ledger_.kinetic + 1.0))
    return fmt::format("step {}: gyroscopic terms did {:.3g} J of work, expected none",
                       plant.node().k, gyroscopic_work);
  if (has_potential_ ||
      !(recorder_.energy_error() > account_share * (exchanged_J_ + ledger_.kinetic)))
    return {};
  return fmt::format(
      "step {}: the energy account is off by {:.3g} J, with {:.3g} J of kinetic energy and {:.3g} "
      "J exchanged; "
      "expected less than {} of their sum; try a smaller step",
      plant.node().k, recorder_.energy_error(), ledger_.kinetic, exchanged_J_, account_share);
}

std::string EnergyAudit::fault_of_planner(const hamelin_command& answer) const {
  if (!closes_) return {};
  const double rounding = rounding_share * (ledger_.kinetic + 1.0);
  if (answer.filter_work_J > rounding)
    return fmt::format(
        "its filter added {:.3g} J, expected none because standing still is admissible",
        answer.filter_work_J);
  if (answer.recovery_work_J < -rounding)
    return fmt::format("its recovery took out {:.3g} J, expected none", -answer.recovery_work_J);
  return {};
}

}  // namespace hamelin::simulation
