#pragma once
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// The derivatives of the generalised force of the channels by position and velocity, row i the
/// force of joint i. Wrenches count as held: the callers refuse a wrench law.
class ForceDerivatives {
 public:
  explicit ForceDerivatives(Eigen::Index dof);
  /// @param ws scratch memory of the model
  void evaluate(const Model& model, const Channels& channels, dynamics::Workspace& ws,
                const ConstVectorRef& q, const ConstVectorRef& v);

  Eigen::MatrixXd by_q, by_v;
  VectorXd force;

 private:
  void add(const Model& model, const dynamics::GyroscopicTerm& term, const dynamics::Workspace& ws,
           const ConstVectorRef& v);

  dynamics::Matrix6Xd J_;
  Eigen::MatrixXd slope_;
  VectorXd torque_;
};

}  // namespace hamelin::integration
