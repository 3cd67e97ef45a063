#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/reactive/point_margins.hpp"
#include "hamelin/reactive/surroundings.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/test/arm_loop.hpp"

/// An arm among balls and moving obstacles, queried through the C interface as a planner queries
/// its host, with distances from the balls in closed form.
namespace hamelin::test {

/// Four links of 0.25 m along x that turn about z, with five spheres each.
inline model::Robot short_planar4() {
  constexpr double length = 0.25;
  model::Robot robot;
  robot.name = "short_planar4";
  for (int i = 0; i < 4; ++i) {
    model::Link link;
    link.name = fmt::format("link{}", i + 1);
    link.parent = i - 1;
    link.joint.name = fmt::format("j{}", i + 1);
    link.joint.screw << 0.0, 0.0, 1.0, 0.0, -length * i, 0.0;
    link.com =
        geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{length * (i + 0.5), 0.0, 0.0}};
    link.mass_kg = 1.0;
    link.inertia_kg_m2 = 0.01 * Eigen::Matrix3d::Identity();
    for (int k = 0; k < 5; ++k)
      link.spheres.push_back({Eigen::Vector3d{length * (0.2 * k - 0.4), 0.0, 0.0}, 0.025});
    robot.links.push_back(link);
  }
  robot.tip = {"tip", 3,
               geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{4.0 * length, 0.0, 0.0}}};
  return robot;
}

/// The parameters of a ReactiveScene.
struct Task {
  std::vector<Ball> balls{};  ///< stand still
  std::vector<scene::Obstacle> movers{};
  hamelin_goal goal{};
  Eigen::VectorXd q_goal{};
  Eigen::MatrixXd path{};
  model::Robot robot = short_planar4();
  bool self_collision = false;
  std::uint64_t seed = 1;
  double joint_limit = 0.0;  ///< ± limit of every joint; none if zero
};

inline Task joint_task(const Eigen::VectorXd& q, std::vector<Ball> balls = {}) {
  Task task;
  task.balls = std::move(balls);
  task.goal.type = HAMELIN_GOAL_JOINT;
  task.goal.tolerance_rad = 0.02;
  task.q_goal = q;
  return task;
}

inline Task tip_task(const Eigen::Vector3d& p, std::vector<Ball> balls = {}) {
  Task task;
  task.balls = std::move(balls);
  task.goal.type = HAMELIN_GOAL_POSITION;
  std::copy_n(p.data(), 3, task.goal.position_world_m);
  task.goal.tolerance_m = 0.01;
  return task;
}

/// The default parameters of the planner.
inline constexpr reactive::LawParams law_params{4.0, 3.0, 2.0, 0.5, 1.5, 0.02, 0.15};
inline constexpr reactive::MarginParams margin_params{0.01, 0.003, 0.003, 0.005};
inline constexpr double contact_radius = 0.15;

/// The parts of a reactive planner with the host that they query.
class ReactiveScene {
 public:
  explicit ReactiveScene(const Task& task)
      : model(task.robot, geometry::SE3{}, Eigen::Vector3d::Zero()),
        balls_(task.balls),
        movers_(task.movers),
        ws_(model),
        q_(Eigen::VectorXd::Zero(model.dof())),
        data_(fill(task, model)),
        raw_setup_(data_.view()),
        raw_host_(host()),
        setup(raw_setup_),
        surroundings(planning::Host(raw_host_), setup),
        margins(setup, margin_params) {
    margins.set_goal(surroundings, goal(), contact_radius);
  }
  ReactiveScene(const ReactiveScene&) = delete;
  ReactiveScene& operator=(const ReactiveScene&) = delete;

