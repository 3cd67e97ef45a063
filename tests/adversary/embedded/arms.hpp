#pragma once
#include <Eigen/Core>
#include <deque>
#include <memory>

#include "hamelin/control/controller.hpp"
#include "hamelin/integration/integrator.hpp"

namespace hamelin::test {

/// The arm that an embedded controller moves. It does exactly what it is sent: the controller's
/// model has no error, so that nothing excuses a contact.
class Arm {
 public:
  Arm() = default;
  Arm(const Arm&) = delete;
  Arm& operator=(const Arm&) = delete;
  virtual ~Arm() = default;

  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  /// Moves for one period by what a tick answered.
  virtual void step(const control::Answer& answer) = 0;
  /// Goes on with another load.
  virtual void carry(const model::Model&) {}
  /// Somebody moves it by hand; it rests there.
  virtual void put(const Eigen::VectorXd& q) = 0;

 protected:
  Eigen::VectorXd q_, v_;
};

/// Held torques that act after a delay, and hamelin's own integrator.
class TorqueArm : public Arm {
 public:
  TorqueArm(model::Model model, const Eigen::VectorXd& q, double period_s,
            std::size_t delay_periods);
  void step(const control::Answer& answer) override;
  void carry(const model::Model& model) override;
  void put(const Eigen::VectorXd& q) override;

 private:
  void start();

  std::unique_ptr<model::Model> model_;
  std::unique_ptr<integration::Integrator> integrator_;
  integration::State state_;
  integration::Channels channels_;
  std::deque<Eigen::VectorXd> waiting_;
  double period_s_;
};

/// Servos that reach each set point at the end of its period, or with a lag of the first order.
class ServoArm : public Arm {
 public:
  ServoArm(const Eigen::VectorXd& q, double period_s, double lag_s);
  void step(const control::Answer& answer) override;
  void put(const Eigen::VectorXd& q) override;

 private:
  double period_s_, share_;
};

}  // namespace hamelin::test
