#include "hamelin/scene/environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::scene {

namespace {

// Points of a capsule's axis are distinct if they are farther apart than this share of its length.
constexpr double distinct_share = 1.0 / 3.0;

// docs/theory.md (11.8). `at`: a sphere's centre or a capsule's nearest axis point; `distance` is
// measured from there.
Contact contact_of(const Shapes& arm, std::size_t shape, int obstacle, const Eigen::Vector3d& at,
                   double distance, const Eigen::Vector3d& point, const Eigen::Vector3d& direction,
                   const Eigen::Vector3d& velocity) {
  return {static_cast<int>(shape),
          obstacle,
          distance - arm.radii[shape],
          at - arm.radii[shape] * direction,
          point,
          direction,
          velocity};
}

// Writes the nearest contacts, as many as fit into `out`, in the order of shapes and distances.
void write_nearest(const std::vector<Contact>& found, std::vector<std::size_t>& order,
                   std::span<Contact> out) {
  const auto nearer = [](const Contact& a, const Contact& b) { return a.distance < b.distance; };
  const auto before = [&](const Contact& a, const Contact& b) {
    return a.sphere != b.sphere ? a.sphere < b.sphere : nearer(a, b);
  };
  const bool all = out.size() >= found.size();
  if (all && std::is_sorted(found.begin(), found.end(), before)) {
    std::copy(found.begin(), found.end(), out.begin());
    return;
  }
  // equal ones in the order in which they were found
  const auto indexed = [&](const auto& less) {
    return [&found, less](std::size_t a, std::size_t b) {
      return less(found[a], found[b]) || (!less(found[b], found[a]) && a < b);
    };
  };
  order.resize(found.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (!all) {
    std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(out.size()),
                     order.end(), indexed(nearer));
    order.resize(out.size());
  }
  std::sort(order.begin(), order.end(), indexed(before));
  for (std::size_t i = 0; i < order.size(); ++i) out[i] = found[order[i]];
}

}  // namespace

Environment::Environment(const std::optional<MapSpec>& map, std::vector<Obstacle> obstacles,
                         const geometry::SE3& base, double reach, double influence,
                         const RobotAtStart& robot) {
  take(std::move(obstacles));
  if (!map) return;
  const MapRegion region = read_region(*map, base, reach, influence, robot);
  static_cast<MapSummary&>(summary_) = region.summary;
  map_pose_ = map->pose;
  map_pose_inverse_ = map->pose.inverse();
  map_ = std::make_shared<MapField>(region.occupied, region.resolution_m, region.reachable.center);
  unknown_ =
      std::make_shared<MapField>(region.unknown, region.resolution_m, region.reachable.center);
  summary_.boxes = map_->boxes().boxes().size();
  summary_.unknown_boxes = unknown_->boxes().boxes().size();
  map_spec_ = map;
  map_spec_->changes.clear();
  map_ball_ = region.ball;
  read_changes(map->changes);
}

void Environment::take(std::vector<Obstacle> obstacles) {
  attach(obstacles, "obstacles");
  moves_.clear();
  for (const Obstacle& obstacle : obstacles) {
    check(obstacle, fmt::format("obstacle '{}'", obstacle.name));
    moves_.push_back(scene::moves(obstacle) ? 1 : 0);
  }
  obstacles_ = std::move(obstacles);
  summary_.obstacles = obstacles_.size();
}

void Environment::read_changes(std::span<const MapChangeSpec> changes) {
  for (const MapChangeSpec& change : changes)
    changes_.push_back(read_change(change, *map_spec_, summary_.resolution_m, map_ball_));
}

Environment Environment::with_obstacles(std::vector<Obstacle> obstacles,
                                        std::span<const MapChangeSpec> changes) const {
  Environment copy = *this;
  copy.take(std::move(obstacles));
  copy.read_changes(changes);
  return copy;
}

Environment Environment::with_obstacle(std::size_t index, Obstacle obstacle) const {
  std::vector<Obstacle> obstacles = obstacles_;
  obstacles[index] = std::move(obstacle);
  return with_obstacles(std::move(obstacles));
}

