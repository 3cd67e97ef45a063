#include "sampler.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "hamelin/core/rng.hpp"

namespace hamelin::mppi {

namespace {

using Eigen::Index;
using Scalar = Eigen::Array<double, 1, 1>;

// The noise of samples 0, 1, 2, 3, 4, … as shares of Task::noise, again and again: wide samples
// find other ways, narrow ones refine the mean.
constexpr std::array noise_shares{1.0, 0.5, 0.25, 0.1};
// Half of the random samples are centred on the mean, the others on a motion along the path with
// random speed and distance of the carrot.
struct Following {
  double speed_share;  // of the speed limits
  double ahead;        // distance of the carrot [rad or m]
};
constexpr std::array<Following, 5> following_ways{
    {{1.0, 0.3}, {1.0, 0.1}, {0.6, 0.1}, {0.3, 0.05}, {0.12, 0.03}}};
constexpr Following slowest{0.2, 0.02}, fastest{1.0, 0.4};

// Numbers of different plans and samples are independent: the seed of a generator is a mix of all.
std::uint64_t mix(std::uint64_t a, std::uint64_t b) {
  return Rng(a ^ (b * 0xd1342543de82ef95ULL)).next();
}

double limited(const StepLimits& limits, Index j, double desired, double position, double previous,
               double steps_left) {
  return limits.limit<Scalar>(j, Scalar(desired), Scalar(position), Scalar(previous),
                              steps_left)[0];
}

// Steps after point i that may differ from zero: the last two steps are zero.
double steps_after(Index i, Index count) {
  return static_cast<double>(count - 3 - i);
}

}  // namespace

Sampler::Sampler(Index dof, Index point_count)
    : basis_(point_count, coefficient_count),
      noise_(lane_count, dof * coefficient_count),
      points_(Eigen::MatrixXd::Zero(dof, point_count)),
      carrot_(Eigen::VectorXd::Zero(dof)),
      step_(carrot_) {
  basis_.setZero();
  const Index segments = coefficient_count - 3;
  for (Index i = 0; i < point_count; ++i) {
    const double x = static_cast<double>(segments) * static_cast<double>(i) /
                     static_cast<double>(point_count - 1);
    const Index segment = std::min(static_cast<Index>(x), segments - 1);
    const double u = x - static_cast<double>(segment), w = 1.0 - u;
    basis_.row(i).segment<4>(segment) << w * w * w, 4.0 - 6.0 * u * u + 3.0 * u * u * u,
        4.0 - 6.0 * w * w + 3.0 * w * w * w, u * u * u;
  }
  basis_ /= 6.0;
}

void Sampler::sample(const Task& task, std::size_t block, Rollouts& out) {
  const Index dof = task.mean.rows(), n = task.mean.cols();
  const std::uint64_t stream = mix(mix(task.seed, task.plan), block);
  for (Index lane = 0; lane < lane_count; ++lane) {
    Rng rng(mix(stream, static_cast<std::uint64_t>(lane)));
    const double sigma =
        task.noise * noise_shares[static_cast<std::size_t>(lane) % noise_shares.size()];
    for (Index k = 0; k < noise_.cols(); ++k) noise_(lane, k) = sigma * rng.normal();
    if (lane < lane_count / 2) {
      out.set_lane(lane, task.mean);
      continue;
    }
    const double ahead = slowest.ahead * std::pow(fastest.ahead / slowest.ahead, rng.uniform());
    follow(task, rng.uniform(slowest.speed_share, fastest.speed_share), ahead);
    out.set_lane(lane, points_);
  }
  for (Index j = 0; j < dof; ++j) {
    for (Index i = 3; i + 2 < n; ++i) {
      const Lanes position = out.point(j, i - 1), previous = position - out.point(j, i - 2);
      Lanes desired = out.point(j, i) - position;
      for (Index k = 0; k < coefficient_count; ++k)
        desired += basis_(i, k) * noise_.col(j * coefficient_count + k);
      out.point(j, i) =
          position + task.limits.limit(j, desired, position, previous, steps_after(i, n));
    }
    out.point(j, n - 2) = out.point(j, n - 1) = out.point(j, n - 3);
  }
}

void Sampler::approach(const StepLimits& limits, const Eigen::MatrixXd& desired,
                       Eigen::MatrixXd& points) {
  const Index n = points.cols();
  for (Index i = 3; i < n; ++i)
    for (Index j = 0; j < points.rows(); ++j) {
      const double position = points(j, i - 1), previous = position - points(j, i - 2);
      points(j, i) = i + 2 < n ? position + limited(limits, j, desired(j, i) - position, position,
                                                    previous, steps_after(i, n))
                               : position;
    }
}

void Sampler::brake(const StepLimits& limits, Eigen::MatrixXd& points) {
  const Index n = points.cols();
  for (Index i = 3; i < n; ++i)
    for (Index j = 0; j < points.rows(); ++j) {
      const double position = points(j, i - 1), previous = position - points(j, i - 2);
      points(j, i) = i + 2 < n
                         ? position + limited(limits, j, 0.0, position, previous, steps_after(i, n))
                         : position;
    }
}

void Sampler::propose(const Task& task, Rollouts& out) {
  points_.leftCols<3>() = task.mean.leftCols<3>();
  approach(task.limits, task.mean, points_);
  out.set_lane(proposal_mean, points_);
  approach(task.limits, task.best, points_);
  out.set_lane(proposal_best, points_);
  brake(task.limits, points_);
  out.set_lane(proposal_brake, points_);
  for (std::size_t k = 0; k < following_ways.size(); ++k) {
    follow(task, following_ways[k].speed_share, following_ways[k].ahead);
    out.set_lane(proposal_follow + static_cast<Index>(k), points_);
  }
}

// docs/theory.md (15.5)
void Sampler::follow(const Task& task, double speed_share, double ahead) {
  const auto& limits = task.limits;
  const Index dof = points_.rows(), n = points_.cols();
  points_.leftCols<3>() = task.mean.leftCols<3>();
  double s = task.path_from;
  for (Index i = 3; i < n; ++i) {
    const auto position = points_.col(i - 1);
    s = task.path.carrot(s, position, ahead, carrot_);
    step_ = carrot_ - position;
    const double distance = step_.norm();
    double length = distance, brake = limits.change.maxCoeff();
    for (Index j = 0; j < dof; ++j) {
      if (step_[j] == 0.0) continue;
      const double per_length = std::abs(step_[j]) / distance;
      length = std::min(length, speed_share * limits.speed[j] / per_length);
      brake = std::min(brake, limits.change[j] / per_length);
    }
    length = std::min(length, length_before_turns(task.path, s, distance, ahead, brake));
    const double share = distance > 0.0 ? length / distance : 0.0;
    for (Index j = 0; j < dof; ++j)
      points_(j, i) =
          i + 2 < n ? position[j] + limited(limits, j, share * step_[j], position[j],
                                            position[j] - points_(j, i - 2), steps_after(i, n))
                    : position[j];
  }
}

double Sampler::length_before_turns(const planning::JointPath& path, double s, double distance,
                                    double ahead, double brake) {
  const double left = path.length() - s + distance;
  double length = braking_step<Scalar>(Scalar(left), brake)[0];
  for (Index k = 1; k + 1 < path.size(); ++k) {
    const double before = path.arc(k) - s + distance;
    if (before < 0.0) continue;
    const double turn = path.turn(k);
    if (turn == 0.0) continue;
    const double turning = brake * ahead / turn;
    length = std::min(length, std::sqrt(turning + 2.0 * brake * std::max(0.0, before - ahead)));
  }
  return length;
}

}  // namespace hamelin::mppi
