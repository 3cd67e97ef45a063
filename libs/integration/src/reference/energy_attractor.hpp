#pragma once
#include "explicit.hpp"

namespace hamelin::integration {

/// A feedback integrator after Chang, Jiménez, Perlmutter (2016): the motion is embedded in a
/// Euclidean space, the vector field gets a term that makes its invariants attractive, and rk4
/// integrates it. Revolute joints are pairs (c, s) with c² + s² = 1, and the energy follows E*, the
/// energy at the start plus the work booked since, docs/theory.md (7.8)–(7.10):
///   ċ = −s v − κ (c² + s² − 1) c,   ṡ = c v − κ (c² + s² − 1) s,
///   v̇ = a − κ v (E − E*)/(2K + |E − E*|).
class EnergyAttractor final : public Explicit {
 public:
  EnergyAttractor(const Model& model, const EnergyAttractorOptions& options);
  [[nodiscard]] int order() const override { return 4; }

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// embedded_ from State::memory; if the velocity was changed, from q and v with E* = E.
  void embed(const State& state);

  std::vector<bool> revolute_;  ///< which joints are revolute
  VectorXd embedded_, q_, v_, c_, s_, dc_, ds_, dv_, c_sum_, s_sum_, v_sum_;
};

}  // namespace hamelin::integration
