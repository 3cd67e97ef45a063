#pragma once
#include <Eigen/Core>

#include "hamelin/search/margins.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::search {

/// Configurations and straight motions that keep the margins of a search.
class Edges {
 public:
  Edges(Query& query, Margins margins) : query_(query), margins_(std::move(margins)) {}

  [[nodiscard]] bool clear(const Eigen::VectorXd& q) {
    return query_.posture_clear(q, margins_.required(q));
  }
  /// Whether the motion from a to b is proved to keep the margins. Near tight places, where they
  /// vary, it is divided into pieces with a margin each.
  [[nodiscard]] bool clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b);
  [[nodiscard]] long checks() const { return query_.checks(); }

 private:
  Query& query_;
  Margins margins_;
};

}  // namespace hamelin::search
