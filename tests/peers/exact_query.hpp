#pragma once
#include <algorithm>
#include <optional>

#include "hamelin/search/edge_check.hpp"
#include "hamelin/search/query.hpp"

namespace hamelin::peers {

/// Another query with motions that are proved by exact distances alone, without lanes.
class ExactQuery final : public search::Query {
 public:
  /// @param other stays @param environment of the other one
  ExactQuery(search::Query& other, const model::Model& model, const scene::SelfField* self,
             const scene::Environment& environment)
      : other_(other), edges_(model, self) {
    edges_.set_environment(environment, 0.0);
  }

  double clearance(const Eigen::VectorXd& q, double at_least_m) override {
    return other_.clearance(q, at_least_m);
  }
  double self_clearance(const Eigen::VectorXd& q, double most_m) override {
    return other_.self_clearance(q, most_m);
  }
  void set_margins(const search::Margins& margins) override {
    margins_ = margins;
    edges_.set_self_most(margins.self_most_m());
  }
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b) override {
    a_ = a;
    b_ = b;
  }
  std::optional<bool> prove(long) override { return is_clear(a_, b_); }
  [[nodiscard]] long checks() const override { return other_.checks() + edges_.checks(); }

 private:
  // Pieces keep the least margin of their configurations where it varies little.
  bool is_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    constexpr double constant_m = 5e-4, shortest = 0.1;
    const double least = margins_.least(a, b),
                 most = std::max(margins_.required(a), margins_.required(b));
    if (most - least < constant_m || (b - a).norm() < shortest)
      return edges_.motion_clear(a, b, least);
    const Eigen::VectorXd middle = 0.5 * (a + b);
    return is_clear(middle, b) && is_clear(a, middle);
  }

  search::Query& other_;
  search::EdgeCheck edges_;
  search::Margins margins_{0.0};
  Eigen::VectorXd a_, b_;
};

}  // namespace hamelin::peers
