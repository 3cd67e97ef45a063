#pragma once
#include "hamelin/scene/goal.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "hamelin/search/tip_curve.hpp"

namespace hamelin::search {

/// The whole way of a tip to a position or pose goal that has one; the rotation stays on the way to
/// a position. @throws Error invalid if there is no such arc
[[nodiscard]] TipCurve way_curve(const scene::Goal& goal, const geometry::SE3& start);
/// The stretch before a tip's pose at a goal, outwards from there, and somewhat more.
[[nodiscard]] TipCurve approach_curve(const scene::Stretch& approach, const geometry::SE3& goal);
/// The stretch behind a tip's pose at the start, and somewhat more.
[[nodiscard]] TipCurve retreat_curve(const scene::Stretch& retreat, const geometry::SE3& start);
/// Where the tip keeps to a stretch that begins or ends at a pose.
[[nodiscard]] TipConstraints::Ball ball_of(const scene::Stretch& stretch, const geometry::SE3& end);

}  // namespace hamelin::search
