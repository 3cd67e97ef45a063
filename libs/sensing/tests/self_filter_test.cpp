#include "hamelin/sensing/self_filter.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/rng.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Eigen::Vector3d;

namespace {

double distance(const scene::Shapes& arm, const Vector3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < arm.size(); ++i) {
    const Vector3d a = arm.from(i), way = arm.to(i) - a;
    const double squared = way.squaredNorm(),
                 along = squared > 0.0 ? std::clamp((p - a).dot(way) / squared, 0.0, 1.0) : 0.0;
    least = std::min(least, (p - a - along * way).norm() - arm.radii[i]);
  }
  return least;
}

}  // namespace

TEST_CASE("points within the margin of the arm are removed, and no others", "[sensing][unit]") {
  Rng rng(11);
  std::vector<Vector3d> centers, half_axes;
  std::vector<double> radii;
  for (int i = 0; i < 40; ++i) {
    centers.push_back(Vector3d::NullaryExpr([&] { return rng.uniform(-0.8, 0.8); }));
    half_axes.push_back(i % 3 == 0 ? Vector3d(Vector3d::Zero())
                                   : Vector3d::NullaryExpr([&] { return rng.uniform(-0.2, 0.2); }));
    radii.push_back(rng.uniform(0.05, 0.25));
  }
  const bool capsules = GENERATE(true, false);
  if (!capsules) half_axes.assign(centers.size(), Vector3d::Zero());
  const scene::Shapes with_axes{centers, radii, half_axes}, spheres{centers, radii},
      arm = capsules ? with_axes : spheres;
  const double margin = GENERATE(0.0, 0.03);
  Eigen::Matrix3Xf points(3, 20011);
  for (Eigen::Index i = 0; i < points.cols(); ++i)
    for (int j = 0; j < 3; ++j) points(j, i) = static_cast<float>(rng.uniform(-1.2, 1.2));
  const Eigen::Matrix3Xf before = points;
  const Eigen::Index kept = sensing::remove_arm(arm, margin, points);
  Eigen::Index at = 0;
  int removed = 0, wrong = 0;
  for (Eigen::Index i = 0; i < before.cols(); ++i) {
    const double d = distance(with_axes, before.col(i).cast<double>()) - margin;
    const bool remains = at < kept && points.col(at) == before.col(i);
    if (remains ? d <= 0.0 : d > 1e-5) ++wrong;
    at += remains ? 1 : 0;
    removed += remains ? 0 : 1;
  }
  CHECK(at == kept);
  CHECK(removed > 500);
  CHECK(kept > 5000);
  CHECK(wrong == 0);
}

TEST_CASE("a margin that is none is refused, and empty frames are not", "[sensing][unit]") {
  Eigen::Matrix3Xf points = Eigen::Matrix3Xf::Zero(3, 1);
  for (const double margin : {-0.1, std::nan("")})
    CHECK_THAT(test::error_of([&] { (void)sensing::remove_arm({}, margin, points); }),
               Catch::Contains("self-filter: a margin of"));
  CHECK(sensing::remove_arm({}, 0.1, points) == 1);
  Eigen::Matrix3Xf none(3, 0);
  CHECK(sensing::remove_arm({}, 0.1, none) == 0);
}
