#include "hamelin/control/drive.hpp"

#include <utility>

#include "position_drive.hpp"
#include "torque_drive.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

/// Sends nothing: the arm is what it was measured to be.
class NoDrive final : public Drive {
 public:
  explicit NoDrive(Eigen::Index dof) {
    q_ = v_ = setpoint_.torque = setpoint_.q = setpoint_.v = VectorXd::Zero(dof);
  }
  bool acts() const noexcept override { return false; }
  void measure(const VectorXd& q, const VectorXd& v, bool seen) override {
    if (!seen) return;
    q_ = q;
    v_ = v;
  }
  void start() override {
    setpoint_.q = q_;
    setpoint_.v = v_;
  }
  void forget() noexcept override {}
  void continue_from(const Drive& other) override {
    q_ = other.q();
    v_ = other.v();
    start();
  }
  bool propose(const planning::CommandBuffers&) override { return true; }
  Shield::Step step() override {
    return {node(), v_, node(), setpoint_.torque, setpoint_.torque, setpoint_.torque};
  }
  void begin(Stop&) override {}
  void follow(Stop&) override {}
  const Setpoint& send() override { return setpoint_; }

 private:
  Setpoint setpoint_;
};

}  // namespace

ChangeBounds DriveOptions::changes(const scene::Scene& scene) const {
  if (kind == DriveKind::position) return {0.0, acceleration_max, jerk_max};
  if (kind == DriveKind::none) return {};
  return {scene.actuation.torque_rate_max_Nm_s.value_or(0.0), {}, {}};
}

std::unique_ptr<Drive> make_drive(const scene::Scene& scene, const model::Model& model,
                                  const DriveOptions& options, const LimitReserve& reserve) {
  switch (options.kind) {
    case DriveKind::torque:
      return std::make_unique<TorqueDrive>(scene, model, options);
    case DriveKind::position:
      return std::make_unique<PositionDrive>(scene, model, options, reserve);
    case DriveKind::none:
      break;
  }
  return std::make_unique<NoDrive>(model.dof());
}

bool can_be_sent(const VectorXd& x) {
  constexpr double largest = 1e12;
  return (x.array().abs() <= largest).all();
}

}  // namespace hamelin::control
