#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>

#include "decode.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/make.hpp"

using namespace hamelin;
using Catch::Matchers::Contains;
using test::Decoded;
namespace fs = std::filesystem;

namespace {

void write(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

std::string notes_of(const Decoded& page) {
  return page.head["runs"][0]["notes"].dump();
}

}  // namespace

TEST_CASE("a truncated log makes a page of its complete lines, with notes", "[report]") {
  const auto folder = test::scratch("cut");
  (void)test::log_run(test::shelf(0.2), folder / "whole.jsonl");
  const std::string text = read_file(folder / "whole.jsonl");
  write(folder / "cut.jsonl", text.substr(0, text.size() / 2));
  const auto data = report::make_data({folder / "cut.jsonl"});
  CHECK(data.runs.at(0).outcome == "unfinished");
  const Decoded page(data.bytes);
  CHECK(page.head["runs"][0]["result"].is_null());
  CHECK(page.head["runs"][0]["outcome"] == "unfinished");
  CHECK_THAT(notes_of(page), Contains("middle of a line") && Contains("no result"));
  CHECK(page(page.head["runs"][0]["frames"]["t"]).size() ==
        test::ticks_of(folder / "cut.jsonl").size());
}

TEST_CASE("a file that is not a log is refused in one line with its name", "[report]") {
  const auto folder = test::scratch("refused");
  (void)test::log_run(test::shelf(0.01), folder / "run.jsonl");
  const std::string text = read_file(folder / "run.jsonl");
  const std::size_t header = text.find('\n') + 1;
  std::string damaged = text;
  damaged.replace(damaged.find("\"q\":[", header), 5, "\"q\":[1.0,");
  std::string backwards = text;
  const std::size_t third = backwards.find("\"k\":3");
  backwards.replace(third, 5, "\"k\":1");
  const auto line =
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(third), '\n');
  const std::pair<std::string, std::string> cases[] = {
      {"", "is empty"},
      {text.substr(0, 100), "has no complete line"},
      {text.substr(0, header), "has no tick"},
      {"{\n \"schema\": \"hamelin.scene/1\"\n}\n", "its first line is not a JSON object"},
      {"{\"schema\": \"hamelin.scene/1\"}\n", "its first line is not a header"},
      {text.substr(header), "its first line is not a header"},
      {damaged, "line 2: q: expected 7 numbers"},
      {backwards, "line " + std::to_string(line) + ": k: 1 after 2"},
      {text + text.substr(header), "follows the result"},
      {text.substr(0, header) + "{\"type\":\"tock\"}\n", "line 2: type \"tock\""},
      {text.substr(0, header) + "{\"type\":\"tick\",\"k\":0,\"time_s\":\"now\"}\n",
       "line 2: time_s: expected a number"},
      {text.substr(0, header) + "{\"type\":\"tick\",\"k\":0,\"time_s\":0,\"q\":[0,0,0,0,0,0,0],"
                                "\"stop\":{\"cause\":\"map\",\"q_end\":[1]}}\n",
       "line 2: q_end: expected 7 numbers"},
      {text.substr(0, header) + "{\"type\":\"tick\",\"k\":0,\"time_s\":0,\"q\":[0,0,0,0,0,0,0],"
                                "\"stop\":{\"cause\":1}}\n",
       "line 2: /stop/cause: expected the name"},
  };
  for (const auto& [content, expected] : cases) {
    write(folder / "bad.jsonl", content);
    CAPTURE(expected);
    try {
      (void)report::make_data({folder / "bad.jsonl"});
      FAIL("no error");
    } catch (const Error& e) {
      const std::string message = e.what();
      CHECK_THAT(message, Contains(expected) && Contains("bad.jsonl"));
      CHECK(message.find('\n') == std::string::npos);
    }
  }
  CHECK_THROWS_AS(report::make_data({folder / "absent.jsonl"}), Error);
  CHECK_THROWS_AS(report::make_data({}), Error);
  CHECK_THROWS_AS(report::make_data({folder / "run.jsonl"}, {1, 1500}), Error);
  CHECK_THROWS_AS(report::make_data({folder / "run.jsonl"}, {2, 3}), Error);
}