  [[nodiscard]] const hamelin_goal& goal() const { return setup.goals().front(); }
  /// World centre of a control sphere at q.
  Eigen::Vector3d center(const Eigen::VectorXd& q, std::size_t sphere) {
    dynamics::forward_kinematics(model, ws_, q);
    return placed(sphere);
  }
  Eigen::Vector3d tip(const Eigen::VectorXd& q) {
    dynamics::forward_kinematics(model, ws_, q);
    return dynamics::tip_pose(model, ws_).p();
  }
  /// The smallest distance to a ball at q.
  double clearance(const Eigen::VectorXd& q) {
    dynamics::forward_kinematics(model, ws_, q);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < data_.shapes.size(); ++s)
      for (const auto& ball : balls_)
        least = std::min(least,
                         (placed(s) - ball.center).norm() - data_.shapes[s].radius_m - ball.radius);
    return least;
  }
  /// The number of queries to the host.
  [[nodiscard]] long queries() const { return queries_; }

  /// The host, for the parts that query it themselves. Valid as long as the scene.
  [[nodiscard]] planning::Host planner_host() const { return planning::Host(raw_host_); }
  /// The time from which moving obstacles are predicted [s].
  void set_time(double time_s) { time_s_ = time_s; }
  /// The ids of moving obstacles: balls have the smaller ones.
  [[nodiscard]] std::int32_t mover_id(std::size_t mover) const {
    return static_cast<std::int32_t>(balls_.size() + mover);
  }
  /// The smallest distance to a moving obstacle at q, where they are predicted to be, by brute
  /// force over all shapes, which are spheres.
  double mover_clearance(const Eigen::VectorXd& q, double ahead_s) {
    dynamics::forward_kinematics(model, ws_, q);
    double least = std::numeric_limits<double>::infinity();
    for (const auto& mover : movers_) {
      const auto at = scene::placed_at(mover, {time_s_, ahead_s});
      for (std::size_t s = 0; s < data_.shapes.size(); ++s)
        least = std::min(least, scene::closest_on(mover, at.pose, placed(s)).distance -
                                    data_.shapes[s].radius_m - at.nearer_m);
    }
    return least;
  }

  const model::Model model;

 private:
  static planning::SetupData fill(const Task& task, const model::Model& model) {
    planning::SetupData data(model);
    data.seed = task.seed;
    data.self_collision = task.self_collision;
    data.control_period_s = 0.004;
    data.influence_m = contact_radius;
    if (task.joint_limit > 0.0) {
      data.q_upper = Eigen::VectorXd::Constant(model.dof(), task.joint_limit);
      data.q_lower = -data.q_upper;
    }
    data.add_goal(task.goal, task.q_goal, task.path);
    return data;
  }
  [[nodiscard]] Eigen::Vector3d placed(std::size_t s) const {
    const auto& sphere = data_.shapes[s];
    return dynamics::point_position(model, ws_, sphere.link, planning::vec3(sphere.center_link_m));
  }

  hamelin_host host() {
    hamelin_host out{};
    // Without moving obstacles it is a host of the time before there were any.
    out.struct_size = movers_.empty() ? offsetof(hamelin_host, closest_ahead) : sizeof out;
    out.context = this;
    out.log = &log;
    out.closest_points = &closest_points;
    out.closest_self = &closest_self;
    out.closest_ahead = &closest_ahead;
    out.obstacles_ahead = &obstacles_ahead;
    return out;
  }
  static void log(void*, std::int32_t, const char*, std::size_t) {}
  void place(const double* q) {
    q_ = planning::ConstVectorMap(q, model.dof());
    dynamics::forward_kinematics(model, ws_, q_);
  }
  static std::size_t closest_points(void* context, const double* q, double influence,
                                    hamelin_contact* out, std::size_t capacity, std::size_t) {
    auto& self = *static_cast<ReactiveScene*>(context);
    ++self.queries_;
    self.place(q);
    std::size_t count = 0;
    for (std::size_t s = 0; s < self.data_.shapes.size(); ++s) {
      const Eigen::Vector3d at = self.placed(s);
      const double radius = self.data_.shapes[s].radius_m;
      for (std::size_t b = 0; b < self.balls_.size(); ++b) {
        const auto& ball = self.balls_[b];
        const Eigen::Vector3d offset = at - ball.center, n = offset.normalized();
        const double distance = offset.norm() - radius - ball.radius;
        if (distance > influence || count++ >= capacity) continue;
        hamelin_contact& contact = out[count - 1];
        contact = {};
        contact.shape = static_cast<std::int32_t>(s);
        contact.obstacle = static_cast<std::int32_t>(b);
        contact.distance_m = distance;
        planning::VectorMap(contact.arm_point_world_m, 3) = at - radius * n;
        planning::VectorMap(contact.obstacle_point_world_m, 3) = ball.center + ball.radius * n;
        planning::VectorMap(contact.direction_world, 3) = n;
      }
    }
    return count;
  }
  // Queries of what moves go through obstacles_ahead().
  static std::size_t closest_ahead(void* context, const double* q, double, std::int32_t kinds,
                                   double influence, hamelin_contact* out, std::size_t capacity,
                                   std::size_t stride) {
    if (kinds != HAMELIN_STANDING) return 0;
    return closest_points(context, q, influence, out, capacity, stride);
  }
  static std::size_t obstacles_ahead(void* context, double ahead_s, std::int32_t kinds,
                                     hamelin_obstacle_state* out, std::size_t capacity,
                                     std::size_t) {
    const auto& self = *static_cast<ReactiveScene*>(context);
    if (kinds != HAMELIN_MOVING) return 0;
    for (std::size_t m = 0; m < std::min(capacity, self.movers_.size()); ++m) {
      const scene::Obstacle& mover = self.movers_[m];
      const auto at = scene::placed_at(mover, {self.time_s_, ahead_s});
      hamelin_obstacle_state state{};
      state.id = self.mover_id(m);
      state.shape = static_cast<std::int32_t>(mover.shape);
      state.name = mover.name.c_str();
      state.radius_m = mover.radius_m;
      state.length_m = mover.length_m;
      std::copy_n(mover.size_m.data(), 3, state.size_m);
      std::copy_n(at.pose.p().data(), 3, state.position_world_m);
      const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(at.pose.R());
      std::copy_n(wxyz.data(), 4, state.quaternion_wxyz);
      state.moves = 1;
      state.nearer_m = at.nearer_m;
      out[m] = state;
    }
    return self.movers_.size();
  }
  // Finds the nearest pair of spheres for each two links that share no joint.
  static std::size_t closest_self(void* context, const double* q, double influence,
                                  hamelin_self_contact* out, std::size_t capacity, std::size_t) {
    auto& self = *static_cast<ReactiveScene*>(context);
    const auto& spheres = self.data_.shapes;
    self.place(q);
    std::size_t count = 0;
    for (int b = 0; b < self.model.dof(); ++b)
      for (int a = b + 2; a < self.model.dof(); ++a) {
        hamelin_self_contact nearest{};
        nearest.distance_m = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < spheres.size(); ++i)
          for (std::size_t j = 0; j < spheres.size(); ++j) {
            if (spheres[i].link != a || spheres[j].link != b) continue;
            const Eigen::Vector3d at = self.placed(i), from = self.placed(j),
                                  n = (at - from).normalized();
            const double distance = (at - from).norm() - spheres[i].radius_m - spheres[j].radius_m;
            if (distance >= nearest.distance_m) continue;
            nearest.shape_a = static_cast<std::int32_t>(i);
            nearest.shape_b = static_cast<std::int32_t>(j);
            nearest.distance_m = distance;
            planning::VectorMap(nearest.point_a_world_m, 3) = at - spheres[i].radius_m * n;
            planning::VectorMap(nearest.point_b_world_m, 3) = from + spheres[j].radius_m * n;
            planning::VectorMap(nearest.direction_world, 3) = n;
          }
        if (nearest.distance_m > influence || count++ >= capacity) continue;
        out[count - 1] = nearest;
      }
    return count;
  }

  std::vector<Ball> balls_;
  std::vector<scene::Obstacle> movers_;
  double time_s_ = 0.0;
  dynamics::Workspace ws_;
  Eigen::VectorXd q_;
  planning::SetupData data_;
  hamelin_setup raw_setup_;
  hamelin_host raw_host_;
  long queries_ = 0;

 public:
  const planning::Setup setup;
  reactive::Surroundings surroundings;
  reactive::PointMargins margins;
};

/// A ball that is at a place at time 0 and keeps its velocity.
inline scene::Obstacle moving_ball(const Eigen::Vector3d& at, double radius,
                                   const Eigen::Vector3d& velocity) {
  scene::Obstacle ball;
  ball.radius_m = radius;
  ball.pose = {Eigen::Matrix3d::Identity(), at};
  ball.motion =
      scene::ObservedMotion{0.0, velocity, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  return ball;
}

/// A ball in front of the arm, which must fold to get from one side to the other.
inline const std::vector<Ball> ball_between{{{0.75, 0.0, 0.0}, 0.1}};
inline Eigen::VectorXd below_ball() {
  return Eigen::Vector4d(-0.9, 0.0, 0.0, 0.0);
}
inline Eigen::VectorXd above_ball() {
  return Eigen::Vector4d(0.9, 0.0, 0.0, 0.0);
}

}  // namespace hamelin::test
