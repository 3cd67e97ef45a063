#include <Eigen/Dense>
#include <numbers>

#include "hamelin/reactive/turn.hpp"
#include "hamelin/test/readme.hpp"

TEST_CASE("the README's example runs", "[reactive][docs]") {
  // clang-format off
  // [example]
// A turn by a right angle keeps the kinetic energy, and so does every other one.
const Eigen::MatrixXd M = Eigen::Vector3d(2.0, 1.0, 0.5).asDiagonal();
hamelin::reactive::Turner turner(3);
hamelin::reactive::Turn turn{Eigen::Vector3d(0.3, 1.0, 0.0), 0.5 * std::numbers::pi, 0.4};
Eigen::VectorXd u = Eigen::Vector3d(1.0, 0.0, 0.2);
const double energy = 0.5 * u.dot(M * u);
turner.rotate(turn, M, u);
REQUIRE(0.5 * u.dot(M * u) == Approx(energy));
  // [example]
  // clang-format on
  hamelin::test::check_readme_example("libs/reactive");
}
