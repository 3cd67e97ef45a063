#pragma once
#include <variant>

#include "channels/channel_forces.hpp"
#include "lie_exact_sweeps.hpp"
#include "momentum.hpp"

namespace hamelin::integration {

/// lie-exact, after Lee, Liu, Park, Srinivasa, A Linear-Time Variational Integrator for Multibody
/// Systems (2016): the discrete Lagrangian takes each link's body twist from the logarithm of its
/// displacement in the step, and half of the potential at each node, docs/theory.md (6.1), (6.2).
/// Solved for Δ by an exact Newton step in O(n), or by their RIQN, docs/theory.md (6.18).
class LieExact final : public Momentum {
 public:
  LieExact(const Model& model, const LieExactOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 2; }
  [[nodiscard]] Isa isa() const override { return Isa::baseline; }
  [[nodiscard]] std::string mode() const override {
    return options_.tolerance <= 1e-12 ? "structure" : "accurate";
  }

 private:
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// residual_ at delta_, docs/theory.md (6.8). False if it is not defined or not finite.
  bool evaluate(const State& state, const Channels& channels, double h);
  /// False if a pivot is lost.
  bool factor(const State& state, const Channels& channels, double h);
  /// correction_ from residual_: by the kept factors, or by M(θ^k)⁻¹.
  void correct(const State& state, double h);
  bool solve(const State& state, const Channels& channels, double h, StepReport& report);
  template <class F>
  decltype(auto) with_links(F&& f);

  using Solver = LieExactOptions::Solver;

  const LieExactOptions options_;
  std::variant<kernel::LieScratch<dynamics::kernel::Spatial<double>>,
               kernel::LieScratch<dynamics::kernel::Planar<double>>>
      links_;
  ChannelForces forces_;
  VectorXd delta_, correction_, mid_, rate_, minus_, plus_, residual_, gradient_, q_next_;
};

}  // namespace hamelin::integration