TEST_CASE("without the original map a page has no clearances; without the robot there is no page",
          "[report]") {
  const auto folder = test::scratch("missing");
  scene::Scene scene = test::shelf(0.02);
  const auto copy = [&](fs::path& file) {
    fs::copy_file(file, folder / file.filename());
    file = folder / file.filename();
  };
  copy(scene.map->file);
  copy(scene.robot.file);
  copy(*scene.robot.spheres);
  (void)test::log_run(scene, folder / "run.jsonl");
  const auto run_of = [&] { return Decoded(report::make_data({folder / "run.jsonl"}).bytes); };
  CHECK_FALSE(run_of().head["runs"][0]["frames"]["clearance"].is_null());

  const auto check_without_map = [&](const std::string& reason) {
    const Decoded page = run_of();
    CHECK(page.head["worlds"][0]["map"].is_null());
    CHECK(page.head["runs"][0]["frames"]["clearance"].is_null());
    CHECK(page.head["runs"][0]["frames"]["contacts"].is_null());
    CHECK_THAT(notes_of(page),
               Contains("shelf.bt") && Contains(reason) && Contains("without the map"));
    CHECK(page(page.plot(0, "clearance")["t"]).size() == 21);  // from the log
  };
  fs::copy_file(test::checkout("data/maps/clutter.bt"), scene.map->file,
                fs::copy_options::overwrite_existing);
  check_without_map("changed");
  fs::remove(scene.map->file);
  check_without_map("missing");

  fs::remove(scene.robot.file);
  CHECK_THROWS_WITH(run_of(), Contains("arm7.urdf"));
  fs::copy_file(*scene.robot.spheres, scene.robot.file);
  CHECK_THROWS_WITH(run_of(), Contains("arm7.urdf"));
}

TEST_CASE("no visible cell of a map that is too large to draw is lost", "[report]") {
  const auto folder = test::scratch("large_map");
  scene::MakeMapOptions options;
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.95;
  options.resolution_m = 0.01;
  options.primitives = {ball};
  options.output = folder / "ball.bt";
  (void)scene::make_map(options);
  scene::Scene scene = test::shelf(0.01);
  scene.map->file = options.output;
  scene.map->pose = geometry::SE3(Eigen::Matrix3d::Identity(), {0.8, 0.2, 0.2});
  // refused at once because the base is inside the ball
  (void)test::log_run(scene, folder / "run.jsonl");
  const Decoded page(report::make_data({folder / "run.jsonl"}).bytes);
  const Json& map = page.head["worlds"][0]["map"];
  const auto lo = page(map["lo"]), level = page(map["level"]);
  CHECK(level.size() <= 60000);
  CHECK(level.size() > 10000);
  CHECK(map["left_out"] > 0);
  CHECK_THAT(notes_of(page), Contains("are drawn at least 0.02 m wide"));

  constexpr int n = 200, half = n / 2;
  const auto index = [](int x, int y, int z) {
    return static_cast<std::size_t>(((z + half) * n + y + half) * n + x + half);
  };
  const auto paint = [&](std::vector<bool>& grid, const std::array<int, 3>& from, int size) {
    for (int z = 0; z < size; ++z)
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) grid[index(from[0] + x, from[1] + y, from[2] + z)] = true;
  };
  // The cells near the arm are drawn; the far side of the ball is cropped by whole cells.
  const model::Model model = control::load_model(scene);
  const auto data = scene::read_map(options.output);
  const double radius = model.reach() + page.head["runs"][0]["frames"]["influence_m"].get<double>();
  std::vector<bool> occupied(n * n * n), drawn(n * n * n);
  const auto near =
      scene::crop(data.occupied, 0.01, {scene.map->pose.inverse() * scene.base.p(), radius});
  REQUIRE(near.size() > 60000);
  for (const auto& cell : near) paint(occupied, cell.lo, cell.size);
  for (std::size_t c = 0; c < level.size(); ++c)
    paint(drawn,
          {static_cast<int>(lo[3 * c]), static_cast<int>(lo[3 * c + 1]),
           static_cast<int>(lo[3 * c + 2])},
          1 << static_cast<int>(level[c]));
  std::size_t visible = 0, lost = 0, far_off = 0;
  for (int z = -half + 2; z < half - 2; ++z)
    for (int y = -half + 2; y < half - 2; ++y)
      for (int x = -half + 2; x < half - 2; ++x) {
        const bool here = occupied[index(x, y, z)];
        const bool free_beside = !occupied[index(x - 1, y, z)] || !occupied[index(x + 1, y, z)] ||
                                 !occupied[index(x, y - 1, z)] || !occupied[index(x, y + 1, z)] ||
                                 !occupied[index(x, y, z - 1)] || !occupied[index(x, y, z + 1)];
        visible += here && free_beside ? 1 : 0;
        lost += here && free_beside && !drawn[index(x, y, z)] ? 1 : 0;
        if (here || !drawn[index(x, y, z)]) continue;
        bool any = false;
        for (int a = -1; a <= 1; ++a)
          for (int b = -1; b <= 1; ++b)
            for (int c = -1; c <= 1; ++c) any = any || occupied[index(x + a, y + b, z + c)];
        far_off += any ? 0 : 1;
      }
  CHECK(visible > 60000);
  CHECK(lost == 0);
  CHECK(far_off == 0);  // coarsening widens by less than one coarse cell
}
