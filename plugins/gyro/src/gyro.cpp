#include <Eigen/Geometry>
#include <cmath>

#include "hamelin/planning/nominal_arm.hpp"
#include "params_schema.hpp"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace hamelin::planning;

class Gyro : public Planner {
 public:
  static double influence_m(const hamelin::Json& params) { return params.at("rho0_m").get<double>(); }

  Gyro(const Host&, const Setup& setup, const hamelin::Json& params)
      : setup_(setup),
        arm_(setup),
        k_p_(params.at("k_p").get<double>()),
        k_v_(params.at("k_v").get<double>()),
        k_obs_(params.at("k_obs").get<double>()),
        rho0_(params.at("rho0_m").get<double>()),
        rho_min_(params.at("distance_min_m").get<double>()),
        joint_damping_(params.at("joint_damping").get<double>()),
        keep_attraction_(params.at("algorithm") == "keep_attraction"),
        energy_neutral_(params.at("variant") == "energy-neutral"),
        gravity_compensation_(params.at("gravity_compensation").get<bool>()),
        tau_(setup.dof()) {
    if (const auto* plane = std::get_if<hamelin::model::PlanarChain>(&arm_.model().chain()))
      plane_normal_ = plane->root.R().col(2);
  }

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    command.damping().setConstant(joint_damping_);
    tau_.setZero();
    bool turning = false;
    for_each_nearest(tick.contacts(), setup_.spheres(), rho0_, [&](const hamelin_contact& c, int link) {
      const Vector3d point = vec3(c.arm_point_world_m), to_obstacle = -vec3(c.direction_world);
      const Vector3d velocity = arm_.point_velocity(link, point);
      if (!(to_obstacle.dot(velocity) > 0.0)) return;
      turning = true;
      const Vector3d e = rotation(c.distance_m, to_obstacle, velocity);
      const Matrix3d M_x = arm_.operational_inertia(link, point);
      if (energy_neutral_) {
        // ½(M ê + ê M) is the cross product with ½(tr(M) 1 − M) e for any symmetric M.
        command.add_gyroscopic(link, arm_.in_link(link, point), 0.5 * (M_x.trace() * e - M_x * e));
      } else {
        arm_.add_force(link, point, M_x * e.cross(velocity), tau_);
      }
    });
    if (!turning || keep_attraction_)
      arm_.add_mapped_attraction(setup_.goal(tick.goal_index()), k_p_ * tick.speed_scale(), k_v_, tau_);
    if (gravity_compensation_) arm_.add_gravity(tau_);
    command.held_torque() = tau_;
  }

 private:
  /// The vector of Γ in (20), its size included: Γ ẋ = e × ẋ.
  [[nodiscard]] Vector3d rotation(double distance, const Vector3d& to_obstacle, const Vector3d& velocity) const {
    const double speed = velocity.norm();
    const Vector3d turn = to_obstacle.cross(velocity);
    const double sine = turn.norm() / speed, cosine = to_obstacle.dot(velocity) / speed;
    const double angle = std::atan2(sine, cosine);  // arccos of (20), which loses its digits near 0
    const double size =
        k_obs_ * std::exp(angle - 1.0) / std::max(distance, rho_min_) / (1.0 + std::exp(distance - rho0_));
    return size * (sine > 1e-9 ? Vector3d(turn / (sine * speed)) : side(to_obstacle));
  }

  /// ê where ρ × ẋ vanishes, head-on: the plane's normal; in space the normal to ρ nearest to the world axis that is
  /// most across it (the first of equals).
  [[nodiscard]] Vector3d side(const Vector3d& to_obstacle) const {
    if (!plane_normal_.isZero()) return plane_normal_;
    Eigen::Index axis = 0;
    to_obstacle.cwiseAbs().minCoeff(&axis);
    const Vector3d unit = Vector3d::Unit(axis);
    return (unit - to_obstacle * to_obstacle.dot(unit)).normalized();
  }

  Setup setup_;
  NominalArm arm_;
  double k_p_, k_v_, k_obs_, rho0_, rho_min_, joint_damping_;
  bool keep_attraction_, energy_neutral_, gravity_compensation_;
  Vector3d plane_normal_ = Vector3d::Zero();
  Eigen::VectorXd tau_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Gyro, "gyro", "0.1.0", "Attraction (17) and gyroscopic avoidance (19), (20): Algorithm II",
                       params_schema);
