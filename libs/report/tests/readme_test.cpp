#include <catch2/catch.hpp>

#include "decode.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example makes a page", "[report][docs]") {
  const auto folder = test::scratch("readme");
  const auto log = folder / "run.jsonl";
  scene::Scene scene = scene::read_scene(test::checkout("data/scenes/paper_51.json"));
  scene.duration_s = 2.0;
  (void)test::log_run(scene, log);
  // clang-format off
  // [example]
report::Options options;
options.frames_max = 500;  // poses of the arm per run
const report::Data data = report::make_data({log}, options);
for (const auto& run : data.runs) {
  REQUIRE(run.outcome == "completed");
  REQUIRE(run.frames <= 500);
}
const std::string page_template = "<script id=\"hamelin-data\">__HAMELIN_REPORT_DATA__</script>";
const std::string page = report::make_page(page_template, data.bytes, "template.html");
write_file_atomically(folder / "page.html", page);
  // [example]
  // clang-format on
  CHECK(read_file(folder / "page.html") == page);
  CHECK(page.find(report::token) == std::string::npos);
  test::check_readme_example("libs/report");
}
