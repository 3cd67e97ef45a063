#include "line_world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "single_bounds.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

kernel::Primitive primitive_of(const scene::Obstacle& obstacle, const geometry::SE3& pose,
                               double nearer_m, double extent_m, double position_rounding_m) {
  kernel::Primitive out{};
  Vector3d half = Vector3d::Zero();
  double radius = 0.0;
  switch (obstacle.shape) {
    case scene::Shape::box:
      half = 0.5 * obstacle.size_m;
      break;
    case scene::Shape::cylinder:
      half = {obstacle.radius_m, 0.0, 0.5 * obstacle.length_m};
      out.cylinder = true;
      break;
    case scene::Shape::capsule:
      half.z() = 0.5 * obstacle.length_m;
      radius = obstacle.radius_m;
      break;
    default:
      radius = obstacle.radius_m;
  }
  radius += nearer_m;
  for (Index i = 0; i < 3; ++i) {
    out.center[i] = static_cast<float>(pose.p()[i]);
    out.half[i] = static_cast<float>(half[i]);
    for (Index k = 0; k < 3; ++k) out.axes[k][i] = static_cast<float>(pose.R()(i, k));
  }
  out.radius = static_cast<float>(radius);
  out.ball = inflated(half.norm() + radius);
  // docs/theory.md (17.16)
  constexpr double roundings = 32.0;
  out.slack =
      inflated(position_rounding_m + roundings * LineArm::unit_roundoff *
                                         (extent_m + pose.p().norm() + half.norm() + radius));
  return out;
}

}  // namespace

LineWorld::LineWorld(const model::Model& model, LineArm& arm)
    : model_(model), arm_(arm), hints_(model.shapes().size(), {-1, -1}) {
  primitives_.reserve(kernel::primitives_max);
}

bool LineWorld::set(const scene::Environment& environment, double time_s, bool movers) {
  environment_ = &environment;
  field_ = environment.distance_field();
  std::fill(hints_.begin(), hints_.end(), Hint{-1, -1});
  return arm_.fits() && field_ != nullptr && place_frame() && add_primitives(time_s, movers);
}

bool LineWorld::place_frame() {
  const scene::DistanceField::View view = field_->view();
  const geometry::SE3& map = environment_->map_pose();
  const bool gridded = view.resolution_m > 0.0;
  Vector3d origin = map.inverse() * model_.base().p();
  std::array<double, 3> corner{};
  if (gridded)
    for (std::size_t i = 0; i < 3; ++i) {
      corner[i] = std::round(origin[static_cast<Index>(i)] / view.resolution_m);
      origin[static_cast<Index>(i)] = corner[i] * view.resolution_m;
    }
  origin_ = origin;
  frame_ = geometry::SE3{map.R(), map * origin};
  arm_.place(frame_);
  kernel::Field& field = world_.field;
  field = {};
  const double u = LineArm::unit_roundoff, extent = arm_.extent_m();
  world_.pair_slack = inflated(2.0 * arm_.position_rounding_m() + 24.0 * u * extent);
  world_.map_slack = 0.0F;
  if (!gridded || field_->empty()) return true;
  field.values = view.values;
  double most = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    field.count[i] = view.count[i];
    const double offset = corner[i] - view.lo[i];
    field.offset[i] = static_cast<float>(offset);
    most = std::max({most, static_cast<double>(view.count[i]), std::abs(offset)});
  }
  const double h = view.resolution_m;
  field.inverse = static_cast<float>(1.0 / h);
  field.resolution = static_cast<float>(h);
  field.unit = static_cast<float>(view.unit_m);
  // docs/theory.md (17.15)
  const double cell = std::numbers::sqrt3 * u * (3.0 * extent + 2.0 * h * most);
  world_.map_slack =
      inflated(arm_.position_rounding_m() + cell + 1000.0 * u * h + 8.0 * u * (extent + 25.0 * h));
  constexpr double exact_float = 1 << 24;
  return most < exact_float;
}

bool LineWorld::add_primitives(double time_s, bool movers) {
  primitives_.clear();
  const geometry::SE3 inverse = frame_.inverse();
  for (std::size_t k = 0; k < environment_->obstacles().size(); ++k) {
    const scene::Obstacle& obstacle = environment_->obstacles()[k];
    if (!scene::exists(obstacle, time_s) || obstacle.shape == scene::Shape::frame ||
        (!movers && environment_->moves(k)))
      continue;
    if (primitives_.size() == kernel::primitives_max) return false;
    const scene::Placed placed = scene::placed_at(obstacle, time_s);
    primitives_.push_back(primitive_of(obstacle, inverse * placed.pose, placed.nearer_m,
                                       arm_.extent_m(), arm_.position_rounding_m()));
  }
  world_.primitives = primitives_.data();
  world_.primitive_count = static_cast<int>(primitives_.size());
  return true;
}

double LineWorld::distance(int sphere, const float* p, double limit) {
  const Vector3d point = origin_ + Vector3d(p[0], p[1], p[2]);
  Hint& hint = hints_[static_cast<std::size_t>(arm_.shape_of(static_cast<std::size_t>(sphere)))];
  double distance = environment_->map_field().distance(point, point, limit, hint.map);
  if (environment_->summary().unknown == scene::UnknownPolicy::block)
    distance = environment_->unknown_field().distance(point, point, distance, hint.unknown);
  return distance;
}

}  // namespace hamelin::search
