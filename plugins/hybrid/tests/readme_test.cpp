#include "hamelin/reactive/safety_filter.hpp"

#include <Eigen/Dense>

#include "hamelin/test/readme.hpp"

TEST_CASE("the README's example runs", "[hybrid][docs]") {
  // clang-format off
  // [example]
// The nearest admissible velocity for one obstacle row and a velocity box.
const Eigen::MatrixXd M = Eigen::Vector2d(2.0, 1.0).asDiagonal(), W = M.inverse();
hamelin::reactive::SafetyFilter filter(2, 8);
filter.begin(M, W);
filter.add_row(Eigen::Vector2d(1.0, 0.0), -0.1, -0.2);  // a·x ≥ −0.1, and in any case ≥ −0.2
filter.set_box(Eigen::Vector2d(-1.0, -1.0), Eigen::Vector2d(1.0, 1.0));
Eigen::VectorXd x = Eigen::Vector2d(-0.5, 3.0);
const auto report = filter.project(x, 12);
REQUIRE(x.isApprox(Eigen::Vector2d(-0.1, 1.0)));
REQUIRE(report.energy_after_J <= report.energy_before_J);
  // [example]
  // clang-format on
  hamelin::test::check_readme_example("plugins/hybrid");
}
