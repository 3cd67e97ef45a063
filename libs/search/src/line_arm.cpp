#include "line_arm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lane_chain.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr double free_travel_m = 2.0;  // of a prismatic joint without limits
// By how much the spheres of a capsule may stick out of it [m]. More of them are slower, fewer
// leave more to the exact check.
constexpr double sphere_excess_m = 1e-3;
constexpr double radius_excess = 1e-6;  // of balls, above what rounding to float can take [m]

float above(double x) {
  return std::nextafter(static_cast<float>(x), std::numeric_limits<float>::infinity());
}

float under(double x) {
  return std::nextafter(static_cast<float>(x), -std::numeric_limits<float>::infinity());
}

}  // namespace

LineArm::LineArm(const model::Model& model, const scene::SelfField* self)
    : model_(model), levers_(model, self), joints_(lane_joints(model)), travel_(model.dof()) {
  fits_ = model.dof() <= kernel::joints_max;
  for (Index j = 0; j < model.dof(); ++j) {
    const auto& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
    const double limit =
        std::max(std::abs(joint.lower.value_or(0.0)), std::abs(joint.upper.value_or(0.0)));
    travel_[j] = !levers_.slides(j)                    ? std::numeric_limits<double>::infinity()
                 : limit > 0.0 && std::isfinite(limit) ? limit
                                                       : free_travel_m;
  }
  Eigen::VectorXd farthest = Eigen::VectorXd::Zero(model.dof());
  for (Index j = 0; j < model.dof(); ++j)
    if (levers_.slides(j)) farthest[j] = travel_[j];
  levers_.extend_travel(farthest, Eigen::VectorXd::Zero(model.dof()));
  add_parts(self);
  fits_ = fits_ && parts_.size() <= kernel::parts_max && spheres_.size() <= kernel::spheres_max &&
          pairs_.size() <= kernel::pairs_max;
  arm_.chain.dof = model.dof();
  arm_.part_count = static_cast<int>(parts_.size());
  arm_.pair_count = static_cast<int>(pairs_.size());
  arm_.chain.joints = joints_.data();
  arm_.parts = parts_.data();
  arm_.spheres = spheres_.data();
  arm_.pairs = pairs_.data();
}

void LineArm::add_parts(const scene::SelfField* self) {
  struct Group {
    int link;
    std::vector<int> shapes;
    std::size_t number;  // of SelfField::parts()
  };
  std::vector<Group> groups;
  if (self != nullptr) {
    for (const auto& part : self->parts())
      groups.push_back({part.body, part.shapes, groups.size()});
  } else {
    for (std::size_t i = 0; i < model_.shapes().size(); ++i) {
      const int link = model_.shapes()[i].link;
      if (groups.empty() || groups.back().link != link) groups.push_back({link, {}, groups.size()});
      groups.back().shapes.push_back(static_cast<int>(i));
    }
  }
  // The tip first, since it moves most.
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.link > b.link; });
  part_number_.resize(groups.size());
  part_levers_ = Eigen::MatrixXd::Zero(static_cast<Index>(groups.size()), model_.dof());
  for (std::size_t i = 0; i < groups.size(); ++i) {
    part_number_[groups[i].number] = static_cast<int>(i);
    if (groups[i].link >= 0)
      for (const int shape : groups[i].shapes)
        part_levers_.row(static_cast<Index>(i)) =
            part_levers_.row(static_cast<Index>(i)).cwiseMax(levers_.shapes().row(shape));
    add_part(groups[i].link, groups[i].shapes);
  }
  if (self == nullptr) return;
  for (const auto& pair : self->pairs())
    pairs_.push_back({part_number_[static_cast<std::size_t>(pair.part_a)],
                      part_number_[static_cast<std::size_t>(pair.part_b)]});
}

// A capsule is a chain of spheres about points of its axis, the first and last at its ends. If they
// are 2 a apart, the sphere with the radius √(r² + a²) holds what is nearest to its centre.
void LineArm::add_shape(int shape, std::vector<Ball>& balls) const {
  Vector3d center, half = Vector3d::Zero();
  double radius = 0.0;
  if (shape >= 0) {
    const auto& of = model_.shapes()[static_cast<std::size_t>(shape)];
    center = of.center;
    half = of.half_axis;
    radius = of.radius;
  } else {
    const auto& robot = model_.robot();
    const auto at = static_cast<std::size_t>(-1 - shape);
    if (at < robot.base_spheres.size()) {
      center = model_.base() * robot.base_spheres[at].center_m;
      radius = robot.base_spheres[at].radius_m;
    } else {
      const auto& capsule = robot.base_segments[at - robot.base_spheres.size()];
      center = model_.base() * Vector3d(0.5 * (capsule.from_m + capsule.to_m));
      half = model_.base().R() * (0.5 * (capsule.to_m - capsule.from_m));
      radius = capsule.radius_m;
    }
  }
  const double length = 2.0 * half.norm();
  if (!(length > 0.0)) {
    balls.push_back({center, radius, radius, shape});
    return;
  }
  const double apart = 2.0 * std::sqrt(sphere_excess_m * (2.0 * radius + sphere_excess_m));
  const double wanted = std::max(1.0, std::ceil(length / apart));
  const int pieces = static_cast<int>(std::min(wanted, static_cast<double>(kernel::spheres_max)));
  const double outer = std::hypot(radius, 0.5 * length / pieces);
  for (int i = 0; i <= pieces; ++i)
    balls.push_back({center + (2.0 * i / pieces - 1.0) * half, outer, radius, shape});
}

