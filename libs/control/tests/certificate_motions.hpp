#pragma once
#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <octomap/OcTree.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/control/certificate.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/scene/make.hpp"

/// Random motions of an arm, checked twice: by the certificate, and by dense sampling with FCL,
/// which shares no code with hamelin and reads the map through OctoMap.
namespace hamelin::test {

using Eigen::Vector3d;
using Eigen::VectorXd;

/// An arm and a map for both libraries.
struct ArmInMap {
  std::string name;
  model::Model model;
  scene::MapSpec map;
};

struct MotionCounts {
  long motions = 0, certified = 0, contacts = 0;
  long free_uncertified = 0;      ///< free by sampling, but not certified
  long straight_uncertified = 0;  ///< of these, motions with constant velocity
  long contradictions = 0;        ///< certified, but in contact by sampling
  long reported = 0;              ///< in contact by the certificate
  double least_margin_m = 1.0;    ///< of the certified motions
};

class MotionJudge {
 public:
  /// FCL gets box corners in single precision, and its iterations stop at about 1e-6: shapes are
  /// smaller by this.
  static constexpr double shrunk_m = 5e-6;
  static constexpr int samples = 240;
  static constexpr double limit_m = 0.25, self_limit_m = 0.1, step_s = 0.001;

  MotionJudge(ArmInMap arm, std::uint64_t seed)
      : setup_(std::move(arm)),
        rng_(seed),
        ws_(setup_.model),
        arm_(setup_.model),
        next_(setup_.model),
        self_(setup_.model),
        tree_(std::make_shared<octomap::OcTree>(setup_.map.file.string())),
        octree_(std::make_shared<fcl::OcTreed>(tree_)) {
    const double reach = setup_.model.reach();
    for (auto leaf = tree_->begin_leafs(), end = tree_->end_leafs(); leaf != end; ++leaf) {
      if (!tree_->isNodeOccupied(*leaf)) continue;
      const Vector3d half = Vector3d::Constant(0.5 * leaf.getSize()),
                     c{leaf.getX(), leaf.getY(), leaf.getZ()};
      if ((setup_.map.pose * c - setup_.model.base().p()).norm() < reach + limit_m + half.norm())
        leaves_.push_back({c - half, c + half});
    }
    for (const auto& shape : setup_.model.shapes()) {
      if (shape.is_capsule)
        bodies_.push_back(
            std::make_shared<fcl::Capsuled>(shape.radius - shrunk_m, 2.0 * shape.half_axis.norm()));
      else
        bodies_.push_back(std::make_shared<fcl::Sphered>(shape.radius - shrunk_m));
    }
    // a ball that oscillates, and one that appears during a step
    moving_.name = "moving";
    moving_.radius_m = 0.12 * reach;
    moving_.motion = scene::SineMotion{reach * Vector3d(0.3, 0.2, -0.1), 0.8};
    sudden_ = moving_;
    sudden_.name = "sudden";
    sudden_.motion.reset();
  }

  void run(int motions, MotionCounts& counts) {
    // many motions in one environment, so that the map is not read for each
    constexpr int motions_per_set_up = 50, set_ups_max = 1000;
    for (int set_up = 0; counts.motions < motions && set_up < set_ups_max; ++set_up) {
      std::vector<scene::Obstacle> obstacles;
      if (set_up % 2 == 1) {
        moving_.pose = {Eigen::Matrix3d::Identity(), random_place()};
        sudden_.pose = {Eigen::Matrix3d::Identity(), random_place()};
        sudden_.appears_s = start_s_ + rng_.uniform(0.0, step_s);
        obstacles = {moving_, sudden_};
      }
      const scene::Environment environment(setup_.map, obstacles, setup_.model.base(),
                                           setup_.model.reach(), limit_m);
      control::Certificate certificate(setup_.model, limit_m, &self_, self_limit_m,
                                       obstacles.size());
      for (int i = 0; i < motions_per_set_up && counts.motions < motions; ++i)
        if (!motion(environment, certificate, counts)) break;
    }
  }

 private:
  Vector3d random_place() {
    const double reach = setup_.model.reach(), height = setup_.model.planar() ? 0.1 : 0.7;
    const Vector3d off{rng_.uniform(-0.7, 0.7), rng_.uniform(-0.7, 0.7),
                       rng_.uniform(-0.1, height)};
    return setup_.model.base() * (reach * off);
  }

  VectorXd random_posture() {
    VectorXd q(setup_.model.dof());
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const auto& joint = setup_.model.robot().links[static_cast<std::size_t>(j)].joint;
      q[j] = rng_.uniform(joint.lower.value_or(-2.5), joint.upper.value_or(2.5));
    }
    return q;
  }

