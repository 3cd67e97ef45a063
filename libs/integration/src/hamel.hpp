#pragma once
#include <variant>

#include "channel_forces.hpp"
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// The published scheme: (9), (13), Algorithm 1 with the feedback (15)–(16); and hamel-midpoint, the same with the
/// twists (9) transported at θ^k + Δ/2 and α = ½. In impulse form, with h' the step before (0 right after a consistent
/// start, h after a published one), the equation at node k is
///   A_i · f_i = 0,  f_i = Adᵀ f_{i+1} + I ξ − I ξ' − (1−α) h adᵀ(ξ) I ξ − α h' adᵀ(ξ') I ξ' + ½(h + h') ∂U − ½h F −
///   ½h' F',
/// which is h times (13) for equal steps.
class Hamel final : public Integrator {
 public:
  Hamel(const Model& model, const HamelOptions& options);
  Hamel(const Model& model, const HamelMidpointOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return midpoint_ ? 2 : 1; }

 private:
  Hamel(const Model& model, const HamelOptions& options, bool midpoint);
  void node_velocity(const State& state, VectorRef v) const override;
  /// T(θ_mid, Δ/h) + ½U(θ^k) + ½U(θ^{k+1}) of the last step.
  [[nodiscard]] Energy node_energy(const State& state) const override;
  void begin(State& state, const ConstVectorRef& v0) override;
  void add_momentum(State& state, const ConstVectorRef& dp) override;
  void replace_velocity(State& state, const ConstVectorRef& v) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// τ_e of the node equation at delta_, times h.
  void evaluate(const State& state, const Channels& channels, double h, double h_before, double h_force);

  template <class Space>
  struct Link {
    typename Space::Placement x{};   ///< at θ^k
    typename Space::Motion twist{};  ///< ξ^{k+α}
    typename Space::Force before{};  ///< −(I ξ' + α h' adᵀ(ξ') I ξ')
    typename Space::Force force{};
  };
  template <class Space>
  using Links = std::vector<Link<Space>>;
  template <class F>
  decltype(auto) with_links(F&& f) const;
  /// Node momentum as the step before left it, A_i · Σ (I ξ' + α h' adᵀ(ξ') I ξ') − ½h' ∂U + ½h' F'.
  void momentum_before(const State& state, VectorXd& p) const;
  /// Reads ξ' from the state, h' given, and places the chain at θ^k.
  void load(const State& state, double h_before) const;

  const HamelOptions options_;
  const bool midpoint_;
  const double alpha_;
  mutable std::variant<Links<dynamics::kernel::Spatial<double>>, Links<dynamics::kernel::Planar<double>>> links_;
  ChannelForces forces_;
  mutable VectorXd delta_, correction_, mid_, rate_, residual_, gradient_;  // scratch
};

}  // namespace hamelin::integration
