#include "hamelin/scene/self_collision.hpp"

#include <fmt/format.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

namespace {

using Eigen::Vector3d;

// Sets the smallest bounding ball of a part about the centre of one of its shapes:
// docs/theory.md (11.36). It does not depend on the configuration.
void set_bounding_ball(SelfField::Part& part, const std::vector<Vector3d>& centers,
                       const std::vector<double>& radii) {
  part.radius = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < centers.size(); ++i) {
    double reach = 0.0;
    for (std::size_t j = 0; j < centers.size(); ++j)
      reach = std::max(reach, (centers[j] - centers[i]).norm() + radii[j]);
    if (reach < part.radius) {
      part.radius = reach;
      part.center = part.shapes[i];
    }
  }
}

// The u from −1 to 1 of the point c + u h of an axis that is nearest to p.
double nearest_on_axis(const Vector3d& center, const Vector3d& half, const Vector3d& p) {
  const double square = half.squaredNorm();
  return square > 0.0 ? std::clamp(half.dot(p - center) / square, -1.0, 1.0) : 0.0;
}

}  // namespace

AxisPair nearest_on_axes(const Vector3d& center_a, const Vector3d& half_a, const Vector3d& center_b,
                         const Vector3d& half_b) {
  AxisPair best;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](double on_a, double on_b) {
    const double square = (center_a + on_a * half_a - center_b - on_b * half_b).squaredNorm();
    if (!(square < least)) return;
    least = square;
    best = {on_a, on_b};
  };
  const double aa = half_a.squaredNorm(), bb = half_b.squaredNorm(), ab = half_a.dot(half_b);
  const Vector3d apart = center_a - center_b;
  // aa bb − ab², without its cancellation
  const double across = half_a.cross(half_b).squaredNorm();
  // docs/theory.md (11.35): the nearest points of the lines, each projected onto the other axis
  if (across > 0.0) {
    const double a =
        std::clamp((ab * half_b.dot(apart) - bb * half_a.dot(apart)) / across, -1.0, 1.0);
    const double on_b = nearest_on_axis(center_b, half_b, center_a + a * half_a);
    consider(nearest_on_axis(center_a, half_a, center_b + on_b * half_b), on_b);
  }
  // an end of one axis and a point of the other: the only candidates if the axes are parallel or
  // points
  for (const double end : {-1.0, 1.0}) {
    consider(end, nearest_on_axis(center_b, half_b, center_a + end * half_a));
    consider(nearest_on_axis(center_a, half_a, center_b + end * half_b), end);
  }
  if (aa == 0.0) best.on_a = 0.0;
  if (bb == 0.0) best.on_b = 0.0;
  return best;
}

SelfField::SelfField(const model::Model& model)
    : has_capsules_(model.has_capsules() || !model.robot().base_segments.empty()) {
  add_parts(model);
  add_bounding_balls(model);
  add_pairs(model.robot());
}

void SelfField::add_parts(const model::Model& model) {
  const model::Robot& robot = model.robot();
  const auto part_named = [&](const std::string& name, int body) -> Part& {
    for (Part& part : parts_)
      if (part.name == name) return part;
    parts_.push_back({name, body, {}});
    return parts_.back();
  };
  for (std::size_t i = 0; i < model.shapes().size(); ++i) {
    const auto& shape = model.shapes()[i];
    const auto& link = robot.links[static_cast<std::size_t>(shape.link)];
    const auto index = static_cast<std::size_t>(shape.index_in_link);
    const std::string& part =
        shape.is_capsule ? link.segments[index].part : link.spheres[index].part;
    part_named(part.empty() ? link.name : part, shape.link).shapes.push_back(static_cast<int>(i));
    radii_.push_back(shape.radius);
    half_lengths_.push_back(shape.half_axis.norm());
  }
  const auto add_to_base = [&](const std::string& part, const Vector3d& center,
                               const Vector3d& half, double radius) {
    part_named(part, -1).shapes.push_back(-1 - static_cast<int>(base_centers_.size()));
    base_centers_.push_back(model.base() * center);
    base_half_axes_.push_back(model.base().R() * half);
    base_radii_.push_back(radius);
    base_half_lengths_.push_back(half.norm());
  };
  for (const auto& sphere : robot.base_spheres)
    add_to_base(sphere.part, sphere.center_m, Vector3d::Zero(), sphere.radius_m);
  for (const auto& capsule : robot.base_segments)
    add_to_base(capsule.part, 0.5 * (capsule.from_m + capsule.to_m),
                0.5 * (capsule.to_m - capsule.from_m), capsule.radius_m);
}

void SelfField::add_bounding_balls(const model::Model& model) {
  for (Part& part : parts_) {
    std::vector<Vector3d> centers;
    std::vector<double> radii;
    for (const int shape : part.shapes) {
      // any frame in which all shapes of the part are fixed is suitable
      centers.push_back(shape >= 0 ? model.shapes()[static_cast<std::size_t>(shape)].center
                                   : base_centers_[static_cast<std::size_t>(-1 - shape)]);
      radii.push_back(radius(shape) + half_length(shape));
    }
    set_bounding_ball(part, centers, radii);
  }
}

void SelfField::add_pairs(const model::Robot& robot) {
  std::set<std::pair<std::string, std::string>> disabled;
  for (const auto& [a, b] : robot.self_collision_disabled) {
    disabled.emplace(a, b);
    disabled.emplace(b, a);
  }
  std::string left_out;
  // moving parts come first, in the order of links, then those of the base
  for (std::size_t a = 0; a < parts_.size(); ++a)
    for (std::size_t b = a + 1; b < parts_.size(); ++b) {
      const Part &x = parts_[a], &y = parts_[b];
      if (x.body == y.body || disabled.count({x.name, y.name}) != 0) continue;
      if (disabled.empty() && std::abs(x.body - y.body) == 1) {
        left_out += fmt::format("{}{}-{}", left_out.empty() ? "" : ", ", x.name, y.name);
        continue;
      }
      pairs_.push_back({static_cast<int>(a), static_cast<int>(b)});
    }
  if (!left_out.empty())
    note_ = fmt::format(
        "the robot lists no pairs that may touch (self_collision_disabled), so neighbouring links "
        "are not checked: {}",
        left_out);
}