void Environment::require_map() const {
  if (!map_spec_) throw Error(ErrorCode::invalid, "map: there is none, expected a map to change");
}

Environment Environment::with_change(const MapChangeSpec& change) const {
  require_map();
  return with_change(read_change(change, *map_spec_, summary_.resolution_m, map_ball_));
}

Environment Environment::with_change(const MapChange& change) const {
  require_map();
  Environment copy = *this;
  (void)copy.apply(change);
  return copy;
}

Environment Environment::with_allowance(const Allowance& allowance) const {
  Environment copy = *this;
  if (map_spec_ && !allowance.boxes_m.empty()) {
    MapChangeSpec change;
    change.free_m = allowance.boxes_m;
    copy = with_change(change);
  }
  for (std::size_t k = 0; k < obstacles_.size(); ++k) {
    if (!allowance.names(obstacles_[k].name)) continue;
    copy.obstacles_[k].appears_s = std::numeric_limits<double>::infinity();
    copy.moves_[k] = 0;
  }
  return copy;
}

void Environment::prepare() const {
  map_->prepare();
  if (summary_.unknown == UnknownPolicy::block) unknown_->prepare();
}

MapField::Changed Environment::apply(const MapChange& change) {
  const auto own = [](std::shared_ptr<MapField>& field) -> MapField& {
    if (field.use_count() > 1) field = std::make_shared<MapField>(*field);
    return *field;
  };
  update_field(change);
  const MapField::Changed changed = own(map_).change(change.occupied, change.free);
  if (summary_.unknown != UnknownPolicy::free) {
    own(unknown_).change({}, change.free);
    own(unknown_).change({}, change.occupied);
  }
  return changed;
}

std::shared_ptr<const DistanceField> Environment::distance_field() const {
  std::call_once(field_->once, [this] {
    std::vector<VoxelBox> voxels;
    const auto add = [&](const BoxField& boxes) {
      boxes.for_each_alive(
          [&](const Box& box) { voxels.push_back(to_voxels(box, summary_.resolution_m)); });
    };
    add(map_->boxes());
    if (summary_.unknown == UnknownPolicy::block) add(unknown_->boxes());
    if (auto field = DistanceField::make(voxels, summary_.resolution_m))
      field_->field = std::make_shared<DistanceField>(std::move(*field));
    field_->made = true;
  });
  return field_->field;
}

void Environment::update_field(const MapChange& change) {
  const std::shared_ptr<LazyField> before = std::exchange(field_, std::make_shared<LazyField>());
  // Where voxels change everywhere, to update it takes as long as to make it, if it is needed.
  constexpr std::size_t few = 64;
  if (!before->made || !before->field || change.free.size() + change.occupied.size() > few) return;
  // Another environment, or whoever asked for the field, may still use it.
  const bool own = before.use_count() == 1 && before->field.use_count() == 1;
  auto field = own ? before->field : std::make_shared<DistanceField>(*before->field);
  std::call_once(field_->once, [&] {
    if (field->change(change.free, change.occupied)) field_->field = std::move(field);
    field_->made = true;
  });
}

std::string Environment::advance(double time_s) {
  std::string message;
  for (; next_change_ < changes_.size() && changes_[next_change_].time_s <= time_s + 1e-9;
       ++next_change_) {
    const MapField::Changed changed = apply(changes_[next_change_]);
    message += fmt::format("{}the map changes: {} voxels are occupied now, {} free",
                           message.empty() ? "" : "; ", changed.added, changed.removed);
  }
  return message;
}

Environment::Scratch::Scratch(const Environment& environment, std::size_t shapes)
    : map_(*environment.map_), unknown_(*environment.unknown_) {
  found_.reserve(environment.contacts_max(shapes));
  order_.reserve(environment.contacts_max(shapes));
}

std::string Environment::describe(int obstacle) const {
  if (obstacle == Contact::map) return "the map";
  if (obstacle == Contact::unknown) return "unknown space";
  return fmt::format("obstacle '{}'", obstacles_[static_cast<std::size_t>(obstacle)].name);
}

