#include <fmt/format.h>

#include "../program.hpp"

using namespace hamelin;
using test::Sandbox;
namespace fs = std::filesystem;

namespace {

// A wall across x, one point per voxel of 2 cm, that begins at `left`.
std::string wall(double x, double left) {
  std::string out = "# a wall\n";
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 10; ++j)
      out += fmt::format("{} {} {}\n", x, left + 0.02 * i, 0.01 + 0.02 * j);
  return out;
}

}  // namespace

TEST_CASE("a map is made of the points of frames, and read as any other", "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("a.xyz", wall(0.51, -0.19));
  sandbox.put("b.xyz", wall(0.51, 0.21) + "nan nan nan\n");
  const Json made = test::run_json(sandbox, {"map", "from-points", "a.xyz", "b.xyz", "--origin",
                                             "0,0,0.1", "--resolution", "0.02", "-o", "wall.bt"});
  CHECK(made["frames"] == 2);
  CHECK(made["points"] == 400);
  CHECK(made["not_finite"] == 1);
  CHECK(made["occupied_voxels"] == 400);
  CHECK(made["free_voxels"] > 400);
  const Json info = test::run_json(sandbox, {"scene", "info", "wall.bt"});
  CHECK(info["resolution_m"] == 0.02);
  CHECK(info["occupied_leaves"] > 0);

  // the same, seen by a sensor that is turned about z by half a turn
  sandbox.put("turned.txt", wall(-0.51, -0.19));
  sandbox.put("poses.txt", "0 0 0.1 0 0 0 1\n");
  const auto turned = sandbox.run({"map", "from-points", "turned.txt", "--poses", "poses.txt",
                                   "--resolution", "0.02", "--range", "2", "-o", "turned.ot"});
  CHECK(turned.exit_code == 0);
  CHECK_THAT(turned.err + turned.out,
             Catch::Contains("turned.ot: 200 points of 1 frames, 200 occ"));
}

TEST_CASE("points that make no map are refused in one line, and nothing is written",
          "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("a.xyz", wall(0.5, 0.0));
  sandbox.put("short.xyz", "0 0 1\n0 0\n");
  sandbox.put("far.xyz", "1000 0 0\n");
  sandbox.put("poses.txt", "0 0 0.1 1 0 0 0\n");
  const auto refused = [&](std::vector<std::string> words, const std::string& message) {
    words.insert(words.begin(), {"map", "from-points"});
    const auto result = sandbox.run(words);
    CAPTURE(message, result.err);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Contains(message));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
    CHECK_FALSE(fs::exists(sandbox.path("m.bt")));
  };
  refused({"short.xyz", "-o", "m.bt"}, "short.xyz: line 2: has 2 numbers");
  refused({"none.ply", "-o", "m.bt"}, "none.ply");
  refused({"a.xyz", "-o", "m.las"}, "m.las ends in '.las', expected .bt or .ot");
  refused({"a.las", "-o", "m.bt"}, "a.las: ends in '.las'");
  refused({"far.xyz", "-o", "m.bt"}, "far.xyz: map of points: a point at (1000, 0, 0) m");
  refused({"a.xyz", "a.xyz", "--poses", "poses.txt", "-o", "m.bt"}, "1 poses, expected 2");
  refused({"a.xyz", "--poses", "poses.txt", "--origin", "0,0,0", "-o", "m.bt"}, "--origin");
  refused({"a.xyz", "--resolution", "0", "-o", "m.bt"}, "a resolution of 0 m given");
  refused({"a.xyz", "-o", "a.xyz"}, "a.xyz");
}
