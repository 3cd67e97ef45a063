#include "hamelin/scene/self_collision.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

namespace hamelin::scene {

namespace {

using Eigen::Vector3d;

// The sphere about which the ball around all of a part's is smallest. Its centre is known wherever the arm is.
void draw_ball(SelfField::Part& part, const std::vector<Vector3d>& centers, const std::vector<double>& radii) {
  part.radius = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < centers.size(); ++i) {
    double reach = 0.0;
    for (std::size_t j = 0; j < centers.size(); ++j)
      reach = std::max(reach, (centers[j] - centers[i]).norm() + radii[j]);
    if (reach < part.radius) {
      part.radius = reach;
      part.center = part.spheres[i];
    }
  }
}

}  // namespace

SelfField::SelfField(const model::Model& model) {
  const model::Robot& robot = model.robot();
  const auto part_named = [&](const std::string& name, int body) -> Part& {
    for (Part& part : parts_)
      if (part.name == name) return part;
    parts_.push_back({name, body, {}});
    return parts_.back();
  };
  for (std::size_t i = 0; i < model.spheres().size(); ++i) {
    const auto& sphere = model.spheres()[i];
    const auto& link = robot.links[static_cast<std::size_t>(sphere.link)];
    const std::string& part = link.spheres[static_cast<std::size_t>(sphere.index_in_link)].part;
    part_named(part.empty() ? link.name : part, sphere.link).spheres.push_back(static_cast<int>(i));
    radii_.push_back(sphere.radius);
  }
  for (std::size_t i = 0; i < robot.base_spheres.size(); ++i) {
    const auto& sphere = robot.base_spheres[i];
    part_named(sphere.part, -1).spheres.push_back(-1 - static_cast<int>(i));
    base_centers_.push_back(model.base() * sphere.center_m);
    base_radii_.push_back(sphere.radius_m);
  }
  for (Part& part : parts_) {
    std::vector<Vector3d> centers;
    std::vector<double> radii;
    for (const int sphere : part.spheres) {
      // any frame that keeps them apart as they are will do
      centers.push_back(sphere >= 0 ? model.spheres()[static_cast<std::size_t>(sphere)].center
                                    : base_centers_[static_cast<std::size_t>(-1 - sphere)]);
      radii.push_back(radius(sphere));
    }
    draw_ball(part, centers, radii);
  }

  std::set<std::pair<std::string, std::string>> disabled;
  for (const auto& [a, b] : robot.self_collision_disabled) {
    disabled.emplace(a, b);
    disabled.emplace(b, a);
  }
  std::string left_out;
  // moving parts come first, link by link, and the base's last
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
        "the robot lists no pairs that may touch (self_collision_disabled), so neighbouring links are not checked: {}",
        left_out);
}

std::string SelfField::words(int pair) const {
  const Pair& both = pairs_[static_cast<std::size_t>(pair)];
  return fmt::format("'{}' and '{}'", parts_[static_cast<std::size_t>(both.part_a)].name,
                     parts_[static_cast<std::size_t>(both.part_b)].name);
}

bool SelfField::nearer(const Pair& pair, std::span<const Vector3d> centers, Nearest& best) const {
  const Part &a = parts_[static_cast<std::size_t>(pair.part_a)], &b = parts_[static_cast<std::size_t>(pair.part_b)];
  const Vector3d &ball_a = center(a.center, centers), &ball_b = center(b.center, centers);
  // Whether two balls are at least `best` apart; a hair wider than that, for what rounding can do.
  const auto apart = [&](const Vector3d& p, const Vector3d& q, double radii) {
    const double near = (best.distance + radii) * (1.0 + 1e-12);
    return near <= 0.0 || (p - q).squaredNorm() > near * near;
  };
  if (apart(ball_a, ball_b, a.radius + b.radius)) return false;
  bool found = false;
  for (const int i : a.spheres) {
    const Vector3d& p = center(i, centers);
    const double r = radius(i);
    if (apart(p, ball_b, r + b.radius)) continue;
    for (const int j : b.spheres) {
      const Vector3d& q = center(j, centers);
      const double both = r + radius(j);
      if (apart(p, q, both)) continue;
      const double distance = (p - q).norm() - both;
      if (distance > best.distance || (found && distance == best.distance)) continue;
      best = {distance, i, j};
      found = true;
    }
  }
  return found;
}

std::size_t SelfField::closest(std::span<const Vector3d> centers, double limit, std::span<SelfContact> out) const {
  std::size_t found = 0;
  const auto farther = [](const SelfContact& x, const SelfContact& y) {
    return x.distance != y.distance ? x.distance < y.distance : x.pair < y.pair;
  };
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    Nearest best{limit, 0, 0};
    if (!nearer(pairs_[k], centers, best)) continue;
    ++found;
    SelfContact contact;
    contact.pair = static_cast<int>(k);
    contact.sphere_a = best.a;
    contact.sphere_b = std::max(best.b, SelfContact::base);
    contact.distance = best.distance;
    const Vector3d &p = center(best.a, centers), &q = center(best.b, centers);
    const double between = (p - q).norm();
    contact.direction = between > 0.0 ? Vector3d((p - q) / between) : Vector3d::UnitZ();
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
    std::sort(out.begin(), out.end(), [](const SelfContact& x, const SelfContact& y) { return x.pair < y.pair; });
  return found;
}

double SelfField::distance(std::size_t pair, std::span<const Vector3d> centers, double limit) const {
  Nearest best{limit, 0, 0};
  (void)nearer(pairs_[pair], centers, best);
  return best.distance;
}

}  // namespace hamelin::scene