  void place(const VectorXd& q, scene::PlacedShapes& arm) {
    dynamics::forward_kinematics(setup_.model, ws_, q);
    arm.place(setup_.model, ws_);
  }

  void measure(const scene::Environment& environment, const scene::PlacedShapes& arm, double time_s,
               std::vector<double>& clearance, std::vector<double>& pairs) const {
    clearance.clear();
    pairs.clear();
    for (std::size_t s = 0; s < arm.view().size(); ++s)
      clearance.push_back(environment.clearance(arm.view().single(s), time_s, limit_m));
    for (std::size_t k = 0; k < self_.pairs().size(); ++k)
      pairs.push_back(self_.distance(k, arm.view(), self_limit_m));
  }

  static double least(const std::vector<double>& x) {
    return x.empty() ? 1.0 : *std::min_element(x.begin(), x.end());
  }

  /// False if no start was found: a ball may overlap the arm's base.
  bool motion(const scene::Environment& environment, control::Certificate& certificate,
              MotionCounts& counts) {
    // displacements of 1e-3 to 5e-2 per joint; in every other motion the velocity changes by up to
    // a quarter
    const bool straight = counts.motions % 2 == 0;
    const double size = std::exp(rng_.uniform(std::log(1e-3), std::log(5e-2)));
    VectorXd q, dq(setup_.model.dof()), dv(setup_.model.dof());
    std::vector<double> clearance, pairs, clearance_next, pairs_next;
    // most of them start near an obstacle or another part
    const bool near = rng_.uniform() < 0.8;
    constexpr int tries_max = 4000;
    for (int tries = 0; tries < tries_max; ++tries) {
      q = random_posture();
      place(q, arm_);
      measure(environment, arm_, start_s_, clearance, pairs);
      const double room = std::min(least(clearance), least(pairs));
      if (room > 0.0 && (!near || room < 0.3 * size)) break;
      if (tries == tries_max - 1) return false;
    }
    for (Eigen::Index j = 0; j < dq.size(); ++j) {
      dq[j] = size * rng_.uniform(-1.0, 1.0);
      dv[j] = straight ? 0.0 : 0.25 * size / step_s * rng_.uniform(-1.0, 1.0);
    }
    const VectorXd q_next = q + dq, v = dq / step_s - 0.5 * dv, v_next = dq / step_s + 0.5 * dv;
    place(q_next, next_);
    measure(environment, next_, start_s_ + step_s, clearance_next, pairs_next);
    const auto verdict = certificate.check(
        ws_, environment, {q, v, start_s_, arm_.view(), clearance, pairs},
        {q_next, v_next, start_s_ + step_s, next_.view(), clearance_next, pairs_next});

    const bool contact = sampled_contact(environment.obstacles(), q, dq, dv);
    ++counts.motions;
    counts.certified += verdict.certified ? 1 : 0;
    counts.contacts += contact ? 1 : 0;
    counts.reported += verdict.contact ? 1 : 0;
    counts.contradictions += verdict.certified && contact ? 1 : 0;
    if (verdict.certified)
      counts.least_margin_m = std::min(counts.least_margin_m, verdict.margin_m);
    if (!contact && !verdict.certified) {
      ++counts.free_uncertified;
      counts.straight_uncertified += straight ? 1 : 0;
    }
    return true;
  }