std::string Environment::describe(const Contact& contact, const model::Model& model) const {
  return fmt::format("{} is {:.2g} mm inside {}",
                     model.describe(model.shapes()[static_cast<std::size_t>(contact.sphere)]),
                     -1e3 * contact.distance, describe(contact.obstacle));
}

std::string describe_exit_direction(const Contact& contact) {
  constexpr double digits = 100.0;
  const auto rounded = [](double x) { return std::round(digits * x) / digits + 0.0; };  // no "-0"
  const Eigen::Vector3d& n = contact.direction;
  return fmt::format("({}, {}, {})", rounded(n.x()), rounded(n.y()), rounded(n.z()));
}

bool Environment::has_obstacles() const noexcept {
  return !map_->empty() || !changes_.empty() || !obstacles_.empty() ||
         (!unknown_->empty() && summary_.unknown == UnknownPolicy::block);
}

double Environment::clearance_to(const Obstacle& obstacle, const Shapes& arm, const Placed& at,
                                 double limit) {
  if (obstacle.shape == Shape::frame) return limit;
  const double ball = bounding_radius(obstacle) + at.nearer_m;
  double smallest = limit;
  for (std::size_t i = 0; i < arm.size(); ++i) {
    const bool capsule = arm.is_capsule(i);
    const double near = smallest + arm.radii[i] + ball + (capsule ? arm.half_axes[i].norm() : 0.0);
    if (near <= 0.0 || (arm.centers[i] - at.pose.p()).squaredNorm() >= near * near) continue;
    const double distance = capsule ? closest_on(obstacle, at.pose, arm.from(i), arm.to(i)).distance
                                    : closest_on(obstacle, at.pose, arm.centers[i]).distance;
    smallest = std::min(smallest, distance - at.nearer_m - arm.radii[i]);
  }
  return smallest;
}

bool Environment::in_view(std::size_t obstacle, double time_s, View view,
                          std::span<const std::uint8_t> seen, Among among) const {
  const Obstacle& o = obstacles_[obstacle];
  if (!exists(o, time_s) || o.shape == Shape::frame) return false;
  if (among != Among::all && moves(obstacle) != (among == Among::moving)) return false;
  const bool known = !o.judge_only && (o.known || (obstacle < seen.size() && seen[obstacle] != 0));
  return view == View::judge || known == (view == View::planner);
}

int Environment::reveal_visible(const Shapes& arm, double time_s,
                                std::span<std::uint8_t> seen) const {
  for (std::size_t k = 0; k < obstacles_.size(); ++k) {
    const Obstacle& o = obstacles_[k];
    if (o.known || o.judge_only || !o.visible_within_m || seen[k] != 0 || !exists(o, time_s))
      continue;
    // any limit above visible_within_m is enough
    const double limit = 2.0 * *o.visible_within_m + 1.0;
    if (!visible(o, time_s, clearance_to(k, arm, time_s, limit))) continue;
    seen[k] = 1;
    return static_cast<int>(k);
  }
  return -1;
}

// Shapes that move together would gather their boxes in the same call; different skins distribute
// that work over many calls.
Environment::Vicinity::Vicinity(std::size_t shapes) {
  constexpr double least_m = 0.007, range_m = 0.006, golden = 0.6180339887498949;
  double share = 0.0;
  for (std::size_t i = 0; i < shapes; ++i) {
    for (auto* field : {&map_, &unknown_}) field->emplace_back(least_m + range_m * share);
    share += golden;
    share -= std::floor(share);
  }
}

