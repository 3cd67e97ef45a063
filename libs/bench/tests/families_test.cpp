#include "hamelin/bench/families.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "hamelin/bench/problem_set.hpp"
#include "hamelin/core/error.hpp"

using namespace hamelin;
using namespace hamelin::bench;

namespace {

std::string text_of(const std::string& family, std::uint64_t seed) {
  Problem problem;
  problem.family = family;
  problem.seed = seed;
  problem.path = Eigen::MatrixXd::Zero(7, 2);
  return problem_text(problem);
}

// Whether a number is this many tenths of a millimetre, up to rounding, and how many.
long grains(double x) {
  const double grain = x * 1e4;
  REQUIRE(std::abs(grain - std::round(grain)) < 1e-7);
  return std::lround(grain);
}

}  // namespace

TEST_CASE("there are ten families, each with its own clutter for each seed", "[bench][unit]") {
  REQUIRE(families().size() == 10);
  std::set<std::string> texts;
  for (const auto& family : families()) {
    CHECK_FALSE(describe(family).empty());
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      CHECK(text_of(family, seed) == text_of(family, seed));
      texts.insert(text_of(family, seed));
    }
  }
  CHECK(texts.size() == 30);
  CHECK_THROWS_AS(describe("maze"), Error);
  CHECK_THROWS_AS(make_layout("maze", 1), Error);
}

TEST_CASE("positions are multiples of 0.1 mm, and edges odd ones", "[bench][unit]") {
  for (const auto& family : families()) {
    const Layout layout = make_layout(family, 5);
    CHECK(layout.obstacles.size() >= 5);
    for (const auto& o : layout.obstacles) {
      CAPTURE(family, o.name);
      for (const double x : o.pose.p()) (void)grains(x);
      if (o.shape == scene::Shape::box) {
        for (const double edge : o.size_m) CHECK(grains(edge) % 2 == 1);
      } else {
        CHECK(grains(2.0 * o.radius_m) % 2 == 1);
      }
      if (o.shape == scene::Shape::cylinder) CHECK(grains(o.length_m) % 2 == 1);
    }
  }
}

TEST_CASE("the rooms of start and goal are apart", "[bench][unit]") {
  for (const auto& family : families())
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const Layout layout = make_layout(family, seed);
      const auto &start = layout.start, &goal = layout.goal;
      CAPTURE(family, seed);
      for (const auto* room : {&start, &goal})
        REQUIRE((room->box.lo.array() < room->box.hi.array()).all());
      // points of one room, the other one does not contain
      for (int i = 0; i <= 4; ++i)
        for (int j = 0; j <= 4; ++j)
          for (int k = 0; k <= 4; ++k) {
            const Eigen::Vector3d share(0.25 * i, 0.25 * j, 0.25 * k);
            const Eigen::Vector3d p =
                start.frame * Eigen::Vector3d(start.box.lo + share.cwiseProduct(Eigen::Vector3d(
                                                                 start.box.hi - start.box.lo)));
            REQUIRE_FALSE(goal.contains(p));
          }
    }
}
