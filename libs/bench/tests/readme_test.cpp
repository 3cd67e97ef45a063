#include "hamelin/test/readme.hpp"

#include "hamelin/bench/problem_set.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;

TEST_CASE("the README's example runs, and writes the files", "[bench][unit]") {
  const auto set_file = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "bench" / "v1.json";
  const test::TemporaryFolder temporary;
  const std::filesystem::path& folder = temporary.path();
  // clang-format off
  // [example]
const bench::ProblemSet set = bench::read_problem_set(set_file);
bench::Selection selection;
selection.families = {"shelf", "cage"};
selection.per_family = 3;
const auto problems = bench::select(set, selection);
const auto files = bench::write_problems(problems, folder, set_file.string());
const Eigen::VectorXd start = problems[0].path.leftCols(1);
  // [example]
  // clang-format on
  CHECK(start.size() == 7);
  REQUIRE(files.size() == 6);
  for (const auto& file : files) CHECK(std::filesystem::is_regular_file(file));
  test::check_readme_example("libs/bench");
}
