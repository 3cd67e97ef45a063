#pragma once
#include <variant>

#include "channels/channel_forces.hpp"
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// The scheme of Shen, Wang, Shi (2021), docs/theory.md (3.2), (3.6), (3.7), solved by the feedback
/// (3.9); and hamel-midpoint, with α = ½ and the twists transported at θ^k + Δ/2. Computed in
/// impulse form, docs/theory.md (3.10), (3.11), with ξ', h', F' those of the step before:
///   f_i = Adᵀ f_{i+1} + I ξ − (1 − α) h adᵀ(ξ) I ξ − I ξ' − α h' adᵀ(ξ') I ξ',
///   R_i = A_i·f_i + ½ (h + h') ∂_iU − ½ h F_i − ½ h' F'_i − (node impulses) = 0.
class Hamel final : public Integrator {
 public:
  Hamel(const Model& model, const HamelOptions& options);
  Hamel(const Model& model, const HamelMidpointOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return midpoint_ ? 2 : 1; }
  [[nodiscard]] Isa isa() const override { return Isa::baseline; }

 private:
  Hamel(const Model& model, const HamelOptions& options, bool midpoint);
  void node_velocity(const State& state, VectorRef v) const override;
  /// docs/theory.md (3.13), of the last step.
  using Integrator::node_energy;
  [[nodiscard]] Energy node_energy(const State& state, const ConstVectorRef& v) const override;
  void begin(State& state, const ConstVectorRef& v0) override;
  void add_momentum(State& state, const ConstVectorRef& dp) override;
  void replace_velocity(State& state, const ConstVectorRef& v) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// residual_ = R at delta_, docs/theory.md (3.11).
  void evaluate(const State& state, const Channels& channels, double h, double h_before,
                double h_force);

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
  /// Momentum at the node, docs/theory.md (3.12).
  void momentum_before(const State& state, VectorXd& p) const;
  /// Reads ξ' from the state, computes the terms of the step before for h' = h_before, and places
  /// the chain at θ^k.
  void load(const State& state, double h_before) const;

  const HamelOptions options_;
  const bool midpoint_;
  const double alpha_;
  mutable std::variant<Links<dynamics::kernel::Spatial<double>>,
                       Links<dynamics::kernel::Planar<double>>>
      links_;
  ChannelForces forces_;
  mutable VectorXd delta_, correction_, mid_, rate_, residual_, gradient_;  // scratch
};

}  // namespace hamelin::integration