void LineArm::add_part(int link, const std::vector<int>& shapes) {
  std::vector<Ball> balls;
  for (const int shape : shapes) add_shape(shape, balls);
  kernel::Part part{};
  part.link = link;
  part.first = static_cast<int>(spheres_.size());
  part.count = static_cast<int>(balls.size());
  // The centre moves towards the farthest sphere by smaller and smaller steps (M. Bădoiu,
  // K. L. Clarkson 2003, Smaller core-sets for balls).
  Vector3d center = balls.front().center;
  const auto reach = [&](const Ball& ball) { return (ball.center - center).norm() + ball.radius; };
  const auto farthest = [&] {
    return *std::max_element(balls.begin(), balls.end(),
                             [&](const Ball& a, const Ball& b) { return reach(a) < reach(b); });
  };
  for (int i = 1; i < 200 && balls.size() > 1; ++i)
    center += (farthest().center - center) / (i + 1.0);
  double spread = 0.0;
  for (const Ball& ball : balls) spread = std::max(spread, (ball.center - center).norm());
  to_floats(center, part.ball.center);
  part.ball.radius = above(reach(farthest()) + radius_excess);
  part.spread = above(spread + radius_excess);
  parts_.push_back(part);
  if (link < 0) fixed_centers_.push_back(center);
  for (const Ball& ball : balls) {
    kernel::Sphere sphere{};
    to_floats(ball.center, sphere.center);
    sphere.radius = above(ball.radius);
    sphere.inner = under(ball.inner);
    spheres_.push_back(sphere);
    shape_of_.push_back(ball.shape);
    if (link < 0) fixed_centers_.push_back(ball.center);
  }
}

void LineArm::place(const geometry::SE3& frame) {
  const geometry::SE3 inverse = frame.inverse();
  place_chain(model_, frame, arm_.chain);
  auto fixed = fixed_centers_.begin();
  for (kernel::Part& part : parts_) {
    if (part.link >= 0) continue;
    to_floats(inverse * *fixed++, part.ball.center);
    for (int i = part.first; i < part.first + part.count; ++i)
      to_floats(inverse * *fixed++, spheres_[static_cast<std::size_t>(i)].center);
  }
  bound_rounding(inverse * model_.root());
}

// docs/theory.md (17.13)–(17.15)
void LineArm::bound_rounding(const geometry::SE3& root) {
  constexpr double u = unit_roundoff, pi = 3.15;
  constexpr double angle = u * (2.0 * pi + 3.0 * step_max), turn = 34.0 * u, second_order = 1.01;
  double rotation = 4.0 * u, reach = root.p().norm(), position = 2.0 * u * reach;
  extent_ = position_rounding_ = 0.0;
  const auto point = [&](const kernel::Sphere& sphere) {
    const double c = Vector3d(sphere.center[0], sphere.center[1], sphere.center[2]).norm();
    extent_ = std::max(extent_, reach + c + static_cast<double>(sphere.radius));
    position_rounding_ =
        std::max(position_rounding_, position + rotation * c + u * (8.0 * c + 2.0 * reach));
  };
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const kernel::Joint& joint = joints_[j];
    const bool slides = levers_.slides(static_cast<Index>(j));
    const double travel = slides ? travel_[static_cast<Index>(j)] : 0.0;
    const double length = Vector3d(joint.p[0], joint.p[1], joint.p[2]).norm() + travel;
    reach += length;
    position += rotation * length + u * (8.0 * length + 2.0 * reach + 6.0 * travel);
    rotation += slides ? turn : turn + angle;
    for (const kernel::Part& part : parts_) {
      if (part.link != static_cast<int>(j)) continue;
      point(part.ball);
      for (int i = part.first; i < part.first + part.count; ++i)
        point(spheres_[static_cast<std::size_t>(i)]);
    }
  }
  for (const kernel::Part& part : parts_)  // fixed ones are only converted
    if (part.link < 0)
      for (int i = part.first; i < part.first + part.count; ++i) {
        const auto& c = spheres_[static_cast<std::size_t>(i)].center;
        const double distance = Vector3d(c[0], c[1], c[2]).norm();
        position_rounding_ = std::max(position_rounding_, 2.0 * u * distance);
        extent_ = std::max(extent_, distance);
      }
  extent_ = std::max(extent_, reach);
  position_rounding_ *= second_order;
  const double n = static_cast<double>(joints_.size());
  velocity_rounding_ = second_order * ((2.0 * extent_ + 1.0) * rotation +
                                       2.0 * std::max(position, position_rounding_) +
                                       u * (extent_ + 1.0) * (2.0 * n + 32.0));
}

}  // namespace hamelin::search
