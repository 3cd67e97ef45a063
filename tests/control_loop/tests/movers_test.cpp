// Controllers of arms among moving obstacles.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "../loop.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Loop;

namespace {

/// An arm that stands at its goal, without a map.
scene::Scene at_its_goal() {
  scene::Scene scene = test::sampled("clutter.json");
  scene.map.reset();
  scene.obstacles.clear();
  scene.goals = {scene::joint_goal(scene.start_q)};
  return scene;
}

/// A sphere that is far at first, swings 0.15 m beyond the tip, and comes back.
scene::Obstacle swinging(const scene::Scene& scene, double period_s) {
  const model::Model arm = control::load_model(scene);
  dynamics::Workspace ws(arm);
  dynamics::forward_kinematics(arm, ws, scene.start_q);
  scene::Obstacle sphere;
  sphere.name = "pendulum";
  sphere.radius_m = 0.1;
  sphere.pose = {Eigen::Matrix3d::Identity(),
                 dynamics::tip_pose(arm, ws).p() + Vector3d(0.0, 0.6, 0.0)};
  sphere.motion = scene::SineMotion{{0.0, -0.75, 0.0}, period_s};
  return sphere;
}

}  // namespace

TEST_CASE("an arm that has reached its goal evades a sphere that swings through its posture",
          "[control][controller][hybrid][movers]") {
  const double period_s = GENERATE(3.0, 4.0, 6.0);
  CAPTURE(period_s);
  scene::Scene scene = at_its_goal();
  scene.obstacles = {swinging(scene, period_s)};
  Loop loop(scene);
  dynamics::Workspace ws(loop.arm);
  dynamics::forward_kinematics(loop.arm, ws, scene.start_q);
  scene::PlacedShapes at_goal(loop.arm);
  at_goal.place(loop.arm, ws);
  const scene::Environment alone(std::nullopt, scene.obstacles, scene.base, 2.0, 0.5);

  double clearance = 1.0, if_it_stood = 1.0, farthest = 0.0;
  long allocations = 0;
  std::array<double, 3> nearest_to_goal{1.0, 1.0, 1.0};
  const long ticks = std::lround(3000.0 * period_s) - 1;
  for (long k = 0; k < ticks; ++k) {
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (k > 0) allocations += made;  // the first tick of a planner may prepare
    INFO(answer->cause);
    REQUIRE(answer->state == control::ControlState::reached);
    clearance = std::min(clearance, loop.controller.view().clearance_m());
    if_it_stood = std::min(if_it_stood, alone.clearance(at_goal.view(), loop.state.time_s, 1.0));
    const double error = (loop.state.q - scene.start_q).lpNorm<Eigen::Infinity>();
    farthest = std::max(farthest, error);
    // The sphere is away from the arm in the second half of each period.
    const auto period = static_cast<std::size_t>(loop.state.time_s / period_s);
    if (loop.state.time_s > (static_cast<double>(period) + 0.5) * period_s)
      nearest_to_goal[period] = std::min(nearest_to_goal[period], error);
    loop.step(answer->torque);
  }
  CHECK(if_it_stood < -0.05);
  CHECK(clearance > 0.0);
  CHECK(farthest > 0.05);
  for (const double error : nearest_to_goal) CHECK(error < scene.goals[0].tolerance_rad);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

// ---- what planners are told of the future

namespace {

enum Reported {
  moving,
  listed,
  id,
  x,
  y,
  z,
  nearer,
  contacts,
  distance,
  query_clearance,
  query_distance,
  proved,
  margin
};

constexpr double sphere_radius_m = 0.1, swing_period_s = 2.0, speed_max_m_s = 3.0;
const Vector3d swing_middle(0.75, 0.0, 0.6), swing_amplitude(-0.45, 0.1, 0.0);

/// A ball that stands, with id 0, and a ball that swings into the arm, with id 1.
scene::Scene foreseen(scene::Prediction prediction) {
  scene::Scene scene = at_its_goal();
  scene.planner->name = "foreseeing";
  scene.planner->params = Json::object();
  scene::Obstacle still, swinging;
  still.name = "still";
  still.radius_m = 0.2;
  still.pose = {Eigen::Matrix3d::Identity(), {-1.0, 0.0, 0.5}};
  swinging.name = "swinging";
  swinging.radius_m = sphere_radius_m;
  swinging.pose = {Eigen::Matrix3d::Identity(), swing_middle};
  swinging.motion = scene::SineMotion{swing_amplitude, swing_period_s};
  swinging.prediction = prediction;
  if (prediction == scene::Prediction::speed_bound) swinging.speed_max_m_s = speed_max_m_s;
  scene.obstacles = {still, swinging};
  return scene;
}

/// Where the ball is predicted to be, by formulas.
Vector3d foreseen_place(scene::Prediction prediction, double now_s, double ahead_s) {
  const double rate = 2.0 * std::acos(-1.0) / swing_period_s, s = std::sin(rate * now_s),
               c = std::cos(rate * now_s);
  double share = s;
  if (prediction == scene::Prediction::path) share = std::sin(rate * (now_s + ahead_s));
  if (prediction == scene::Prediction::constant_velocity) share = s + rate * c * ahead_s;
  if (prediction == scene::Prediction::constant_acceleration)
    share = s + rate * c * ahead_s - 0.5 * rate * rate * s * ahead_s * ahead_s;
  return swing_middle + share * swing_amplitude;
}

double foreseen_nearer(scene::Prediction prediction, double ahead_s) {
  return prediction == scene::Prediction::speed_bound ? speed_max_m_s * ahead_s : 0.0;
}

/// The distance of an arm at q from a ball.
double distance_at(const model::Model& arm, const VectorXd& q, const Vector3d& center,
                   double radius) {
  dynamics::Workspace ws(arm);
  dynamics::forward_kinematics(arm, ws, q);
  scene::PlacedShapes placed(arm);
  placed.place(arm, ws);
  const scene::Shapes shapes = placed.view();
  scene::Obstacle ball;
  ball.radius_m = radius;
  const geometry::SE3 pose{Eigen::Matrix3d::Identity(), center};
  double least = 1e9;
  for (std::size_t i = 0; i < shapes.size(); ++i)
    least =
        std::min(least, (shapes.is_capsule(i)
                             ? scene::closest_on(ball, pose, shapes.from(i), shapes.to(i)).distance
                             : scene::closest_on(ball, pose, shapes.centers[i]).distance) -
                            shapes.radii[i]);
  return least;
}

constexpr scene::Prediction predictions[] = {
    scene::Prediction::path, scene::Prediction::constant_acceleration,
    scene::Prediction::constant_velocity, scene::Prediction::speed_bound};

}  // namespace

TEST_CASE("a host tells where obstacles will be by what is known of them, also distant ones",
          "[control][movers]") {
  for (const auto prediction : predictions) {
    for (const double ahead_s : {0.0, 0.1, 0.3, 0.7}) {
      CAPTURE(to_string(prediction), ahead_s);
      const scene::Scene scene = foreseen(prediction);
      // Contacts of ticks are listed up to 0.2 m only.
      Loop loop(scene, {}, {{"ahead_s", ahead_s}, {"kinds", HAMELIN_MOVING}, {"radius_m", 5.0}});
      for (int k = 0; k < 40; ++k) {
        const double now_s = 0.05 * k;
        CAPTURE(now_s);
        const auto report = loop.controller.tick(now_s, scene.start_q, loop.v).series;
        const Vector3d place = foreseen_place(prediction, now_s, ahead_s);
        const double less = foreseen_nearer(prediction, ahead_s);
        REQUIRE(report[moving] == 1.0);
        REQUIRE(report[listed] == 1.0);
        REQUIRE(report[id] == 1.0);
        REQUIRE((Vector3d(report[x], report[y], report[z]) - place).norm() < 1e-12);
        REQUIRE(report[nearer] == Approx(less));
        REQUIRE(report[contacts] == static_cast<double>(loop.arm.shapes().size()));
        REQUIRE(report[distance] ==
                Approx(distance_at(loop.arm, scene.start_q, place, sphere_radius_m) - less)
                    .margin(1e-10));
      }
    }
  }
}

TEST_CASE("a host distinguishes obstacles that move from those that stand", "[control][movers]") {
  const scene::Scene scene = foreseen(scene::Prediction::path);
  const auto report = [&](int kinds, double influence_m) {
    Loop loop(
        scene, {},
        {{"kinds", kinds}, {"ahead_s", 0.25}, {"influence_m", influence_m}, {"radius_m", 5.0}});
    const auto series = loop.controller.tick(0.0, scene.start_q, loop.v).series;
    return std::vector<double>(series.begin(), series.end());
  };
  const model::Model arm = control::load_model(scene);
  const double still = distance_at(arm, scene.start_q, {-1.0, 0.0, 0.5}, 0.2);
  REQUIRE(still > 0.3);
  REQUIRE(still < 2.0);
  const auto none = report(0, 2.0), standing = report(HAMELIN_STANDING, 2.0),
             far = report(HAMELIN_STANDING, 0.2), moves = report(HAMELIN_MOVING, 0.2),
             all = report(HAMELIN_STANDING + HAMELIN_MOVING, 2.0);
  const auto count = [](const std::vector<double>& of) {
    return std::pair(of[listed], of[contacts] > 0.0);
  };
  CHECK(count(none) == std::pair(0.0, false));
  CHECK(count(standing) == std::pair(1.0, true));
  CHECK(standing[id] == 0.0);
  CHECK(standing[distance] == Approx(still));
  CHECK(count(far) == std::pair(1.0, false));  // what stands is known up to the influence only
  CHECK(count(moves) == std::pair(1.0, true));
  CHECK(moves[id] == 1.0);
  CHECK(all[listed] == 2.0);
  CHECK(all[contacts] == standing[contacts] + moves[contacts]);
  for (const auto& each : {none, standing, far, moves, all}) CHECK(each[moving] == 1.0);
}

TEST_CASE("obstacles count as moving while they rest on their way, and until they are removed",
          "[control][movers]") {
  scene::Scene scene = foreseen(scene::Prediction::constant_acceleration);
  scene.obstacles[1].motion = scene::LinearMotion{{0.1, 0.0, 0.0}, 5.0};  // it starts after 5 s
  Loop loop(scene, {}, {{"kinds", HAMELIN_MOVING}});
  const auto moving_at = [&](double time_s) {
    return loop.controller.tick(time_s, scene.start_q, loop.v).series[moving];
  };
  CHECK(moving_at(0.0) == 1.0);
  scene::Obstacle other = scene.obstacles[0];
  other.name = "other";
  loop.controller.world().set_obstacle(other);
  CHECK(moving_at(0.1) == 1.0);
  loop.controller.world().move_obstacle("other", other.pose, {0.0, 0.1, 0.0}, 0.1);
  CHECK(moving_at(0.2) == 2.0);
  loop.controller.world().remove_obstacle("swinging");
  CHECK(moving_at(0.3) == 1.0);
  loop.controller.world().remove_obstacle("other");
  CHECK(moving_at(0.4) == 0.0);
}

TEST_CASE("queries at a time ahead use what is known of the future", "[control][query][movers]") {
  constexpr double ahead_s = 0.8, influence_m = 3.0;
  std::map<scene::Prediction, std::vector<bool>> clear;
  for (const auto prediction : predictions) {
    CAPTURE(to_string(prediction));
    const scene::Scene scene = foreseen(prediction);
    Loop loop(scene, {}, {{"ahead_s", ahead_s}, {"influence_m", influence_m}});
    const double still = distance_at(loop.arm, scene.start_q, {-1.0, 0.0, 0.5}, 0.2);
    int certain = 0;
    for (int k = 0; k < 40; ++k) {
      const double now_s = 0.05 * k;
      CAPTURE(now_s);
      const auto report = loop.controller.tick(now_s, scene.start_q, loop.v).series;
      const auto swinging = [&](double ahead) {
        return distance_at(loop.arm, scene.start_q, foreseen_place(prediction, now_s, ahead),
                           sphere_radius_m) -
               foreseen_nearer(prediction, ahead);
      };
      const double nearest = std::min(still, swinging(ahead_s));
      REQUIRE(report[query_clearance] == Approx(nearest).margin(1e-10));
      REQUIRE(report[query_distance] == Approx(nearest).margin(1e-10));
      double least = still;
      for (int i = 0; i <= 80; ++i) least = std::min(least, swinging(ahead_s * i / 80.0));
      const bool is_proved = report[proved] == 1.0;
      clear[prediction].push_back(is_proved);
      if (is_proved) {
        REQUIRE(report[margin] > 0.0);
        REQUIRE(report[margin] <= least);
      }
      if (least > 0.05) {
        ++certain;
        REQUIRE(is_proved);
      }
    }
    if (prediction != scene::Prediction::speed_bound) CHECK(certain > 5);
  }
  // A bound of the speed alone proves least, and the others differ.
  CHECK(clear[scene::Prediction::path] != clear[scene::Prediction::constant_acceleration]);
  CHECK(clear[scene::Prediction::path] != clear[scene::Prediction::constant_velocity]);
  const auto count = [&](scene::Prediction of) {
    return std::count(clear[of].begin(), clear[of].end(), true);
  };
  CHECK(count(scene::Prediction::path) > count(scene::Prediction::speed_bound));
}