std::size_t Environment::closest(const Shapes& arm, double influence, const Moment& moment,
                                 Scratch& scratch, std::span<Contact> out, View view,
                                 std::span<const std::uint8_t> seen, Vicinity* vicinity,
                                 Among among) const {
  scratch.found_.clear();
  if (view != View::hidden && among != Among::moving) {
    add_map_contacts(*map_, Contact::map, arm, influence, scratch.map_,
                     vicinity != nullptr ? &vicinity->map_ : nullptr, scratch.found_);
    if (summary_.unknown == UnknownPolicy::block)
      add_map_contacts(*unknown_, Contact::unknown, arm, influence, scratch.unknown_,
                       vicinity != nullptr ? &vicinity->unknown_ : nullptr, scratch.found_);
  }
  for (std::size_t k = 0; k < obstacles_.size(); ++k)
    if (in_view(k, moment.now_s, view, seen, among))
      add_obstacle_contacts(k, arm, influence, placed_at(obstacles_[k], moment), scratch.found_);
  write_nearest(scratch.found_, scratch.order_, out);
  return scratch.found_.size();
}

void Environment::add_map_contacts(const MapField& field, int id, const Shapes& arm,
                                   double influence, MapField::Scratch& scratch,
                                   std::vector<BoxField::Vicinity>* vicinity,
                                   std::vector<Contact>& found) const {
  if (field.empty()) return;
  std::array<BoxHit, points_per_sphere> hits;
  std::array<SegmentHit, points_per_sphere> axis_hits;
  for (std::size_t shape = 0; shape < arm.size(); ++shape) {
    const double limit = influence + arm.radii[shape];
    const bool capsule = arm.is_capsule(shape);
    BoxField::Vicinity* const near = vicinity != nullptr ? &(*vicinity)[shape] : nullptr;
    const std::size_t count = capsule
                                  ? field.nearest_distinct(map_pose_inverse_ * arm.from(shape),
                                                           map_pose_inverse_ * arm.to(shape), limit,
                                                           scratch, axis_hits, near)
                                  : field.nearest_distinct(map_pose_inverse_ * arm.centers[shape],
                                                           limit, scratch, hits, near);
    for (std::size_t i = 0; i < count; ++i) {
      const BoxHit& hit = capsule ? axis_hits[i] : hits[i];
      const Eigen::Vector3d at = capsule ? map_pose_ * axis_hits[i].axis_point : arm.centers[shape];
      found.push_back(contact_of(arm, shape, id, at, hit.distance, map_pose_ * hit.point,
                                 map_pose_.R() * hit.direction, Eigen::Vector3d::Zero()));
    }
  }
}

void Environment::add_obstacle_contacts(std::size_t k, const Shapes& arm, double influence,
                                        const Placed& at, std::vector<Contact>& found) const {
  const Obstacle& obstacle = obstacles_[k];
  const double ball = bounding_radius(obstacle) + at.nearer_m;
  for (std::size_t shape = 0; shape < arm.size(); ++shape) {
    const bool capsule = arm.is_capsule(shape);
    const double limit = influence + arm.radii[shape];
    const double near = limit + ball + (capsule ? arm.half_axes[shape].norm() : 0.0);
    if ((arm.centers[shape] - at.pose.p()).squaredNorm() > near * near) continue;
    const auto add = [&](const SurfacePoint& hit, const Eigen::Vector3d& from) {
      const double distance = hit.distance - at.nearer_m;
      if (distance <= limit)
        found.push_back(contact_of(arm, shape, static_cast<int>(k), from, distance,
                                   hit.point + at.nearer_m * hit.direction, hit.direction,
                                   at.velocity_at(hit.point)));
    };
    if (!capsule) {
      add(closest_on(obstacle, at.pose, arm.centers[shape]), arm.centers[shape]);
      continue;
    }
    // a capsule that lies along an obstacle is near it at both of its ends
    const Eigen::Vector3d from = arm.from(shape), to = arm.to(shape);
    const AxisPoint nearest = closest_on(obstacle, at.pose, from, to);
    add(nearest, nearest.axis_point);
    const double apart = distinct_share * 2.0 * arm.half_axes[shape].norm();
    for (const Eigen::Vector3d& end : {from, to})
      if ((end - nearest.axis_point).squaredNorm() > apart * apart)
        add(closest_on(obstacle, at.pose, end), end);
  }
}

