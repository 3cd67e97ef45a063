#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/wrenches.hpp"
#include "hamelin/integration/options.hpp"
#include "hamelin/integration/step_history.hpp"

namespace hamelin::integration {

using dynamics::ConstVectorRef;
using dynamics::ExternalWrench;
using dynamics::GyroscopicTerm;
using dynamics::VectorRef;
using Eigen::VectorXd;
using model::Model;

/// The forces on the arm during one step besides gravity, docs/theory.md (8.2). Coefficients are
/// constant over the step; forces are evaluated at the scheme's own velocity: midpoint, stage or
/// sub-step. Channels that are empty have no effect and no cost. The channels potential and node
/// velocity act between steps: Integrator::kick and Integrator::set_velocity.
///
/// Damping and dry friction take energy out, so a step refuses negative ones. Other numbers that
/// are not finite make the step fail (StepReport::converged).
struct Channels {
  VectorXd damping;  ///< torque −damping_i v_i; empty or dof numbers of at least 0 [Nm s/rad]
  /// Dry friction −coulomb_i tanh(v_i/coulomb_speed); empty or dof numbers of at least 0 [Nm].
  VectorXd coulomb;
  /// Dry friction is viscous below this speed, above 0 if there is any [rad/s or m/s].
  double coulomb_speed = 0.01;
  std::vector<GyroscopicTerm> gyroscopic;
  VectorXd held_torque;  ///< empty or dof [Nm]
  /// Wrenches of the surroundings, held over the step in the terms of their references.
  std::vector<ExternalWrench> wrenches;
  /// If set, wrenches are functions of the state: wherever forces are evaluated, several times per
  /// step, it sets their values at (q, v), for which ws has the poses. What it throws leaves
  /// step(), and the state is then unchanged.
  std::function<void(const dynamics::Workspace& ws, const VectorXd& q, const VectorXd& v,
                     std::span<ExternalWrench> wrenches)>
      wrench_law;

