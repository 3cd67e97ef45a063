#pragma once
#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace hamelin::hybrid {

/// The acceleration that the nominal model does not know of (wrong masses, friction), from how the velocity differs
/// from what was predicted a tick ago; a first-order filter of `bandwidth`. Knows that a torque acts some ticks late.
class Observer {
 public:
  /// @param late how many control periods after it is asked for a torque acts
  Observer(Eigen::Index dof, double period_s, int late)
      : period_s_(period_s),
        gain_(1.0 - std::exp(-bandwidth * period_s)),
        issued_(static_cast<std::size_t>(late) + 1, Eigen::VectorXd::Zero(dof)),
        disturbance_(Eigen::VectorXd::Zero(dof)),
        predicted_(Eigen::VectorXd::Zero(dof)),
        scratch_(Eigen::VectorXd::Zero(dof)) {}

  /// What the model misses [rad/s² or m/s²].
  [[nodiscard]] const Eigen::VectorXd& disturbance() const noexcept { return disturbance_; }
  /// The torque asked for last.
  [[nodiscard]] const Eigen::VectorXd& last() const { return issued_[(next_ + issued_.size() - 1) % issued_.size()]; }
  /// Whether anything was asked for yet.
  [[nodiscard]] bool ready() const noexcept { return ready_; }
  /// Learns from the velocity at a tick.
  void update(const Eigen::VectorXd& v) {
    if (ready_) disturbance_ += gain_ / period_s_ * (v - predicted_);
  }
  /// The torque asked for at this tick, before the first one all that were: `bias`.
  /// @param M_inv, bias of the nominal model at this tick's state
  void issue(const Eigen::VectorXd& torque, const Eigen::VectorXd& v, const Eigen::MatrixXd& M_inv,
             const Eigen::VectorXd& bias) {
    if (!ready_)
      for (auto& old : issued_) old = bias;
    issued_[next_] = torque;
    next_ = (next_ + 1) % issued_.size();
    // the oldest is the one that acts now
    scratch_ = issued_[next_ % issued_.size()] - bias;
    predicted_.noalias() = M_inv * scratch_;
    predicted_ = v + period_s_ * (predicted_ + disturbance_);
    ready_ = true;
  }

 private:
  static constexpr double bandwidth = 100.0;  // [1/s]
  double period_s_, gain_;
  std::vector<Eigen::VectorXd> issued_;
  std::size_t next_ = 0;
  bool ready_ = false;
  Eigen::VectorXd disturbance_, predicted_, scratch_;
};

}  // namespace hamelin::hybrid
