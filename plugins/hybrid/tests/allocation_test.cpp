#include "hamelin/test/allocations.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "../src/parts.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/random_mass.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::allocations_in;

TEST_CASE("the safety filter does not allocate", "[hybrid][allocation]") {
  test::require_allocation_count();
  Rng rng(1);
  const MatrixXd M = test::random_mass(rng, 7), W = M.inverse();
  const VectorXd a = test::random_numbers(rng, 7), low = VectorXd::Constant(7, -1.0),
                 high = VectorXd::Constant(7, 1.0);
  VectorXd x = test::random_numbers(rng, 7, 3.0);
  const VectorXd from = 0.1 * x;
  hybrid::SafetyFilter filter(7, 8);
  CHECK(allocations_in([&] {
          filter.begin(M, W);
          (void)filter.add_row(a, -0.1, -0.2);
          filter.set_box(low, high);
          filter.set_momentum_box(low, high);
          (void)filter.braking_room(a, from);
          (void)filter.project(x, 12);
        }) == 0);
}
