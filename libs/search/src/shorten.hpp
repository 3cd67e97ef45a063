#pragma once
#include <Eigen/Core>

#include "edges.hpp"
#include "hamelin/core/rng.hpp"

namespace hamelin::search {

/// Shortens a path by straight lines between its way-points, then between random places of it,
/// each of which is proved clear.
[[nodiscard]] Eigen::MatrixXd shorten(const Eigen::MatrixXd& points, Edges& edges, Rng& rng);

}  // namespace hamelin::search
