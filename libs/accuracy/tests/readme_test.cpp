#include "hamelin/test/readme.hpp"

#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/test/chains.hpp"

using namespace hamelin;

TEST_CASE("the README's example runs", "[accuracy]") {
  const model::Model arm(test::planar3());
  // clang-format off
  // [example]
accuracy::Options options;
options.q0 = options.v0 = Eigen::VectorXd::Zero(arm.dof());
options.duration_s = 0.5;
options.schemes = accuracy::read_schemes("hamel-variational,gauss:8,dop853");
options.steps_s = {0.01, 0.005};
options.rtols = {1e-6};
const accuracy::Measurement found = accuracy::measure(arm, options);
const std::string table = accuracy::to_table(found);
  // [example]
  // clang-format on
  CHECK(found.rows.size() == 3 * 2 + 2);
  CHECK_THAT(table, Catch::Contains("gauss:8, controlled"));
  test::check_readme_example("libs/accuracy");
}
