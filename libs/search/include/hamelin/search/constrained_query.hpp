#pragma once
#include "hamelin/search/query.hpp"
#include "hamelin/search/tip_constraints.hpp"

namespace hamelin::search {

/// A query whose motions also keep what the tip has to keep.
class ConstrainedQuery final : public Query {
 public:
  /// Both must outlive this.
  ConstrainedQuery(Query& query, TipConstraints& constraints)
      : query_(query), constraints_(constraints) {}

  [[nodiscard]] double clearance(const Eigen::VectorXd& q, double at_least_m) override {
    return query_.clearance(q, at_least_m);
  }
  [[nodiscard]] double self_clearance(const Eigen::VectorXd& q, double most_m) override {
    return query_.self_clearance(q, most_m);
  }
  void set_margins(const Margins& margins) override {
    query_.set_margins(margins);
    stray_ = margins.stray();
  }
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b) override {
    if (stray_.size() == 0) stray_.setZero(a.size());
    keeps_ = constraints_.motion_keeps(a, b, stray_);
    if (keeps_) query_.begin_motion(a, b);
  }
  [[nodiscard]] std::optional<bool> prove(long checks) override {
    return keeps_ ? query_.prove(checks) : false;
  }
  [[nodiscard]] long checks() const override { return query_.checks() + constraints_.checks(); }
  [[nodiscard]] TipConstraints* constraints() noexcept override { return &constraints_; }

 private:
  Query& query_;
  TipConstraints& constraints_;
  Eigen::VectorXd stray_;
  bool keeps_ = false;
};

}  // namespace hamelin::search