bool Environment::is_map_beyond(const Eigen::Vector3d& p, double limit) const {
  return field_->made && field_->field != nullptr &&
         field_->field->is_farther(map_pose_inverse_ * p, limit);
}

double Environment::clearance(const Shapes& arm, const Moment& moment, double limit, View view,
                              std::span<const std::uint8_t> seen, Among among) const {
  double smallest = limit;
  BoxHit hit;
  SegmentHit axis_hit;
  const auto consider = [&](const MapField& field) {
    if (field.empty() || view == View::hidden || among == Among::moving) return;
    std::int32_t hint = -1;
    for (std::size_t i = 0; i < arm.size(); ++i) {
      // In contact, smallest + radius may be negative, but a deeper contact may follow: the limit
      // must not be below zero.
      const double near = std::max(0.0, smallest + arm.radii[i]);
      const double half = arm.is_capsule(i) ? arm.half_axes[i].norm() : 0.0;
      if (is_map_beyond(arm.centers[i], near + half)) continue;
      if (half > 0.0) {
        if (!field.nearest(map_pose_inverse_ * arm.from(i), map_pose_inverse_ * arm.to(i), near,
                           axis_hit, hint))
          continue;
        hit = axis_hit;
      } else if (!field.nearest(map_pose_inverse_ * arm.centers[i], near, hit, hint)) {
        continue;
      }
      hint = hit.box;
      smallest = std::min(smallest, hit.distance - arm.radii[i]);
    }
  };
  consider(*map_);
  if (summary_.unknown == UnknownPolicy::block) consider(*unknown_);
  for (std::size_t k = 0; k < obstacles_.size(); ++k)
    if (in_view(k, moment.now_s, view, seen, among))
      smallest = clearance_to(k, arm, moment, smallest);
  return smallest;
}

Environment::Standing Environment::nearest_standing(const Eigen::Vector3d& a,
                                                    const Eigen::Vector3d& b, double limit,
                                                    double time_s, std::int32_t& hint, View view,
                                                    std::span<const std::uint8_t> seen) const {
  Standing nearest{limit, Contact::map};
  const double half = 0.5 * (b - a).norm();
  if (view != View::hidden && !is_map_beyond(0.5 * (a + b), limit + half)) {
    const Eigen::Vector3d from = map_pose_inverse_ * a, to = map_pose_inverse_ * b;
    nearest.distance = map_->distance(from, to, limit, hint);
    if (summary_.unknown == UnknownPolicy::block) {
      std::int32_t none = -1;
      const double distance = unknown_->distance(from, to, nearest.distance, none);
      if (distance < nearest.distance) nearest = {distance, Contact::unknown};
    }
  }
  for (std::size_t k = 0; k < obstacles_.size(); ++k) {
    const Obstacle& obstacle = obstacles_[k];
    if (!in_view(k, time_s, view, seen, Among::standing)) continue;
    const geometry::SE3 at = motion_at(obstacle, time_s).pose;
    const double near = nearest.distance + bounding_radius(obstacle) + half;
    if ((0.5 * (a + b) - at.p()).squaredNorm() >= near * near) continue;
    const double distance =
        half > 0.0 ? closest_on(obstacle, at, a, b).distance : closest_on(obstacle, at, a).distance;
    if (distance < nearest.distance) nearest = {distance, static_cast<int>(k)};
  }
  return nearest;
}

bool Environment::in_slow_space(const Shapes& arm) const {
  if (summary_.unknown != UnknownPolicy::slow || unknown_->empty()) return false;
  BoxHit hit;
  SegmentHit axis_hit;
  for (std::size_t i = 0; i < arm.size(); ++i) {
    const bool touches =
        arm.is_capsule(i)
            ? unknown_->nearest(map_pose_inverse_ * arm.from(i), map_pose_inverse_ * arm.to(i),
                                arm.radii[i], axis_hit)
            : unknown_->nearest(map_pose_inverse_ * arm.centers[i], arm.radii[i], hit);
    if (touches) return true;
  }
  return false;
}

}  // namespace hamelin::scene
