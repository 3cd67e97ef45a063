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
        variant_(variant_named(params.at("variant"))),
        keep_attraction_(params.at("algorithm") == "keep_attraction"),
        gravity_compensation_(params.at("gravity_compensation").get<bool>()),
        tau_(setup.dof()) {
    if (rho_min_ > rho0_)
      throw hamelin::Error(hamelin::ErrorCode::invalid, "/distance_min_m: above rho0_m, expected at most rho0_m");
    if (arm_.model().planar()) plane_normal_ = arm_.model().root().R().col(2);
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
      const Vector3d along = velocity / velocity.stableNorm();  // its squares may be too small to be told from zero
      const Vector3d e = gain(c.distance_m, to_obstacle, along) * turning_axis(to_obstacle, along);
      const Matrix3d M_x = arm_.operational_inertia(link, point);
      if (variant_ == Variant::published) {
        arm_.add_force(link, point, M_x * e.cross(velocity), tau_);
      } else {
        // ½(M ê + ê M) is the cross product with ½(tr(M) 1 − M) e for any symmetric M.
        command.add_gyroscopic(link, arm_.in_link(link, point), 0.5 * (M_x.trace() * e - M_x * e));
      }
    });
    if (!turning || keep_attraction_)
      arm_.add_mapped_attraction(setup_.goal(tick.goal_index()), k_p_ * tick.speed_scale(), k_v_, tau_);
    if (gravity_compensation_) arm_.add_gravity(tau_);
    command.held_torque() = tau_;
  }

 private:
  /// How fast the velocity is turned [1/s]: |Γ|.
  /// @param to_obstacle, along  unit vectors to the obstacle and along the velocity, less than a right angle apart
  [[nodiscard]] double gain(double distance, const Vector3d& to_obstacle, const Vector3d& along) const {
    const double rho = std::max(distance, rho_min_), cosine = to_obstacle.dot(along);
    if (variant_ == Variant::chang_marsden) return k_obs_ / rho;
    if (variant_ == Variant::garimella) return k_obs_ * (1.0 / rho - 1.0 / rho0_) * cosine * cosine;
    const double angle = std::atan2(to_obstacle.cross(along).norm(), cosine);  // arccos of (20) loses digits near 0
    return k_obs_ * std::exp(angle - 1.0) / rho / (1.0 + std::exp(distance - rho0_));
  }

  /// ê, the unit vector along ρ × ẋ: the velocity turns about it, away from the obstacle.
  [[nodiscard]] Vector3d turning_axis(const Vector3d& to_obstacle, const Vector3d& along) const {
    const Vector3d turn = to_obstacle.cross(along);
    const double sine = turn.norm();
    return sine > 1e-9 ? Vector3d(turn / sine) : side(to_obstacle);
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
  Variant variant_;
  bool keep_attraction_, gravity_compensation_;
  Vector3d plane_normal_ = Vector3d::Zero();
  Eigen::VectorXd tau_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Gyro, "gyro", "0.1.0",
                       "Attraction (17) and gyroscopic avoidance: (19), (20), Chang-Marsden, Garimella", params_schema);
