#include "hamelin/reactive/glide.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::reactive {

namespace {

constexpr double glide_rate = 8.0;  // speed per distance from obstacles and joint limits [1/s]
constexpr int glide_passes = 12;    // of the filter
constexpr double touching_m = -0.002;

}  // namespace

Glide::Glide(const planning::Setup& setup, const model::Model& model, const PointMargins& margins,
             Surroundings& surroundings)
    : setup_(setup),
      model_(model),
      margins_(margins),
      surroundings_(surroundings),
      ws_(model),
      obstacles_(setup, radius_m),
      filter_(setup.dof(), Obstacles::max_points) {
  q_ = lower_ = upper_ = Eigen::VectorXd::Zero(setup.dof());
}

bool Glide::place(const Eigen::VectorXd& q, double ahead_s, double self_radius_m) {
  q_ = q;
  dynamics::forward_kinematics(model_, ws_, q_);
  surroundings_.query(q_, radius_m, self_radius_m, ahead_s);
  obstacles_.update(model_, ws_, surroundings_.contacts(), surroundings_.self_contacts());
  return obstacles_.clearance() >= touching_m;
}

double Glide::multiplier(std::size_t point) const {
  const int row = static_cast<int>(point);
  return row < filter_.row_count() ? filter_.row_multiplier(row) : 0.0;
}

void Glide::filter(double weight, const Eigen::MatrixXd& M, const Eigen::MatrixXd& W,
                   Eigen::VectorXd& u) {
  margins_.set(obstacles_.points(), weight);
  filter_.begin(M, W);
  for (const auto& point : obstacles_.points()) {
    const double x = point.distance - point.margin;
    (void)filter_.add_row(
        point.row, point.obstacle_speed - glide_rate * x,
        point.obstacle_speed - glide_rate * std::max(1e-9, point.distance - 0.5 * point.margin));
  }
  set_box(u);
  (void)filter_.project(u, glide_passes);
}

void Glide::set_box(Eigen::VectorXd& u) {
  lower_.setConstant(-std::numeric_limits<double>::infinity());
  upper_ = -lower_;
  if (const auto limit = setup_.velocity_max()) {
    double excess = 1.0;
    for (Eigen::Index k = 0; k < u.size(); ++k)
      excess = std::max(excess, std::abs(u[k]) / (*limit)[k]);
    u /= excess;
    lower_ = -*limit;
    upper_ = *limit;
  }
  if (const auto limit = setup_.q_lower())
    lower_ = lower_.cwiseMax(glide_rate * (*limit - q_).cwiseMin(0.0));
  if (const auto limit = setup_.q_upper())
    upper_ = upper_.cwiseMin(glide_rate * (*limit - q_).cwiseMax(0.0));
  filter_.set_box(lower_, upper_);
}

}  // namespace hamelin::reactive
