#include <fcl/geometry/octree/octree.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>
#include <octomap/OcTree.h>
#include <unistd.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/simulation/run.hpp"

// The checks share no code with hamelin: urdfdom reads the arm, Eigen places it, OctoMap reads the
// map, and FCL decides about contact. hamelin runs the scene and reads the JSON of its log.
using namespace hamelin;
using Eigen::Isometry3d;
using Eigen::Vector3d;

namespace {

namespace fs = std::filesystem;

struct Ball {
  Vector3d center;  ///< in the link's frame [m]
  double radius;
};

/// A link of the URDF with balls, and a ball around all of them.
struct Part {
  std::string link;
  std::vector<Ball> balls;
  Ball hull;
};

Isometry3d isometry(const urdf::Pose& pose) {
  Isometry3d g = Isometry3d::Identity();
  g.translation() = Vector3d(pose.position.x, pose.position.y, pose.position.z);
  g.linear() =
      Eigen::Quaterniond(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z)
          .toRotationMatrix();
  return g;
}

Ball hull_of(const std::vector<Ball>& balls) {
  Ball hull{Vector3d::Zero(), 0.0};
  for (const auto& ball : balls) hull.center += ball.center / static_cast<double>(balls.size());
  for (const auto& ball : balls)
    hull.radius = std::max(hull.radius, (ball.center - hull.center).norm() + ball.radius);
  return hull;
}

/// The arm of a scene.
class Arm {
 public:
  Arm(const Json& scene, const fs::path& directory)
      : urdf_(
            urdf::parseURDFFile((directory / scene["robot"]["file"].get<std::string>()).string())) {
    for (auto link = urdf_->getLink(scene["robot"]["tip"].get<std::string>()); link->parent_joint;
         link = urdf_->getLink(link->parent_joint->parent_link_name))
      if (link->parent_joint->type != urdf::Joint::FIXED)
        moving_.insert(moving_.begin(), link->parent_joint->name);
    const Json sidecar = read_json(directory / scene["robot"]["spheres"].get<std::string>());
    for (const auto& [name, list] : sidecar["links"].items()) {
      Part part{name, {}, {}};
      for (const auto& ball : list)
        part.balls.push_back(
            {Vector3d(ball["center"][0], ball["center"][1], ball["center"][2]), ball["radius"]});
      part.hull = hull_of(part.balls);
      if (!part.balls.empty() && moves(name)) parts_.push_back(part);
    }
  }

  [[nodiscard]] std::size_t dof() const { return moving_.size(); }
  [[nodiscard]] const std::vector<Part>& parts() const { return parts_; }

  /// Poses of the parts' links in the world, as products of the joint transforms from the root to
  /// the link.
  [[nodiscard]] std::vector<Isometry3d> poses(const std::vector<double>& q) const {
    std::map<std::string, double> angles;
    for (std::size_t i = 0; i < moving_.size(); ++i) angles[moving_[i]] = q[i];
    std::vector<Isometry3d> poses;
    for (const auto& part : parts_) {
      Isometry3d g = Isometry3d::Identity();
      for (auto link = urdf_->getLink(part.link); link->parent_joint;
           link = urdf_->getLink(link->parent_joint->parent_link_name)) {
        const auto& joint = *link->parent_joint;
        Isometry3d step = isometry(joint.parent_to_joint_origin_transform);
        if (const auto angle = angles.find(joint.name); angle != angles.end())
          step.rotate(Eigen::AngleAxisd(
              angle->second, Vector3d(joint.axis.x, joint.axis.y, joint.axis.z).normalized()));
        g = step * g;
      }
      poses.push_back(g);
    }
    return poses;
  }

 private:
  [[nodiscard]] bool moves(const std::string& name) const {
    for (auto link = urdf_->getLink(name); link->parent_joint;
         link = urdf_->getLink(link->parent_joint->parent_link_name))
      if (std::find(moving_.begin(), moving_.end(), link->parent_joint->name) != moving_.end())
        return true;
    return false;
  }

  urdf::ModelInterfaceSharedPtr urdf_;
  std::vector<std::string> moving_;  ///< joints with a position in q, from the root
  std::vector<Part> parts_;
};

/// A map in FCL.
class Judge {
 public:
  explicit Judge(const fs::path& file)
      : octree_(std::make_shared<octomap::OcTree>(file.string())) {}

  [[nodiscard]] bool touches(const Vector3d& center, double radius) const {
    const fcl::Sphered sphere(radius);
    const fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    fcl::collide(&octree_, Isometry3d::Identity(), &sphere, placed(center), request, result);
    return result.isCollision();
  }

  /// Whether any ball touches the map if its radius is enlarged by `margin`. The balls of a link
  /// are checked only if its hull touches the map.
  [[nodiscard]] bool touches(const Arm& arm, const std::vector<double>& q, double margin) const {
    const auto poses = arm.poses(q);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Part& part = arm.parts()[i];
      if (!touches(poses[i] * part.hull.center, part.hull.radius + margin)) continue;
      for (const auto& ball : part.balls)
        if (touches(poses[i] * ball.center, ball.radius + margin)) return true;
    }
    return false;
  }

