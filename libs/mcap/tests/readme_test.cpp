#include <catch2/catch.hpp>

#include "hamelin/control/preparation.hpp"
#include "hamelin/io/atomic_file.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/mcap/export.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/readme.hpp"
#include "hamelin/test/temporary.hpp"
#include "mcap_records.hpp"

using namespace hamelin;

TEST_CASE("the README's example writes an MCAP file", "[mcap][docs]") {
  const auto folder = test::temporary("mcap_readme");
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const auto log = folder / "run.jsonl";
  scene::Scene scene =
      scene::read_scene(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/paper_51.json");
  scene.duration_s = 0.1;
  {
    log::RunLog lines(log);
    simulation::Watch watch;
    watch.log = &lines;
    const model::Model model = control::load_model(scene);
    (void)simulation::integrate(model, simulation::free_motion(scene, model), watch);
  }
  // clang-format off
  // [example]
AtomicFile file(folder / "run.mcap");
const mcap::ExportSummary summary = mcap::export_log(
    log, 50.0, [&](std::string_view bytes) { file.append(bytes); });
file.commit();
REQUIRE(summary.samples == 6);  // 0.1 s at 50 Hz, with both ends
  // [example]
  // clang-format on
  CHECK(test::records_of_file(read_file(folder / "run.mcap")).size() > 6);
  test::check_readme_example("libs/mcap");
}
