#pragma once
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"
#include "wrench_forces.hpp"

namespace hamelin::integration {

/// The derivatives of the generalised force of the channels by position and velocity, row i the
/// force of joint i.
class ForceDerivatives {
 public:
  explicit ForceDerivatives(Eigen::Index dof);
  /// Wrenches count as held: the callers refuse a wrench law.
  /// @param ws scratch memory of the model
  void evaluate(const Model& model, const Channels& channels, dynamics::Workspace& ws,
                const ConstVectorRef& q, const ConstVectorRef& v);
  /// The same where a wrench law may act, which is differentiated by central differences.
  /// @param wrenches of the current step
  void evaluate(const Model& model, const Channels& channels, dynamics::Workspace& ws,
                const ConstVectorRef& q, const ConstVectorRef& v, WrenchForces& wrenches);

  Eigen::MatrixXd by_q, by_v;
  VectorXd force;
  /// The part of the wrenches; zero without them.
  Eigen::MatrixXd external_by_q, external_by_v;
  VectorXd external;

 private:
  void add_joint_forces(const Channels& channels, const ConstVectorRef& v);
  void add_held_wrenches(const Model& model, const Channels& channels, dynamics::Workspace& ws,
                         const ConstVectorRef& q);
  void add_wrench_law(const ConstVectorRef& q, const ConstVectorRef& v, WrenchForces& wrenches);
  void add_gyroscopic(const Model& model, const Channels& channels, dynamics::Workspace& ws,
                      const ConstVectorRef& q, const ConstVectorRef& v);
  void add(const Model& model, const dynamics::GyroscopicTerm& term, const dynamics::Workspace& ws,
           const ConstVectorRef& v);

  dynamics::Matrix6Xd J_;
  VectorXd torque_, q_, v_;
};

}  // namespace hamelin::integration
