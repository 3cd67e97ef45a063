#include "hamelin/search/edge_check.hpp"

#include <catch2/catch.hpp>

#include "guide/guide_query.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::VectorXd;

namespace {

/// An arm of data/ among the boxes of a map and balls, one of which may move.
struct EdgeRig {
  explicit EdgeRig(bool with_mover, bool with_capsules = false)
      : scene(make_scene(with_mover)),
        arm(with_capsules ? model::Model(model::make_chain({})) : control::load_model(scene)),
        world(scene, arm, {}),
        view(scene, arm, world),
        query(arm, world, view),
        edges(arm, view.self_field()),
        ws(arm),
        shapes(arm) {
    query.refresh(time_s);
    edges.set_environment(world.latest()->environment, time_s);
  }
  static scene::Scene make_scene(bool with_mover) {
    const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
    scene::Scene scene = scene::read_scene(data / "scenes/clutter.json");
    scene.model.self_collision = true;
    scene::Obstacle ball;
    ball.name = "still";
    ball.radius_m = 0.1;
    ball.pose = {Eigen::Matrix3d::Identity(), {0.5, 0.2, 0.6}};
    scene.obstacles = {ball};
    if (!with_mover) return scene;
    ball.name = "moving";
    ball.pose = {Eigen::Matrix3d::Identity(), {-0.5, 0.0, 0.6}};
    ball.motion = scene::LinearMotion{{0.0, 0.2, 0.0}, 0.0};
    scene.obstacles.push_back(ball);
    return scene;
  }
  [[nodiscard]] VectorXd random_q() {
    return VectorXd::NullaryExpr(arm.dof(), [&](Eigen::Index i) {
      const auto& joint = arm.robot().links[static_cast<std::size_t>(i)].joint;
      return rng.uniform(joint.lower.value_or(-3.0), joint.upper.value_or(3.0));
    });
  }
  /// The smallest distance at q, computed without the query.
  double reference(const VectorXd& q) {
    dynamics::forward_kinematics(arm, ws, q);
    shapes.place(arm, ws);
    double smallest = world.latest()->environment.clearance(shapes.view(), time_s, 0.2);
    for (std::size_t pair = 0; pair < view.self_field()->pairs().size(); ++pair)
      smallest = std::min(smallest, view.self_field()->distance(pair, shapes.view(), 0.2));
    return smallest;
  }
  double sampled(const VectorXd& a, const VectorXd& b) {
    double smallest = 1.0;
    for (int i = 0; i <= 200; ++i)
      smallest = std::min(smallest, reference(a + 0.005 * i * (b - a)));
    return smallest;
  }

  double time_s = 1.5;
  scene::Scene scene;
  model::Model arm;
  control::World world;
  control::WorldView view;
  control::GuideQuery query;
  search::EdgeCheck edges;
  dynamics::Workspace ws;
  scene::PlacedShapes shapes;
  Rng rng{11};
};

struct EdgeCounts {
  long proved = 0, clear_not_proved = 0, in_collision = 0;
};

// Compares proofs with dense samples, for margins of 0 to 2 cm and motions of all lengths.
EdgeCounts compare(EdgeRig& rig, int motions) {
  EdgeCounts counts;
  for (int i = 0; i < motions; ++i) {
    const VectorXd a = rig.random_q();
    const VectorXd b = a + rig.rng.uniform(0.02, 1.0) * (rig.random_q() - a);
    const double margin = 0.01 * static_cast<double>(i % 3);
    const bool proved = rig.edges.motion_clear(a, b, margin);
    const double smallest = rig.sampled(a, b);
    if (proved) CHECK(smallest > margin);
    counts.proved += proved ? 1 : 0;
    counts.in_collision += smallest <= margin ? 1 : 0;
    counts.clear_not_proved += !proved && smallest > margin + 5e-4 ? 1 : 0;
  }
  return counts;
}

}  // namespace

TEST_CASE("a motion that is proved clear is clear at every sample, and few others are refused",
          "[control][guide]") {
  for (const bool with_mover : {false, true}) {
    EdgeRig rig(with_mover);
    const EdgeCounts counts = compare(rig, 1500);
    CHECK(counts.proved > 100);
    CHECK(counts.in_collision > 500);
    CHECK(counts.clear_not_proved <= 3);  // those that touch between two samples
  }
}

TEST_CASE("motions of capsules are proved as well", "[control][guide]") {
  EdgeRig rig(false, true);
  REQUIRE(rig.arm.has_capsules());
  const EdgeCounts counts = compare(rig, 600);
  CHECK(counts.proved > 50);
  CHECK(counts.clear_not_proved <= 3);
}

TEST_CASE("a posture is clear by the margin if its clearance is at least that",
          "[control][guide]") {
  EdgeRig rig(true);
  long clear = 0;
  for (int i = 0; i < 500; ++i) {
    const VectorXd q = rig.random_q();
    const double clearance = rig.reference(q);
    if (clearance <= 1e-6 || clearance >= 0.19) continue;
    ++clear;
    CHECK(rig.query.clearance(q, -1.0) == Approx(clearance).margin(1e-12));
    CHECK(rig.edges.posture_clear(q, clearance - 1e-6));
    CHECK_FALSE(rig.edges.posture_clear(q, clearance + 1e-6));
  }
  CHECK(clear > 50);
}

TEST_CASE("the proved clearance of a motion is the smallest of its samples, but for 0.1 mm",
          "[control][guide]") {
  EdgeRig rig(false);
  long clear = 0;
  const long before = rig.query.checks();
  for (int i = 0; i < 300; ++i) {
    const VectorXd a = rig.random_q(), b = a + 0.1 * (rig.random_q() - a);
    const double proved = rig.query.proved_clearance(a, b), sampled = rig.sampled(a, b);
    if (proved <= 0.0) {
      CHECK(sampled < 1e-3);
      continue;
    }
    ++clear;
    CHECK(proved <= sampled);
    CHECK(proved > std::min(sampled, 0.2) - 1e-3);
  }
  CHECK(clear > 50);
  CHECK(rig.query.checks() == before);
}

TEST_CASE("checks of motions do not allocate", "[control][guide]") {
  EdgeRig rig(true);
  std::vector<VectorXd> q;
  for (int i = 0; i < 100; ++i) q.push_back(rig.random_q());
  (void)rig.edges.motion_clear(q[0], q[1], 0.0);
  test::require_allocation_count();
  CHECK(test::allocations_in([&] {
          for (std::size_t i = 1; i < q.size(); ++i)
            (void)rig.edges.motion_clear(q[i - 1], q[i], 0.0);
        }) == 0);
}
