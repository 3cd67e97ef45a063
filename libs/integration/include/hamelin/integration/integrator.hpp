#pragma once
#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/options.hpp"
#include "hamelin/integration/step_history.hpp"

namespace hamelin::integration {

using dynamics::ConstVectorRef;
using dynamics::GyroscopicTerm;
using dynamics::VectorRef;
using Eigen::VectorXd;
using model::Model;

/// What acts on the arm during one step besides gravity. Coefficients are kept over the step and evaluated at
/// the scheme's own velocity: midpoint, stage or sub-step. Empty vectors mean none and cost nothing. The nodal
/// potential (a) and the node impulse (e) act between steps: Integrator::kick and Integrator::set_velocity.
struct Channels {
  VectorXd damping;                        ///< (b) torque −damping_i v_i; empty or dof [Nm s/rad]
  VectorXd coulomb;                        ///< dry friction −coulomb_i tanh(v_i / coulomb_speed); empty or dof [Nm]
  double coulomb_speed = 0.01;             ///< below it dry friction turns viscous [rad/s or m/s]
  std::vector<GyroscopicTerm> gyroscopic;  ///< (c)
  VectorXd held_torque;                    ///< (d) empty or dof [Nm]

  [[nodiscard]] bool none() const noexcept {
    return damping.size() == 0 && coulomb.size() == 0 && gyroscopic.empty() && held_torque.size() == 0;
  }
};

/// What an integrator remembers between steps: a plain value, to be copied, kept and restored. Of v and p a state has
/// the one that its scheme steps, and the other is empty: Integrator::velocity() answers for all schemes.
struct State {
  double time_s = 0.0;
  long k = 0;
  VectorXd q;
  VectorXd v;                        ///< velocity at the node: explicit schemes, newmark, feedback
  VectorXd p;                        ///< momentum at the node [Nm s]; hamel: impulses that no step has taken up yet
  bool jumped = true;                ///< whether the velocity was set or kicked since the last step
  VectorXd memory;                   ///< the scheme's own; hamel: body twists of the last step, dof × (6 or 3)
  VectorXd force_previous;           ///< hamel, newmark: generalised force of the last step
  double step_previous = 0.0;        ///< gauss, hamel, newmark: length of the last step; 0 where there is none
  std::vector<StepHistory> history;  ///< composition: one for each sub-step
  double step_next = 0.0;  ///< what step control takes next [s]: set it for a first step; 0 goes as far as asked
};

/// What one step did.
struct StepReport {
  bool converged = true;
  int updates = 0;         ///< corrections of Δ
  int factorizations = 0;  ///< linear solves that made new factors
  int evaluations = 0;     ///< sweeps over the chain: residuals, or forward dynamics for explicit schemes
  int halvings = 0;        ///< how often the step was halved to find a root
  int rejected = 0;        ///< steps that step control took back
  double step_s = 0.0;     ///< how far the state went
  double residual = 0.0;   ///< the figure the criterion looks at, of the accepted step
  double gyroscopic_work_J = 0.0;
  double dissipated_J = 0.0;  ///< by channel (b) and dry friction, positive
  double held_work_J = 0.0;   ///< by channel (d)
};

/// What two parts of a step did, the second after the first.
[[nodiscard]] StepReport together(const StepReport& a, const StepReport& b);

struct Energy {
  double kinetic_J = 0.0, potential_J = 0.0;
  [[nodiscard]] double total() const noexcept { return kinetic_J + potential_J; }
};

/// A one-step scheme for a chain: θ^k → θ^{k+1}. One object a thread; State is the memory. No allocation in a step. The
/// model is kept by reference and must outlive the integrator.
///
/// Calls check sizes, and that a state is one that this scheme makes for this model, and throw an Error (usage).
/// start() also checks that its numbers are finite; later ones that are not come out as a step that has not converged.
class Integrator {
 public:
  virtual ~Integrator() = default;
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const Model& model() const noexcept { return model_; }
  /// What "converged" means, for the result: e.g. "|delta|_inf <= 1e-12".
  [[nodiscard]] virtual std::string criterion() const = 0;
  /// The number in the criterion, the larger of rtol and atol under step control; 1e-12 where nothing is iterated.
  [[nodiscard]] double tolerance() const noexcept;
  [[nodiscard]] virtual int order() const = 0;
  /// A step is cut into at most 2^max_halvings pieces.
  [[nodiscard]] int max_halvings() const noexcept { return settings_.max_halvings; }

