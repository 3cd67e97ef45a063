#pragma once
#include "explicit.hpp"

namespace hamelin::integration {

/// A feedback integrator after Chang, Jiménez and Perlmutter (2016): the motion is embedded in a Euclidean space, the
/// vector field gets a term that makes what is invariant attractive, and a standard explicit scheme (RK4) does the
/// rest. For a chain: revolute joints as (c, s) in the plane with c² + s² = 1, and the energy E* that the start and the
/// work booked since allow:
///   ċ = −s v − κ (c² + s² − 1) c,   ṡ = c v − κ (c² + s² − 1) s,   v̇ = a − κ v (E − E*)/(2K + |E − E*|).
class Feedback final : public Explicit {
 public:
  Feedback(const Model& model, const FeedbackOptions& options);
  [[nodiscard]] int order() const override { return 4; }

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// embedded_ from State::memory, or where the velocity jumped from q and v: the pairs (c, s) on the circle and E* =
  /// E.
  void embed(const State& state);

  std::vector<bool> turns_;  ///< which joints are revolute
  VectorXd embedded_, q_, v_, c_, s_, dc_, ds_, dv_, c_sum_, s_sum_, v_sum_;
};

}  // namespace hamelin::integration
