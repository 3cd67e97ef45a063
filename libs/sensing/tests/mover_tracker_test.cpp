#include "hamelin/sensing/mover_tracker.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/rng.hpp"

using namespace hamelin;
using Eigen::Vector3d;

namespace {

// The front of a ball, as a camera sees it that looks along x.
void add_ball(const Vector3d& center, double radius, Rng& noise, Eigen::Matrix3Xf& points) {
  const Eigen::Index before = points.cols();
  constexpr Eigen::Index count = 150;
  points.conservativeResize(3, before + count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double z = 2.0 * (static_cast<double>(i) + 0.5) / count - 1.0,
                 angle = 2.4 * static_cast<double>(i), around = std::sqrt(1.0 - z * z);
    const Vector3d n(-std::abs(around * std::cos(angle)), around * std::sin(angle), z);
    points.col(before + i) = (center + (radius + 0.003 * noise.normal()) * n).cast<float>();
  }
}

// A camera that looks along x.
geometry::SE3 camera() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {R, {-2.0, 0.0, 0.5}};
}

struct Scan {
  sensing::MoverTracker tracker;
  Rng noise{3};
  Eigen::Matrix3Xf points;
  sensing::MoverTracker::Update look(double time_s, const std::vector<Vector3d>& balls,
                                     double radius = 0.1) {
    points.resize(3, 0);
    for (const Vector3d& center : balls) add_ball(center, radius, noise, points);
    const std::vector<std::uint8_t> loose(static_cast<std::size_t>(points.cols()), 1);
    return tracker.update(time_s, camera(), points, loose);
  }
};

}  // namespace

TEST_CASE("two balls that move are followed, one that stands still is not", "[sensing][unit]") {
  Scan scan;
  sensing::MoverTracker::Update last;
  for (int k = 0; k < 30; ++k) {
    const double t = k / 30.0;
    last = scan.look(t, {{0.0, -0.5 + 0.8 * t, 0.5}, {0.0, 0.6, 0.9 - 0.5 * t}, {0.5, 1.2, 0.5}});
    if (k < 2) CHECK(last.movers.empty());
  }
  REQUIRE(last.movers.size() == 2);
  const double end_s = 29.0 / 30.0;
  const Vector3d at[] = {{0.0, -0.5 + 0.8 * end_s, 0.5}, {0.0, 0.6, 0.9 - 0.5 * end_s}},
                 velocity[] = {{0.0, 0.8, 0.0}, {0.0, 0.0, -0.5}};
  for (const auto& mover : last.movers) {
    const int ball = std::abs(mover.velocity_m_s.y()) > 0.4 ? 0 : 1;
    CAPTURE(ball);
    CHECK((mover.pose.p() - at[ball]).norm() < 0.04);  // what is hidden is guessed
    CHECK((mover.velocity_m_s - velocity[ball]).norm() < 0.15);
    CHECK((mover.size_m.array() > 0.18).all());
    CHECK((mover.size_m.array() < 0.25).all());
  }
  CHECK(last.movers[0].id != last.movers[1].id);
  // of the third ball no point is taken
  int taken = 0;
  for (std::size_t i = 0; i < last.taken.size(); ++i)
    taken += last.taken[i] != 0 && scan.points(1, static_cast<Eigen::Index>(i)) > 1.0F ? 1 : 0;
  CHECK(taken == 0);
}

TEST_CASE("a body that stops, or is not seen any more, is given up", "[sensing][unit]") {
  for (const bool stops : {true, false}) {
    Scan scan;
    int found = 0, gone = 0;
    double gone_s = 0.0;
    for (int k = 0; k < 90; ++k) {
      const double t = k / 30.0, way_s = std::min(t, 0.5);
      std::vector<Vector3d> balls{{0.0, 0.6 * way_s, 0.5}};
      if (!stops && t > 0.5) balls.clear();
      const auto update = scan.look(t, balls);
      found += update.movers.empty() ? 0 : 1;
      gone += static_cast<int>(update.gone.size());
      if (!update.gone.empty()) gone_s = t;
    }
    CAPTURE(stops);
    CHECK(found > 8);
    CHECK(gone == 1);
    CHECK(gone_s > (stops ? 1.3 : 0.9));
    CHECK(gone_s < (stops ? 1.6 : 1.2));
  }
}

TEST_CASE("a mover keeps its id while it passes another one at a distance", "[sensing][unit]") {
  Scan scan;
  std::vector<std::int32_t> ids;
  for (int k = 0; k < 45; ++k) {
    const double t = k / 30.0;
    for (const auto& mover :
         scan.look(t, {{0.0, -0.6 + 0.8 * t, 0.5}, {0.0, 0.6 - 0.8 * t, 0.85}}).movers)
      if (std::find(ids.begin(), ids.end(), mover.id) == ids.end()) ids.push_back(mover.id);
  }
  CHECK(ids.size() == 2);
}