  /// A state at rest or in motion. q0, v0: dof numbers.
  [[nodiscard]] State start(const ConstVectorRef& q0, const ConstVectorRef& v0);
  /// Velocity at the node.
  void velocity(const State& state, VectorRef v) const;
  /// Energy at the node, as the scheme defines it.
  [[nodiscard]] Energy energy(const State& state) const;
  /// Node impulse: p += dp [Nm s].
  void kick(State& state, const ConstVectorRef& dp);
  /// Node velocity: p = M(θ^k) v.
  void set_velocity(State& state, const ConstVectorRef& v);
  /// Exactly h > 0 ahead: one step, or under step control as many as it takes. If it reports converged = false no root
  /// was found, and the state is as it was.
  [[nodiscard]] StepReport step(State& state, const Channels& channels, double h);
  /// One step of at most `limit`: all of it for fixed steps, what step control chooses else (StepReport::step_s).
  [[nodiscard]] StepReport advance(State& state, const Channels& channels, double limit);
  /// Whether the scheme chooses its steps itself (rtol, atol).
  [[nodiscard]] bool adaptive() const noexcept { return settings_.rtol > 0.0 || settings_.atol > 0.0; }
  /// "structure": fixed steps of a structure-preserving scheme, iterated to rounding; else "accurate".
  [[nodiscard]] virtual std::string mode() const { return "accurate"; }

 protected:
  /// What the schemes' options have in common.
  struct Settings {
    Isa isa = default_isa();
    int max_halvings = 0;      ///< 0 for explicit schemes: a shorter step finds no other root
    double tolerance = 1e-12;  ///< the number in the criterion, for fixed steps
    double rtol = 0.0, atol = 0.0;
  };
  Integrator(std::string name, const Model& model, const Settings& settings);

  /// Sets whatever the scheme keeps besides q, which is there.
  virtual void begin(State& state, const ConstVectorRef& v0) = 0;
  virtual void node_velocity(const State& state, VectorRef v) const = 0;
  [[nodiscard]] virtual Energy node_energy(const State& state) const;
  virtual void add_momentum(State& state, const ConstVectorRef& dp) = 0;
  virtual void replace_velocity(State& state, const ConstVectorRef& v) = 0;
  /// One undivided step. Where it does not converge the state is left as it was.
  virtual StepReport attempt(State& state, const Channels& channels, double h) = 0;
  /// One step under step control, of at most `limit`, chosen by State::step_next; rejected ones are counted. Where it
  /// fails the state is left as it was. Schemes without step control never get here: make_options refuses.
  virtual StepReport controlled(State& state, const Channels& channels, double limit);

  const Model& model_;
  const Settings settings_;
  mutable dynamics::Workspace ws_;

 private:
  /// Sizes of what a scheme keeps in a state.
  struct Shape {
    Eigen::Index q = 0, v = 0, p = 0, memory = 0, force_previous = 0;
    std::size_t history = 0;
    friend bool operator==(const Shape&, const Shape&) = default;
  };
  static Shape shape_of(const State& state) noexcept;
  void check(const char* function, const State& state) const;
  void check(const char* function, const State& state, const Channels& channels, double h);
  void check_channels(const char* function, const Channels& channels) const;
  void refuse_shape(const char* function, const State& state) const;
  void check_size(const char* function, const char* argument, Eigen::Index given) const;
  /// Makes the room that steps need; at the latest before the first.
  void prepare();
  StepReport go(State& state, const Channels& channels, double limit);
  StepReport parts(State& state, const Channels& channels, double h);
  /// One step, in halves where no root is found.
  StepReport divide(State& state, const Channels& channels, double h, int depth);
  void halve(State& state, const Channels& channels, double h, int depth, StepReport& report);

  std::string name_;
  Shape shape_;                ///< of this scheme's states, once prepared
  std::vector<State> saved_;   ///< one a halving level
  mutable VectorXd velocity_;  ///< scratch of node_energy()
};

/// @throws Error usage for numbers out of range, e.g. an order that the scheme does not have
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(const Model& model, const Options& options);
/// The integrator keeps a reference to the model, so a temporary would not outlive this call.
std::unique_ptr<Integrator> make_integrator(const Model&& model, const Options& options) = delete;

/// The same by name: make_integrator("gauss:8", model).
/// @throws Error usage as make_options
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(std::string_view name, const Model& model,
                                                          const Parameters& parameters = {});
std::unique_ptr<Integrator> make_integrator(std::string_view name, const Model&& model,
                                            const Parameters& parameters = {}) = delete;

}  // namespace hamelin::integration
