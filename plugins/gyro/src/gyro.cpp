#include <Eigen/Geometry>
#include <cmath>

#include "hamelin/planning/nominal_arm.hpp"
#include "params_schema.hpp"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace hamelin::planning;

enum class Variant { published, energy_neutral, chang_marsden, garimella };

Variant variant_named(const std::string& name) {
  if (name == "published") return Variant::published;
  if (name == "energy-neutral") return Variant::energy_neutral;
  return name == "chang-marsden" ? Variant::chang_marsden : Variant::garimella;
}

class Gyro : public Planner {
 public:
  static double influence_m(const hamelin::Json& params) {
    return params.at("rho0_m").get<double>();
  }

  Gyro(const Host&, const Setup& setup, const hamelin::Json& params)
      : setup_(setup),
        arm_(setup),
        k_p_(params.at("k_p").get<double>()),
        k_v_(params.at("k_v").get<double>()),
        k_obs_(params.at("k_obs").get<double>()),
        rho0_(params.at("rho0_m").get<double>()),
        rho_min_(params.at("distance_min_m").get<double>()),
        joint_damping_(params.at("joint_damping").get<double>()),
        variant_(variant_named(params.at("variant"))),
        keep_attraction_(params.at("algorithm") == "keep_attraction"),
        gravity_compensation_(params.at("gravity_compensation").get<bool>()),
        tau_(setup.dof()) {
    if (rho_min_ > rho0_)
      throw hamelin::Error(hamelin::ErrorCode::invalid,
                           "/distance_min_m: above rho0_m, expected at most rho0_m");
    if (arm_.model().planar()) plane_normal_ = arm_.model().root().R().col(2);
  }

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    command.damping().setConstant(joint_damping_);
    tau_.setZero();
    bool steering = false;
    for_each_nearest(
        tick.contacts(), setup_.shapes(), rho0_, [&](const hamelin_contact& c, int link) {
          const Vector3d point = vec3(c.arm_point_world_m), to_obstacle = -vec3(c.direction_world);
          const Vector3d velocity = arm_.point_velocity(link, point);
          if (!(to_obstacle.dot(velocity) > 0.0)) return;
          steering = true;
          const Vector3d heading = velocity / velocity.stableNorm();  // the squares may underflow
          const Vector3d e =
              gain(c.distance_m, to_obstacle, heading) * turning_axis(to_obstacle, heading);
          const Matrix3d M_x = arm_.operational_inertia(link, point);
          if (variant_ == Variant::published) {  // docs/theory.md (9.12)
            arm_.add_force(link, point, M_x * e.cross(velocity), tau_);
          } else {
            // The skew part of M_x Γ is the cross product with w = ½ (tr(M_x) 1 − M_x) e, Γ that
            // with e: docs/theory.md (9.14), (9.15).
            command.add_gyroscopic(link, arm_.in_link(link, point),
                                   0.5 * (M_x.trace() * e - M_x * e));
          }
        });
    if (!steering || keep_attraction_)  // Algorithm II of Shen, Wang, Shi (2021)
      arm_.add_mapped_attraction(tick.goal(), k_p_ * tick.speed_scale(), k_v_, tau_);
    if (gravity_compensation_) arm_.add_gravity(tau_);
    command.held_torque() = tau_;
  }

 private:
  /// The rate γ at which the velocity is turned [1/s]: docs/theory.md (9.11), (9.17), (9.18).
  /// @param distance from the obstacle [m]
  /// @param to_obstacle, heading unit vectors to the obstacle and of the velocity, less than a
  ///   right angle apart
  [[nodiscard]] double gain(double distance, const Vector3d& to_obstacle,
                            const Vector3d& heading) const {
    const double rho = std::max(distance, rho_min_), cosine = to_obstacle.dot(heading);
    if (variant_ == Variant::chang_marsden) return k_obs_ / rho;
    if (variant_ == Variant::garimella) return k_obs_ * (1.0 / rho - 1.0 / rho0_) * cosine * cosine;
    // The arccosine, as printed in the paper, would lose digits near zero.
    const double angle = std::atan2(to_obstacle.cross(heading).norm(), cosine);
    return k_obs_ * std::exp(angle - 1.0) / rho / (1.0 + std::exp(distance - rho0_));
  }

  /// The unit axis about which the velocity turns away from the obstacle: docs/theory.md (9.10).
  [[nodiscard]] Vector3d turning_axis(const Vector3d& to_obstacle, const Vector3d& heading) const {
    const Vector3d turn = to_obstacle.cross(heading);
    const double sine = turn.norm();
    return sine > 1e-9 ? Vector3d(turn / sine) : head_on_axis(to_obstacle);
  }

  /// The axis for head-on motion, where docs/theory.md (9.10) is 0/0: the plane's normal for planar
  /// arms; in space the normal of to_obstacle that is nearest to the world axis with the smallest
  /// component along it, the first of equal ones.
  [[nodiscard]] Vector3d head_on_axis(const Vector3d& to_obstacle) const {
    if (!plane_normal_.isZero()) return plane_normal_;
    Eigen::Index axis = 0;
    to_obstacle.cwiseAbs().minCoeff(&axis);
    const Vector3d unit = Vector3d::Unit(axis);
    return (unit - to_obstacle * to_obstacle.dot(unit)).normalized();
  }

  Setup setup_;
  NominalArm arm_;
  double k_p_, k_v_, k_obs_, rho0_, rho_min_, joint_damping_;
  Variant variant_;
  bool keep_attraction_, gravity_compensation_;
  Vector3d plane_normal_ = Vector3d::Zero();
  Eigen::VectorXd tau_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Gyro, "gyro", "0.1.0",
                       "The goal attracts, gyroscopic forces turn the motion away from obstacles",
                       params_schema);
