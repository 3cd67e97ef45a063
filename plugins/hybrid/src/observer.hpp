#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

namespace hamelin::hybrid {

/// Estimates the acceleration that the nominal model does not explain (wrong masses, friction) from
/// the difference between the velocity and its prediction one tick ago, filtered with `bandwidth`:
/// docs/theory.md (10.23). It accounts for the delay of the torque.
class Observer {
 public:
  /// @param delay_periods the delay of the torque, in control periods
  Observer(Eigen::Index dof, double period_s, int delay_periods)
      : period_s_(period_s),
        gain_(1.0 - std::exp(-bandwidth * period_s)),
        issued_(static_cast<std::size_t>(delay_periods) + 1, Eigen::VectorXd::Zero(dof)),
        disturbance_(Eigen::VectorXd::Zero(dof)),
        predicted_(disturbance_),
        v_(disturbance_),
        bias_(disturbance_),
        scratch_(disturbance_),
        M_inv_(Eigen::MatrixXd::Identity(dof, dof)) {}

  /// Forgets everything, for a new start.
  void reset() {
    disturbance_.setZero();
    predicted_.setZero();
    next_ = 0;
    ready_ = false;
  }

  /// The estimate δ of the unexplained acceleration [rad/s² or m/s²].
  [[nodiscard]] const Eigen::VectorXd& disturbance() const noexcept { return disturbance_; }
  /// The torque issued last.
  [[nodiscard]] const Eigen::VectorXd& last() const {
    return issued_[(next_ + issued_.size() - 1) % issued_.size()];
  }
  /// Whether any torque was issued yet.
  [[nodiscard]] bool ready() const noexcept { return ready_; }
  /// Corrects the torque issued last, if something between planner and arm changed it.
  void correct(const Eigen::Ref<const Eigen::VectorXd>& sent) {
    if (ready_) issued_[(next_ + issued_.size() - 1) % issued_.size()] = sent;
  }
  /// Updates the estimate with the velocity at a tick.
  void update(const Eigen::VectorXd& v) {
    if (!ready_) return;
    // The oldest torque has acted since the last tick.
    scratch_ = issued_[next_ % issued_.size()] - bias_;
    predicted_.noalias() = M_inv_ * scratch_;
    predicted_ = v_ + period_s_ * (predicted_ + disturbance_);
    disturbance_ += gain_ / period_s_ * (v - predicted_);
  }
  /// Scales the estimate down to what explains at most these torques, so that it cannot wind up
  /// while something else, like a shield, holds the arm.
  void limit(const Eigen::MatrixXd& M, const Eigen::VectorXd& torque_max) {
    scratch_.noalias() = M * disturbance_;
    double scale = 1.0;
    for (Eigen::Index k = 0; k < scratch_.size(); ++k)
      if (std::abs(scratch_[k]) > torque_max[k])
        scale = std::min(scale, torque_max[k] / std::abs(scratch_[k]));
    disturbance_ *= scale;
  }
  /// Records the torque issued at this tick. The first call assumes that `bias` was issued before.
  /// @param M_inv, bias of the nominal model at this tick's state
  void issue(const Eigen::VectorXd& torque, const Eigen::VectorXd& v, const Eigen::MatrixXd& M_inv,
             const Eigen::VectorXd& bias) {
    if (!ready_)
      for (auto& previous : issued_) previous = bias;
    issued_[next_] = torque;
    next_ = (next_ + 1) % issued_.size();
    v_ = v;
    M_inv_ = M_inv;
    bias_ = bias;
    ready_ = true;
  }

 private:
  static constexpr double bandwidth = 100.0;  // [1/s]
  double period_s_, gain_;
  std::vector<Eigen::VectorXd> issued_;
  std::size_t next_ = 0;
  bool ready_ = false;
  Eigen::VectorXd disturbance_, predicted_, v_, bias_, scratch_;
  Eigen::MatrixXd M_inv_;
};

}  // namespace hamelin::hybrid
