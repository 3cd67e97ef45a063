#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "movers.hpp"

namespace hamelin::bench {

using Eigen::Quaterniond;
using Eigen::Vector3d;

namespace {

// Dimensions of a person [m]; lengths of capsules without their caps.
constexpr double trunk_radius = 0.14, trunk_length = 0.34, trunk_height = 0.3;
constexpr double head_radius = 0.11, head_height = 0.8;
constexpr double shoulder_height = 0.5, shoulder_half_width = 0.21;
constexpr double upper_arm = 0.30, upper_arm_radius = 0.055;
constexpr double forearm = 0.38, forearm_radius = 0.05;  // with the hand
constexpr double reach_max = 0.95 * (upper_arm + forearm), reach_min = 0.3;

constexpr double apart_m = 0.6;           // of two people
constexpr double base_distance_m = 0.55;  // of a trunk from the arm's base
constexpr int samples = 24;               // way-points of one reach
constexpr double check_s = 0.01;          // between two checks of the speed

/// Frame of a person: x towards the arm, z up.
struct Stand {
  Vector3d place, forward, left;
};

/// Where elbow and hand are, while the hand moves on a line.
struct Posture {
  Vector3d elbow, hand;
};

/// The elbow hangs down and to the outside of the line from shoulder to hand.
Posture posture(const Vector3d& shoulder, const Vector3d& hand, const Vector3d& outwards) {
  const Vector3d line = hand - shoulder;
  const double d = line.norm();
  const double along = (upper_arm * upper_arm - forearm * forearm + d * d) / (2.0 * d);
  const Vector3d axis = line / d, hang = 0.6 * outwards - Vector3d::UnitZ(),
                 side = (hang - axis.dot(hang) * axis).normalized();
  return {shoulder + along * axis + std::sqrt(upper_arm * upper_arm - along * along) * side, hand};
}

/// 10 x³ − 15 x⁴ + 6 x⁵: from rest to rest.
double smooth(double x) {
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

/// The times of one cycle: the hand waits, reaches, holds and goes back.
struct Cycle {
  double wait_s, reach_s, hold_s;
  [[nodiscard]] double length_s() const { return wait_s + 2.0 * reach_s + hold_s; }
};

/// The poses of a limb between two points that move; the limb does not turn about its axis.
class LimbPoses {
 public:
  void add(const Vector3d& from, const Vector3d& to) {
    Vector3d axis = (to - from).normalized();
    // A capsule has no front and back, so the first turn is at most a quarter.
    if (poses_.empty() && axis.z() < 0.0) sign_ = -1.0;
    axis *= sign_;
    turn_ = (Quaterniond::FromTwoVectors(axis_, axis) * turn_).normalized();
    axis_ = axis;
    scene::Waypoint pose;
    pose.position_m = rounded_m(Vector3d(0.5 * (from + to)));
    const std::array wxyz{turn_.w(), turn_.x(), turn_.y(), turn_.z()};
    for (std::size_t i = 0; i < wxyz.size(); ++i)
      pose.quaternion_wxyz[i] = std::round(1e6 * wxyz[i]) / 1e6;
    poses_.push_back(pose);
  }

  /// There and back, again and again.
  [[nodiscard]] scene::WaypointMotion motion(const Cycle& cycle) const {
    std::vector<scene::Waypoint> path{poses_.front()};
    const auto add = [&](double time_s, const scene::Waypoint& pose) {
      path.push_back(pose);
      path.back().time_s = std::round(1e4 * time_s) / 1e4;
    };
    const double back_s = cycle.wait_s + cycle.reach_s + cycle.hold_s;
    for (int i = 0; i <= samples; ++i)
      add(cycle.wait_s + cycle.reach_s * i / samples, poses_[static_cast<std::size_t>(i)]);
    for (int i = 0; i <= samples; ++i)
      add(back_s + cycle.reach_s * i / samples, poses_[static_cast<std::size_t>(samples - i)]);
    return {std::make_shared<const scene::WaypointPath>(
        path, scene::WaypointPath::Options{true, cycle.length_s()}, "a person's limb")};
  }

 private:
  std::vector<scene::Waypoint> poses_;
  Vector3d axis_ = Vector3d::UnitZ();
  Quaterniond turn_ = Quaterniond::Identity();
  double sign_ = 1.0;
};

/// The largest speed of any point of a capsule in a cycle [m/s], sampled.
double sampled_speed(const scene::Obstacle& limb, double until_s) {
  double most = 0.0;
  for (double t = 0.0; t < until_s; t += check_s) {
    const scene::MotionState state = scene::motion_at(limb, t);
    for (const double end : {-0.5, 0.5}) {
      const Vector3d tip = state.pose * Vector3d(0.0, 0.0, end * limb.length_m);
      most = std::max(
          most, state.velocity_at(tip).norm() + state.angular_velocity.norm() * limb.radius_m);
    }
  }
  return most;
}

scene::Obstacle capsule(const std::string& name, double radius, double length) {
  scene::Obstacle o;
  o.name = name;
  o.shape = scene::Shape::capsule;
  o.radius_m = radius;
  o.length_m = length;
  return o;
}

/// Upper arm and forearm, whose hand reaches for a target as fast as is allowed.
std::vector<scene::Obstacle> draw_arm(Rng& rng, const std::string& name, const Stand& stand,
                                      double side, const Vector3d& target, double speed_max) {
  const Vector3d outwards = side * stand.left,
                 shoulder = stand.place + shoulder_half_width * outwards +
                            shoulder_height * Vector3d::UnitZ(),
                 rest = shoulder + 0.3 * stand.forward - 0.25 * Vector3d::UnitZ();
  LimbPoses upper, fore;
  for (int i = 0; i <= samples; ++i) {
    const double x = smooth(static_cast<double>(i) / samples);
    const Posture at = posture(shoulder, rest + x * (target - rest), outwards);
    upper.add(shoulder, at.elbow);
    fore.add(at.elbow, at.hand);
  }
  std::vector<scene::Obstacle> limbs{capsule(name + " upper arm", upper_arm_radius, upper_arm),
                                     capsule(name + " forearm", forearm_radius, forearm)};
  Cycle cycle{rng.uniform(0.2, 1.5), 1.0, rng.uniform(0.3, 1.5)};
  constexpr double reserve = 1.01;
  for (int i = 0; i < 10; ++i) {
    limbs[0].motion = upper.motion(cycle);
    limbs[1].motion = fore.motion(cycle);
    double speed = 0.0;
    for (const auto& limb : limbs) speed = std::max(speed, sampled_speed(limb, cycle.length_s()));
    if (i > 0 && speed <= speed_max) break;
    cycle.reach_s *= reserve * speed / speed_max;
  }
  return limbs;
}

bool stay_clear(const std::vector<scene::Obstacle>& person, const ArmWay& way, double until_s) {
  return std::all_of(person.begin(), person.end(), [&](const scene::Obstacle& o) {
    return way.stays_clear(o, o.motion ? until_s : 0.0, always_clear_m);
  });
}

/// Trunk, head and two arms, which reach for points beside each other on the way of the arm.
std::optional<std::vector<scene::Obstacle>> draw_person(Rng& rng, const std::string& name,
                                                        const ArmWay& way,
                                                        const MoverRequest& request) {
  const Vector3d target = way.point(rng, 0.3, 0.7);
  const double distance = rng.uniform(0.35, 0.5), turn = rng.uniform(-0.5, 0.5),
               between = rng.uniform(0.08, 0.2);
  const Vector3d outwards = Vector3d(target.x(), target.y(), 0.0).normalized(),
                 across = Vector3d::UnitZ().cross(outwards),
                 from_arm = (outwards + turn * across).normalized();
  Stand stand;
  stand.place = Vector3d(target.x(), target.y(), 0.0) + distance * from_arm;
  stand.forward = -from_arm;
  stand.left = Vector3d::UnitZ().cross(stand.forward);
  if (stand.place.norm() < base_distance_m) return std::nullopt;
  scene::Obstacle trunk = capsule(name + " trunk", trunk_radius, trunk_length), head;
  const auto put = [&](scene::Obstacle& o, double height) {
    o.pose = {Eigen::Matrix3d::Identity(),
              rounded_m(Vector3d(stand.place + height * Vector3d::UnitZ()))};
  };
  put(trunk, trunk_height);
  head.name = name + " head";
  head.radius_m = head_radius;
  put(head, head_height);
  std::vector<scene::Obstacle> person{trunk, head};
  for (const double side : {1.0, -1.0}) {
    const Vector3d hand = target + side * 0.5 * between * stand.left,
                   shoulder = stand.place + side * shoulder_half_width * stand.left +
                              shoulder_height * Vector3d::UnitZ();
    const double reach = (hand - shoulder).norm();
    if (reach > reach_max || reach < reach_min) return std::nullopt;
    for (auto& limb : draw_arm(rng, name + (side > 0.0 ? " left" : " right"), stand, side, hand,
                               request.speed_max_m_s))
      person.push_back(std::move(limb));
  }
  if (!stay_clear(person, way, request.duration_s)) return std::nullopt;
  return person;
}

}  // namespace

std::vector<scene::Obstacle> make_people(Rng& rng, const ArmWay& way, const MoverRequest& request) {
  std::vector<scene::Obstacle> people;
  std::vector<Vector3d> places;
  for (std::size_t i = 0; i < request.count; ++i) {
    const std::string name = fmt::format("person {}", i + 1);
    const auto person =
        draw_accepted("people", [&]() -> std::optional<std::vector<scene::Obstacle>> {
          auto drawn = draw_person(rng, name, way, request);
          if (!drawn) return std::nullopt;
          for (const auto& other : places)
            if ((drawn->front().pose.p() - other).norm() < apart_m) return std::nullopt;
          return drawn;
        });
    places.push_back(person.front().pose.p());
    people.insert(people.end(), person.begin(), person.end());
  }
  return people;
}

}  // namespace hamelin::bench
