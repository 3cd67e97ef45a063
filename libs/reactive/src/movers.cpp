#include "hamelin/reactive/movers.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace hamelin::reactive {

namespace {

scene::Shape shape_of(std::int32_t shape) {
  switch (shape) {
    case HAMELIN_OBSTACLE_BOX:
      return scene::Shape::box;
    case HAMELIN_OBSTACLE_CYLINDER:
      return scene::Shape::cylinder;
    case HAMELIN_OBSTACLE_CAPSULE:
      return scene::Shape::capsule;
    default:
      return scene::Shape::sphere;
  }
}

// Where only the speed is bounded, nothing would ever be clear of all places that the obstacle can
// reach in a second. It is then expected to keep its velocity, and may be nearer by what it can
// move in a reaction time.
constexpr double reaction_s = 0.1;

MoverPlace place_of(const hamelin_obstacle_state& state, double ahead_s) {
  const auto& q = state.quaternion_wxyz;
  MoverPlace place{{Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix(),
                    planning::vec3(state.position_world_m)},
                   state.nearer_m};
  if (state.prediction != HAMELIN_PREDICTION_SPEED_BOUND) return place;
  place.pose = {place.pose.R(),
                place.pose.p() + ahead_s * planning::vec3(state.velocity_world_m_s)};
  place.nearer = std::min(ahead_s, reaction_s) * state.speed_max_m_s;
  return place;
}

}  // namespace

void row_of(const MoverPoint& point, const model::Model& model, const dynamics::Workspace& ws,
            const scene::Shapes& arm, Eigen::VectorXd& row) {
  const double radius = arm.radii[static_cast<std::size_t>(point.shape)];
  dynamics::point_jacobian_transpose(
      model, ws, point.link, point.axis_point - radius * point.direction, point.direction, row);
}

Movers::Movers(const planning::Host& host, const model::Model& model)
    : host_(host), states_(max_count) {
  const auto& shapes = model.shapes();
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    if (links_.empty() || links_.back().link != shapes[i].link)
      links_.push_back({shapes[i].link, i, i});
    links_.back().last = i + 1;
  }
}

void Movers::update(std::size_t count) {
  count_ = 0;
  if (count == 0) return;
  count_ = std::min(host_.obstacles_ahead(0.0, HAMELIN_MOVING, states_), max_count);
  for (std::size_t m = 0; m < count_; ++m) {
    const hamelin_obstacle_state& state = states_[m];
    scene::Obstacle& solid = solids_[m];
    ids_[m] = state.id;
    solid.shape = shape_of(state.shape);
    solid.radius_m = state.radius_m;
    solid.length_m = state.length_m;
    solid.size_m = planning::vec3(state.size_m);
    balls_[m] = scene::bounding_radius(solid);
  }
}

bool Movers::contains(int obstacle) const noexcept {
  const auto end = ids_.begin() + static_cast<std::ptrdiff_t>(count_);
  return std::find(ids_.begin(), end, obstacle) != end;
}

void Movers::predict(double ahead_s, Places& places) {
  const std::size_t listed =
      std::min(host_.obstacles_ahead(ahead_s, HAMELIN_MOVING, states_), count_);
  for (std::size_t m = 0; m < listed; ++m) places[m] = place_of(states_[m], ahead_s);
}

bool Movers::nearest(const scene::Shapes& arm, const Span& link, std::size_t mover,
                     const MoverPlace& place, double radius, MoverPoint& point) const {
  const scene::Obstacle& solid = solids_[mover];
  double least = radius;
  bool found = false;
  for (std::size_t i = link.first; i < link.last; ++i) {
    const bool capsule = arm.is_capsule(i);
    const double within = least + arm.radii[i] + place.nearer;
    const double ball = within + balls_[mover] + (capsule ? arm.half_axes[i].norm() : 0.0);
    if (ball <= 0.0 || (arm.centers[i] - place.pose.p()).squaredNorm() > ball * ball) continue;
    scene::AxisPoint hit;
    if (capsule)
      hit = scene::closest_on(solid, place.pose, arm.from(i), arm.to(i));
    else
      hit = {scene::closest_on(solid, place.pose, arm.centers[i]), arm.centers[i]};
    if (hit.distance > within) continue;
    least = hit.distance - arm.radii[i] - place.nearer;
    found = true;
    point = {link.link,      static_cast<int>(i), static_cast<int>(mover), ids_[mover], least,
             hit.axis_point, hit.direction};
  }
  return found;
}

bool Movers::has_passed(const MoverPoint& point, const MoverPlace& now) const {
  const scene::Obstacle& solid = solids_[static_cast<std::size_t>(point.mover)];
  return point.direction.dot(scene::closest_on(solid, now.pose, point.axis_point).direction) < 0.0;
}

double Movers::clearance(const scene::Shapes& arm, const Places& places, double limit) const {
  MoverPoint point;
  for (std::size_t m = 0; m < count_; ++m)
    for (const Span& link : links_)
      if (nearest(arm, link, m, places[m], limit, point)) limit = point.distance;
  return limit;
}

}  // namespace hamelin::reactive