std::string SelfField::describe(int pair) const {
  const Pair& both = pairs_[static_cast<std::size_t>(pair)];
  return fmt::format("'{}' and '{}'", parts_[static_cast<std::size_t>(both.part_a)].name,
                     parts_[static_cast<std::size_t>(both.part_b)].name);
}

std::string self_contact_remedy(const RobotRef& robot) {
  std::string command = fmt::format("hamelin robot check {}", robot.file.string());
  if (robot.tip) command += fmt::format(" --tip {}", *robot.tip);
  if (robot.spheres) command += fmt::format(" --spheres {}", robot.spheres->string());
  if (robot.srdf) command += fmt::format(" --srdf {}", robot.srdf->string());
  std::filesystem::path target = robot.spheres.value_or(robot.file);
  target.replace_extension(robot.spheres ? ".checked.json" : ".checked.srdf");
  return fmt::format(
      "start elsewhere; or, if they always touch, `{} --write {}` disables the pair; then name "
      "that "
      "file as /robot/{}",
      command, target.string(), robot.spheres ? "spheres" : "srdf");
}

Vector3d SelfField::half_axis(int shape, const Shapes& arm) const {
  if (shape < 0) return base_half_axes_[static_cast<std::size_t>(-1 - shape)];
  return arm.half_axes.empty() ? Vector3d::Zero() : arm.half_axes[static_cast<std::size_t>(shape)];
}

// docs/theory.md (11.34)
template <bool capsules>
bool SelfField::update_nearest(const Pair& pair, const Shapes& arm, Nearest& best) const {
  const Part &a = parts_[static_cast<std::size_t>(pair.part_a)],
             &b = parts_[static_cast<std::size_t>(pair.part_b)];
  const Vector3d &ball_a = center(a.center, arm), &ball_b = center(b.center, arm);
  // docs/theory.md (11.37): whether two balls are at least `best` apart, with a margin for rounding
  const auto apart = [&](const Vector3d& p, const Vector3d& q, double radii) {
    const double near = (best.distance + radii) * (1.0 + 1e-12);
    return near <= 0.0 || (p - q).squaredNorm() > near * near;
  };
  if (apart(ball_a, ball_b, a.radius + b.radius)) return false;
  bool found = false;
  for (const int i : a.shapes) {
    const Vector3d& p = center(i, arm);
    const double r = radius(i), around_p = capsules ? r + half_length(i) : r;
    if (apart(p, ball_b, around_p + b.radius)) continue;
    for (const int j : b.shapes) {
      const Vector3d& q = center(j, arm);
      const double both = r + radius(j);
      if (apart(p, q, capsules ? around_p + radius(j) + half_length(j) : both)) continue;
      double between = (p - q).norm();
      if constexpr (capsules) {
        const Vector3d half_p = half_axis(i, arm), half_q = half_axis(j, arm);
        const AxisPair on = nearest_on_axes(p, half_p, q, half_q);
        between = (p + on.on_a * half_p - q - on.on_b * half_q).norm();
      }
      const double distance = between - both;
      if (distance > best.distance || (found && distance == best.distance)) continue;
      best = {distance, i, j};
      found = true;
    }
  }
  return found;
}

std::size_t SelfField::closest(const Shapes& arm, double limit, std::span<SelfContact> out) const {
  std::size_t found = 0;
  const auto farther = [](const SelfContact& x, const SelfContact& y) {
    return x.distance != y.distance ? x.distance < y.distance : x.pair < y.pair;
  };
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    Nearest best{limit, 0, 0};
    if (!update_nearest(pairs_[k], arm, best)) continue;
    ++found;
    SelfContact contact;
    contact.pair = static_cast<int>(k);
    contact.sphere_a = best.a;
    contact.sphere_b = std::max(best.b, SelfContact::base);
    contact.distance = best.distance;
    Vector3d p = center(best.a, arm), q = center(best.b, arm), across = Vector3d::Zero();
    if (has_capsules_) {
      const Vector3d half_p = half_axis(best.a, arm), half_q = half_axis(best.b, arm);
      const AxisPair on = nearest_on_axes(p, half_p, q, half_q);
      p += on.on_a * half_p;
      q += on.on_b * half_q;
      across = half_p.cross(half_q);
    }
    const double between = (p - q).norm();
    // axes that intersect separate along their common normal
    contact.direction = between > 0.0        ? Vector3d((p - q) / between)
                        : across.isZero(0.0) ? Vector3d(Vector3d::UnitZ())
                                             : Vector3d(across.normalized());
    contact.point_a = p - radius(best.a) * contact.direction;
    contact.point_b = q + radius(best.b) * contact.direction;
    if (found <= out.size()) {
      out[found - 1] = contact;
    } else if (!out.empty()) {
      const auto worst = std::max_element(out.begin(), out.end(), farther);
      if (contact.distance < worst->distance) *worst = contact;
    }
  }
  if (found > out.size())
    std::sort(out.begin(), out.end(),
              [](const SelfContact& x, const SelfContact& y) { return x.pair < y.pair; });
  return found;
}

double SelfField::distance(std::size_t pair, const Shapes& arm, double limit) const {
  Nearest best{limit, 0, 0};
  (void)update_nearest(pairs_[pair], arm, best);
  return best.distance;
}

}  // namespace hamelin::scene
