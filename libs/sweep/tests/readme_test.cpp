#include "hamelin/test/readme.hpp"

#include "hamelin/sweep/pairs.hpp"

using namespace hamelin;

TEST_CASE("the README's example runs, and none of its runs touches the shelf", "[sweep][unit]") {
  const auto scene_file =
      std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes" / "shelf.json";
  const std::vector<std::filesystem::path> plugin_directories{HAMELIN_TEST_PLUGIN_DIR};
  // clang-format off
  // [example]
const scene::Scene scene = scene::read_scene(scene_file);
sweep::PairOptions options;
options.count = 4;
const sweep::DrawnPairs drawn = sweep::draw_pairs(scene, options);
sweep::PairRuns runs;
runs.plugin_directories = plugin_directories;
runs.jobs = 2;
const auto summary = sweep::summarize(sweep::run_pairs(scene, drawn.pairs, runs));
const std::size_t collisions = summary.count(log::Outcome::collision);
  // [example]
  // clang-format on
  CHECK(summary.runs == 4);
  CHECK(collisions == 0);
  CHECK(summary.certified_share_min == 1.0);
  test::check_readme_example("libs/sweep");
}