  [[nodiscard]] bool none() const noexcept {
    return damping.size() == 0 && coulomb.size() == 0 && gyroscopic.empty() &&
           held_torque.size() == 0 && wrenches.empty();
  }
};

/// The scheme and the model of a state. Two integrators have the same owner, and may continue each
/// other's states, if they are of one scheme for equal models (Model::fingerprint) with the same
/// options that give the numbers of a state their meaning: the order of gauss and composition, the
/// mode of gauss, alpha of hamel. Solvers, tolerances, halvings and instruction sets do not count.
struct StateOwner {
  std::uint64_t scheme = 0;  ///< 0: no integrator made the state
  std::uint64_t model = 0;   ///< Model::fingerprint
  friend bool operator==(const StateOwner&, const StateOwner&) = default;
};

class WrenchForces;

/// The memory of an integrator between steps: a plain value to copy, keep and restore. Of v and p a
/// state has the one that its scheme steps, and the other is empty; Integrator::velocity() works
/// for all schemes.
struct State {
  StateOwner owner;  ///< set by Integrator::start()
  double time_s = 0.0;
  long k = 0;
  VectorXd q;
  VectorXd v;                  ///< velocity at the node: explicit schemes, newmark
  VectorXd p;                  ///< momentum at the node [Nm s]; hamel: impulses since the last step
  bool jumped = true;          ///< whether the velocity was set or kicked since the last step
  VectorXd memory;             ///< the scheme's own data, e.g. hamel: body twists of the last step
  VectorXd force_previous;     ///< hamel, newmark: generalised force of the last step
  double step_previous = 0.0;  ///< gauss, hamel, newmark: length of the last step, or 0
  std::vector<StepHistory> history;  ///< composition: one per sub-step
  double step_next = 0.0;  ///< next step under step control [s]; 0 tries the whole limit first
};

/// The outcome and the cost of one step.
struct StepReport {
  bool converged = true;
  int updates = 0;                 ///< corrections of Δ
  int factorizations = 0;          ///< factorisations, or multiplications by M⁻¹
  int evaluations = 0;             ///< residuals, stages, or forward dynamics of explicit schemes
  int halvings = 0;                ///< how often the step was halved to find a root
  int rejected = 0;                ///< tries that step control rejected
  double step_s = 0.0;             ///< the time by which the state advanced
  double residual = 0.0;           ///< the value that criterion() bounds, of the accepted step
  double gyroscopic_work_J = 0.0;  ///< this and the works below: docs/theory.md (8.5)
  double dissipated_J = 0.0;       ///< by damping and dry friction, positive
  double held_work_J = 0.0;        ///< by the held torque
  double external_work_J = 0.0;    ///< by the wrenches
};

/// The report of two parts of a step, the second after the first.
[[nodiscard]] StepReport merge(const StepReport& a, const StepReport& b);

struct Energy {
  double kinetic_J = 0.0, potential_J = 0.0;
  [[nodiscard]] double total() const noexcept { return kinetic_J + potential_J; }
};

/// A one-step scheme for a chain: θ^k → θ^{k+1}. An object belongs to one thread; State is the
/// memory. A step allocates nothing. The model is kept by reference and must outlive the
/// integrator.
///
/// Calls check sizes, and that a state is one of this scheme for this model (StateOwner); they
/// throw an Error (usage). start(), kick() and set_velocity() also check that their numbers are
/// finite, so a refused call leaves the state unchanged. If numbers are not finite later, the step
/// reports converged = false.
///
/// Arguments may share memory with the state and with each other in any way: kick(state, state.p)
/// doubles the momentum. What velocity() writes into a vector of the state changes the state.
class Integrator {
 public:
  virtual ~Integrator();
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const Model& model() const noexcept { return model_; }
  /// The condition for converged = true, as text for results: e.g. "|delta|_inf <= 1e-12".
  [[nodiscard]] virtual std::string criterion() const = 0;
  /// The number in the criterion, or the larger of rtol and atol under step control; 1e-12 for
  /// schemes without iteration.
  [[nodiscard]] double tolerance() const noexcept;
  [[nodiscard]] virtual int order() const = 0;
  /// A step is divided into at most 2^max_halvings parts.
  [[nodiscard]] int max_halvings() const noexcept { return settings_.max_halvings; }
  /// That of the states of this integrator.
  [[nodiscard]] const StateOwner& owner() const noexcept { return owner_; }

  /// A state at rest or in motion. q0, v0: dof numbers.
  [[nodiscard]] State start(const ConstVectorRef& q0, const ConstVectorRef& v0);
  /// Writes the velocity at the node to v.
  void velocity(const State& state, VectorRef v) const;
  /// Energy at the node, as the scheme defines it.
  [[nodiscard]] Energy energy(const State& state) const;
  /// The same for callers that have the node's velocity. @param v what velocity() gives
  [[nodiscard]] Energy energy(const State& state, const ConstVectorRef& v) const;
  /// Adds an impulse at the node: p += dp [Nm s], e.g. docs/theory.md (8.1).
  void kick(State& state, const ConstVectorRef& dp);
  /// Sets the velocity at the node: p = M(θ^k) v, docs/theory.md (8.3).
  void set_velocity(State& state, const ConstVectorRef& v);
  /// Advances by exactly h > 0: one step, or under step control as many as needed. If the report
  /// has converged = false, the state is unchanged.
  [[nodiscard]] StepReport step(State& state, const Channels& channels, double h);
  /// Takes one step of at most `limit`: of exactly `limit` for fixed steps, of the length that step
  /// control chooses otherwise (StepReport::step_s).
  [[nodiscard]] StepReport advance(State& state, const Channels& channels, double limit);
  /// Whether the scheme is under step control (rtol, atol).
  [[nodiscard]] bool adaptive() const noexcept {
    return settings_.rtol > 0.0 || settings_.atol > 0.0;
  }
  /// "structure" for fixed steps of a structure-preserving scheme that are iterated to rounding,
  /// otherwise "accurate".
  [[nodiscard]] virtual std::string mode() const { return "accurate"; }
  /// The instruction set of the scheme's recursions: that of its options, or `baseline` for schemes
  /// that are compiled for the baseline only (hamel, hamel-midpoint, lie-exact). Of those, weights
  /// and mass matrices are computed on the set of the options.
  [[nodiscard]] virtual Isa isa() const { return settings_.isa; }