  /// FCL's distance between the map and the nearest ball, without balls farther than `limit`.
  /// Infinite if all are farther.
  [[nodiscard]] double distance(const Arm& arm, const std::vector<double>& q, double limit) const {
    double nearest = std::numeric_limits<double>::infinity();
    const auto poses = arm.poses(q);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      for (const auto& ball : arm.parts()[i].balls) {
        const Vector3d center = poses[i] * ball.center;
        if (!touches(center, ball.radius + std::min(limit, nearest))) continue;
        const fcl::Sphered sphere(ball.radius);
        const fcl::DistanceRequestd request;
        fcl::DistanceResultd result;
        fcl::distance(&octree_, Isometry3d::Identity(), &sphere, placed(center), request, result);
        nearest = std::min(nearest, result.min_distance);
      }
    }
    return nearest;
  }

 private:
  static Isometry3d placed(const Vector3d& center) {
    Isometry3d at = Isometry3d::Identity();
    at.translation() = center;
    return at;
  }

  fcl::OcTreed octree_;
};

struct Tick {
  std::vector<double> q;
  double clearance_m;
};

struct Run {
  log::Result result;
  std::vector<Tick> ticks;
};

/// Runs the unmodified scene and logs every tick.
Run run_logged(const fs::path& file) {
  const fs::path directory =
      fs::temp_directory_path() / ("hamelin_judge_" + std::to_string(::getpid()));
  fs::create_directories(directory);
  Run run;
  {
    log::RunLog run_log(directory / "run.jsonl");
    simulation::Watch watch;
    watch.log = &run_log;
    run.result = simulation::run(scene::read_scene(file), {HAMELIN_TEST_PLUGIN_DIR}, watch);
  }
  for (const Json& line : log::read_log(directory / "run.jsonl").lines)
    if (line["type"] == "tick")
      run.ticks.push_back(
          {line["q"].get<std::vector<double>>(), line["clearance_m"].get<double>()});
  fs::remove_all(directory);
  return run;
}

std::vector<double> between(const std::vector<double>& a, const std::vector<double>& b,
                            double share) {
  std::vector<double> q(a.size());
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = (1.0 - share) * a[i] + share * b[i];
  return q;
}

}  // namespace

TEST_CASE("the judge sees a contact where there is one", "[judge][unit]") {
  const fs::path directory = fs::path(HAMELIN_SOURCE_DIR) / "data" / "scenes";
  const Json scene = read_json(directory / "shelf.json");
  const Arm arm(scene, directory);
  const Judge judge(directory / scene["map"]["file"].get<std::string>());
  REQUIRE(arm.dof() == 7);
  // The boards of the shelf are in front of the arm. Stretched out towards them it must hit one,
  // folded back it must not.
  const std::vector<double> into{0.0, 1.2, 0.0, -0.4, 0.0, 1.6, 0.0},
      folded{3.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785};
  CHECK(judge.touches(arm, into, 0.0));
  CHECK_FALSE(judge.touches(arm, folded, 0.0));
}

TEST_CASE("hybrid reaches the goals of the shelf and the clutter without contact according to FCL",
          "[judge][long]") {
  constexpr int parts_between = 5;     // four points between two nodes
  constexpr std::size_t sampled = 50;  // ticks whose distance is compared; each takes milliseconds
  constexpr double agreement_m = 1e-4;
  const fs::path directory = fs::path(HAMELIN_SOURCE_DIR) / "data" / "scenes";
  for (const std::string name : {"shelf.json", "clutter.json"}) {
    CAPTURE(name);
    const Json scene = read_json(directory / name);
    const Arm arm(scene, directory);
    const Judge judge(directory / scene["map"]["file"].get<std::string>());
    const Run run = run_logged(directory / name);
    CHECK(run.result.outcome == log::Outcome::reached);
    CHECK(run.result.cause == "");
    REQUIRE(run.ticks.size() == static_cast<std::size_t>(run.result.steps) + 1);

    std::size_t touching = 0;
    for (std::size_t k = 0; k < run.ticks.size(); ++k) {
      touching += judge.touches(arm, run.ticks[k].q, 0.0);
      for (int i = 1; k > 0 && i < parts_between; ++i)
        touching += judge.touches(
            arm, between(run.ticks[k - 1].q, run.ticks[k].q, double(i) / parts_between), 0.0);
    }
    CHECK(touching == 0);

    // the logged clearance is limited to the influence distance of the planner
    double cap = 0.0;
    std::size_t tightest = 0;
    for (std::size_t k = 0; k < run.ticks.size(); ++k) {
      cap = std::max(cap, run.ticks[k].clearance_m);
      if (run.ticks[k].clearance_m < run.ticks[tightest].clearance_m) tightest = k;
    }
    REQUIRE(run.result.min_clearance_m.has_value());
    CHECK(*run.result.min_clearance_m == run.ticks[tightest].clearance_m);
    std::vector<std::size_t> sample{tightest};
    for (std::size_t i = 0; i < sampled; ++i)
      sample.push_back(i * (run.ticks.size() - 1) / (sampled - 1));
    for (const std::size_t k : sample) {
      CAPTURE(k);
      const double distance = judge.distance(arm, run.ticks[k].q, cap + agreement_m);
      CHECK(std::abs(std::min(distance, cap) - run.ticks[k].clearance_m) < agreement_m);
    }
  }
}