  fcl::Transform3d place_of(const scene::Shapes& arm, std::size_t s) const {
    fcl::Transform3d at = fcl::Transform3d::Identity();
    at.translation() = arm.centers[s];
    if (arm.is_capsule(s))
      at.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), arm.half_axes[s])
                        .toRotationMatrix();
    return at;
  }

  static bool collide(const fcl::CollisionGeometryd* a, const fcl::Transform3d& at_a,
                      const fcl::CollisionGeometryd* b, const fcl::Transform3d& at_b) {
    const fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    return fcl::collide(a, at_a, b, at_b, request, result) > 0;
  }

  double to_leaves(const Vector3d& p) const {
    const Vector3d local = setup_.map.pose.inverse() * p;
    double best = std::numeric_limits<double>::infinity();
    for (const auto& leaf : leaves_)
      best =
          std::min(best, (leaf.lo - local).cwiseMax(local - leaf.hi).cwiseMax(0.0).squaredNorm());
    return std::sqrt(best);
  }

  /// Whether FCL finds contact along a motion of constant acceleration. Shapes are left out if
  /// their distance from all leaves excludes contact.
  bool sampled_contact(const std::vector<scene::Obstacle>& obstacles, const VectorXd& q,
                       const VectorXd& dq, const VectorXd& dv) {
    const double farthest =
        2.0 * setup_.model.reach() * (dq.cwiseAbs().sum() + 0.125 * step_s * dv.cwiseAbs().sum());
    std::vector<std::size_t> near_map;
    place(q, arm_);
    for (std::size_t s = 0; s < arm_.view().size(); ++s) {
      const double around = arm_.view().radii[s] +
                            (arm_.view().is_capsule(s) ? arm_.view().half_axes[s].norm() : 0.0);
      if (to_leaves(arm_.view().centers[s]) - around <= farthest) near_map.push_back(s);
    }
    fcl::Transform3d map_at = fcl::Transform3d::Identity();
    map_at.linear() = setup_.map.pose.R();
    map_at.translation() = setup_.map.pose.p();
    for (int i = 0; i <= samples; ++i) {
      const double u = static_cast<double>(i) / samples, time_s = start_s_ + u * step_s;
      place(q + u * dq + 0.5 * (u * u - u) * step_s * dv, arm_);
      const scene::Shapes arm = arm_.view();
      for (const std::size_t s : near_map)
        if (collide(octree_.get(), map_at, bodies_[s].get(), place_of(arm, s))) return true;
      for (const auto& obstacle : obstacles) {
        if (time_s < obstacle.appears_s) continue;
        Vector3d center = obstacle.pose.p();
        if (obstacle.motion) {
          const auto& sine = std::get<scene::SineMotion>(*obstacle.motion);
          center += std::sin(2.0 * M_PI * time_s / sine.period_s) * sine.amplitude_m;
        }
        fcl::Transform3d at = fcl::Transform3d::Identity();
        at.translation() = center;
        const fcl::Sphered ball(obstacle.radius_m);
        for (std::size_t s = 0; s < arm.size(); ++s)
          if ((arm.centers[s] - center).norm() < 0.6 &&
              collide(&ball, at, bodies_[s].get(), place_of(arm, s)))
            return true;
      }
      for (const auto& pair : self_.pairs())
        for (const int a : self_.parts()[static_cast<std::size_t>(pair.part_a)].shapes)
          for (const int b : self_.parts()[static_cast<std::size_t>(pair.part_b)].shapes) {
            if (a < 0 || b < 0) continue;
            const auto s = static_cast<std::size_t>(a), t = static_cast<std::size_t>(b);
            if ((arm.centers[s] - arm.centers[t]).norm() < 0.35 &&
                collide(bodies_[s].get(), place_of(arm, s), bodies_[t].get(), place_of(arm, t)))
              return true;
          }
    }
    return false;
  }

  ArmInMap setup_;
  Rng rng_;
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_, next_;
  scene::SelfField self_;
  std::shared_ptr<octomap::OcTree> tree_;
  std::shared_ptr<fcl::OcTreed> octree_;
  std::vector<scene::Box> leaves_;
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> bodies_;
  scene::Obstacle moving_, sudden_;
  double start_s_ = 1.0;
};

/// arm7 with its spheres, the planar arm of the paper, and a chain of capsules, each in random
/// clutter, and arm7 in the shelf of data/. @param folder receives the maps
inline std::vector<ArmInMap> arms_in_maps(const std::filesystem::path& folder) {
  const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
  const auto clutter = [&](const char* name, std::uint64_t seed, const scene::Box& bounds,
                           double keep_out) {
    scene::MakeMapOptions options;
    options.resolution_m = 0.04;
    scene::Clutter things;
    things.count = 14;
    things.size_min_m = 0.08;
    things.size_max_m = 0.3;
    things.bounds = bounds;
    things.keep_out = {{Vector3d::Zero(), keep_out}};
    things.seed = seed;
    options.clutter = things;
    options.output = folder / name;
    scene::make_map(options);
    scene::MapSpec spec;
    spec.file = options.output;
    return spec;
  };
  const scene::Box around{{-0.8, -0.8, 0.0}, {0.8, 0.8, 1.0}};
  const auto arm7 = [&] {
    description::RobotOptions options;
    options.spheres = data / "robots/arm7.spheres.json";
    return model::Model(description::read_robot(data / "robots/arm7.urdf", options));
  };
  scene::MapSpec shelf;
  shelf.file = data / "maps/shelf.bt";
  std::vector<ArmInMap> all;
  all.push_back({"arm7, clutter", arm7(), clutter("hamelin_certificate_a.bt", 1, around, 0.25)});
  all.push_back({"arm7, shelf", arm7(), shelf});
  all.push_back(
      {"planar3, clutter", model::Model(description::read_robot(data / "robots/planar3.json")),
       clutter("hamelin_certificate_b.bt", 2, {{-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}}, 0.08)});
  all.push_back({"capsules, clutter",
                 model::Model(model::make_chain({7, "x,z,x", 0.15, 1.0, 0.04})),
                 clutter("hamelin_certificate_c.bt", 3, around, 0.25)});
  return all;
}

}  // namespace hamelin::test