 protected:
  /// The options that all schemes share.
  struct Settings {
    Isa isa = default_isa();
    int max_halvings = 0;      ///< 0 for explicit schemes: they have no root to find
    double tolerance = 1e-12;  ///< the number in the criterion, for fixed steps
    double rtol = 0.0, atol = 0.0;
  };
  Integrator(std::string name, const Model& model, const Settings& settings);

  /// Sets the scheme's part of a state whose q is set.
  virtual void begin(State& state, const ConstVectorRef& v0) = 0;
  virtual void node_velocity(const State& state, VectorRef v) const = 0;
  [[nodiscard]] virtual Energy node_energy(const State& state, const ConstVectorRef& v) const;
  [[nodiscard]] Energy node_energy(const State& state) const;
  virtual void add_momentum(State& state, const ConstVectorRef& dp) = 0;
  virtual void replace_velocity(State& state, const ConstVectorRef& v) = 0;
  /// One undivided step. If it does not converge, the state is unchanged.
  virtual StepReport attempt(State& state, const Channels& channels, double h) = 0;
  /// One step under step control of at most `limit`, starting from State::step_next; rejected tries
  /// are counted. If it fails, the state is unchanged. Never called for schemes without step
  /// control, since make_options refuses rtol and atol for them.
  virtual StepReport controlled_step(State& state, const Channels& channels, double limit);

  const Model& model_;
  const Settings settings_;
  mutable dynamics::Workspace ws_;
  /// Of the current step; a scheme shares it with its parts.
  std::shared_ptr<WrenchForces> wrenches_;

  /// Makes a constructed scheme ready: sets what its states are and allocates the memory that steps
  /// need. make_integrator() calls it; a scheme that is made without that calls it itself.
  void prepare(const StateOwner& owner);

 private:
  /// The sizes of a scheme's states.
  struct Shape {
    Eigen::Index q = 0, v = 0, p = 0, memory = 0, force_previous = 0;
    std::size_t history = 0;
    friend bool operator==(const Shape&, const Shape&) = default;
  };
  static Shape shape_of(const State& state) noexcept;
  void check(const char* function, const State& state) const;
  void check(const char* function, const State& state, const Channels& channels, double h) const;
  void refuse_shape(const char* function, const State& state) const;
  friend std::unique_ptr<Integrator> make_integrator(const Model& model, const Options& options);
  StepReport take_step(State& state, const Channels& channels, double limit);
  /// Exactly h under step control.
  StepReport take_controlled_steps(State& state, const Channels& channels, double h);
  /// One step; if no root is found, its halves: docs/theory.md (4.30).
  StepReport attempt_or_halve(State& state, const Channels& channels, double h, int depth);
  void halve(State& state, const Channels& channels, double h, int depth, StepReport& report);

  std::string name_;
  StateOwner owner_;
  Shape shape_;                ///< of this scheme's states
  std::vector<State> saved_;   ///< one per level of halving
  mutable VectorXd velocity_;  ///< scratch of node_energy()
};

/// @throws Error usage for options out of range, e.g. an order that the scheme does not have
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(const Model& model,
                                                          const Options& options);
/// The integrator keeps a reference to the model, so a temporary would not outlive this call.
std::unique_ptr<Integrator> make_integrator(const Model&& model, const Options& options) = delete;

/// Makes an integrator by name: make_integrator("gauss:8", model).
/// @throws Error usage like make_options
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(std::string_view name, const Model& model,
                                                          const Parameters& parameters = {});
std::unique_ptr<Integrator> make_integrator(std::string_view name, const Model&& model,
                                            const Parameters& parameters = {}) = delete;

}  // namespace hamelin::integration
