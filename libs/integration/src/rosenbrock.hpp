#pragma once
#include "explicit.hpp"
#include "odeint_rosenbrock.hpp"

namespace hamelin::integration {

/// A stiff reference: the fourth-order Rosenbrock method of Boost.odeint (rosenbrock4). Always under step control, rtol
/// = atol = 1e-10 unless told else. It is there to judge others by: odeint allocates in a step, and the Jacobian is
/// dense, by central differences of forward dynamics.
class Rosenbrock final : public Explicit {
 public:
  Rosenbrock(const Model& model, const Options& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 4; }

 private:
  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled(State& state, const Channels& channels, double limit) override;
  void derivative(const double* y, double* dy);
  void jacobian(const double* y, double* by_rows);

  Eigen::Index size_;  ///< of y = (q, v, gyroscopic work, dissipated, held work): the works come along with the motion
  OdeintRosenbrock method_;
  const Channels* channels_ = nullptr;  ///< of the step under way
  StepReport* report_ = nullptr;
  VectorXd y_, next_, error_, point_, up_, down_, q_, v_;
};

}  // namespace hamelin::integration
