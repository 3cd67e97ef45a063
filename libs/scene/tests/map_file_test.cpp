#include "hamelin/scene/map_file.hpp"

#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>
#include <octomap/OcTreeStamped.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/damaged_maps.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;

std::string refusal(const std::filesystem::path& file, const ReadMapOptions& options = {}) {
  try {
    const auto map = read_map(file, options);
    return {};
  } catch (const Error& e) {
    return e.what();
  }
}

std::filesystem::path write_temporary(const std::string& name, const std::string& bytes) {
  const auto file = test::temporary(name);
  write_file_atomically(file, bytes);
  return file;
}

}  // namespace

TEST_CASE("every damaged map is refused in one line that names file and place", "[scene][unit]") {
  std::size_t refused = 0;
  for (const test::MapCase& map : test::map_cases()) {
    const auto file = write_temporary("hamelin_" + map.name, map.bytes);
    const std::string message = refusal(file);
    CAPTURE(map.name, message);
    CHECK(message.empty() == map.accepted);
    if (!map.accepted) {
      ++refused;
      CHECK(message.rfind(file.string() + ": ", 0) == 0);
      CHECK(message.find('\n') == std::string::npos);
      const bool placed = message.find("byte ") != std::string::npos ||
                          message.find("header") != std::string::npos ||
                          message.find("resolution 50 ") != std::string::npos;
      CHECK(placed);
      CHECK_THAT(message, Catch::Contains(map.message));
    }
    std::filesystem::remove(file);
  }
  CHECK(refused >= 35);
}

TEST_CASE("every map of the collection of corrupt ones is accepted or refused as expected",
          "[scene][unit]") {
  const auto directory = test::shared_data("bad_maps");
  std::ifstream index(directory / "INDEX.tsv");
  std::string line;
  std::getline(index, line);
  std::size_t seen = 0;
  while (std::getline(index, line)) {
    std::vector<std::string> columns;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, '\t');) columns.push_back(field);
    if (columns.size() < 2) continue;
    const std::string &name = columns.front(), &expected = columns.back();
    CAPTURE(name, expected);
    ++seen;
    const std::string message = refusal(directory / name);
    const bool accept = expected.rfind("reject", 0) != 0;
    CHECK(message.empty() == accept);
    if (accept) continue;
    CAPTURE(message);
    CHECK(message.rfind((directory / name).string() + ": ", 0) == 0);
    CHECK(message.find('\n') == std::string::npos);
    const bool placed = message.find("byte ") != std::string::npos ||
                        message.find("header") != std::string::npos ||
                        message.find("resolution 50 ") != std::string::npos;
    CHECK(placed);
    if (expected.find("convert_octree") != std::string::npos)
      CHECK(message.find("convert_octree") != std::string::npos);
    if (name.rfind("e_legacy", 0) == 0) CHECK(message.find("legacy") != std::string::npos);
  }
  CHECK(seen == 47);
}

TEST_CASE("an all-occupied map is one box and a warning", "[scene][unit]") {
  const auto root_file = write_temporary("hamelin_root_occupied.ot", test::occupied_root());
  const auto octant_file = write_temporary("hamelin_octant_occupied.bt", test::occupied_octant());
  const auto root = read_map(root_file);
  REQUIRE(root.occupied.size() == 1);
  CHECK(root.occupied[0].lo == std::array<std::int32_t, 3>{-32768, -32768, -32768});
  CHECK(root.occupied[0].size == 65536);
  CHECK(root.unknown.empty());
  CHECK_FALSE(root.warnings.empty());
  const auto octant = read_map(octant_file);
  REQUIRE(octant.occupied.size() == 1);
  CHECK(octant.occupied[0].size == 32768);
  CHECK(octant.unknown.size() == 7);
  CHECK_FALSE(octant.warnings.empty());
  std::filesystem::remove(root_file);
  std::filesystem::remove(octant_file);
}

TEST_CASE("a map above 0.5 m resolution is read only with an explicit scale", "[scene][unit]") {
  const auto file = write_temporary("hamelin_millimetres.bt", test::millimetre_map());
  CHECK(refusal(file).find("scale") != std::string::npos);
  CHECK(read_map(file, {0.001, 0.5}).resolution == Approx(0.05));
  CHECK_FALSE(read_map(file, {1.0, 0.5}).warnings.empty());
  CHECK(refusal(file, {-1.0, 0.5}).find("scale -1") != std::string::npos);
  const auto tiny = read_map(file, {1e-6, 0.5});
  CHECK(std::any_of(tiny.warnings.begin(), tiny.warnings.end(), [](const std::string& w) {
    return w.find("below 0.001") != std::string::npos;
  }));
  std::filesystem::remove(file);
}

namespace {

// Leaves and counts of a map against OctoMap's own reader.
void check_against_octomap(const std::filesystem::path& file, double scale) {
  CAPTURE(file);
  const auto map = read_map(file, {scale, 0.5});
  std::unique_ptr<octomap::OcTree> tree;
  if (file.extension() == ".bt") {
    tree = std::make_unique<octomap::OcTree>(file.string());
  } else {
    tree.reset(dynamic_cast<octomap::OcTree*>(octomap::AbstractOcTree::read(file.string())));
  }
  REQUIRE(tree);
  // In the same order, too: its iterator goes depth first.
  using Key = std::tuple<int, int, int, int>;
  std::vector<Key> theirs, ours;
  std::size_t free_leaves = 0;
  for (auto leaf = tree->begin_leafs(), end = tree->end_leafs(); leaf != end; ++leaf) {
    if (!tree->isNodeOccupied(*leaf)) {
      ++free_leaves;
      continue;
    }
    const auto key = leaf.getIndexKey();
    theirs.emplace_back(key[0] - 32768, key[1] - 32768, key[2] - 32768,
                        1 << (16 - leaf.getDepth()));
  }
  for (const Cell& cell : map.occupied)
    ours.emplace_back(cell.lo[0], cell.lo[1], cell.lo[2], cell.size);
  CHECK((ours == theirs));
  CHECK(map.free.empty());
  CHECK(map.occupied.capacity() + map.unknown.capacity() ==
        map.occupied.size() + map.unknown.size());
  const auto whole = read_map(file, {scale, 0.5, true});
  CHECK(whole.free.size() == free_leaves);
  CHECK(whole.occupied.size() == map.occupied.size());
  CHECK(map.free_leaves == free_leaves);
  CHECK(map.node_count == tree->size());
  CHECK(map.resolution == Approx(tree->getResolution() * scale));
  // Occupied, free and unknown cells fill the cube.
  double unknown = 0.0, known = 0.0;
  for (const Cell& cell : map.unknown) unknown += std::pow(static_cast<double>(cell.size), 3);
  for (auto leaf = tree->begin_leafs(), end = tree->end_leafs(); leaf != end; ++leaf)
    known += std::pow(2.0, 3.0 * (16 - static_cast<int>(leaf.getDepth())));
  CHECK(unknown + known == std::pow(2.0, 48));
}

}  // namespace

TEST_CASE("leaves of our maps are those of OctoMap's own reader, as .bt and as .ot",
          "[scene][unit]") {
  for (const char* name : {"shelf.bt", "clutter.bt"}) {
    const auto file = test::data / "maps" / name;
    check_against_octomap(file, 1.0);
    const auto written = test::temporary("written.ot");
    REQUIRE(octomap::OcTree(file.string()).write(written.string()));
    check_against_octomap(written, 0.5);
    std::filesystem::remove(written);
  }
}

TEST_CASE("leaves of the real maps are those of OctoMap's own reader", "[scene][unit]") {
  const auto directory = test::shared_data("maps");
  const std::map<std::string, double> maps{
      {"aurora.bt", 1.0},      {"coal_env.bt", 0.001},          {"drone_orbslam3.bt", 1.0},
      {"geb079.bt", 1.0},      {"octomap_python_test.bt", 1.0}, {"velma_hanas.bt", 1.0},
      {"velma_hanas.ot", 1.0}, {"velma_world1.bt", 1.0}};
  for (const auto& [name, scale] : maps) check_against_octomap(directory / name, scale);
}

TEST_CASE("the occupancy threshold decides which leaves of a .ot are occupied", "[scene][unit]") {
  octomap::OcTree tree(0.1);
  // Log-odds 0, 0.1, …, 1.9: the i-th leaf's probability is 1/(1 + exp(−i/10)).
  for (int i = 0; i < 20; ++i)
    tree.setNodeValue(octomap::point3d(0.15F + 0.2F * static_cast<float>(i), 0.05F, 0.05F),
                      0.1F * static_cast<float>(i));
  tree.updateInnerOccupancy();
  std::ostringstream out;
  tree.write(out);
  const auto file = write_temporary("hamelin_scene_graded.ot", out.str());
  CHECK(read_map(file, {std::nullopt, 0.5}).occupied.size() == 20);
  CHECK(read_map(file, {std::nullopt, 1.0 / (1.0 + std::exp(-0.95))}).occupied.size() == 10);
  CHECK(read_map(file, {std::nullopt, 0.95}).occupied.empty());
  CHECK(read_map(file, {std::nullopt, 0.95}).free_leaves == 20);
  for (const double threshold : {1.5, 1.0, 0.0, -0.5, std::nan("")})
    CHECK(refusal(file, {std::nullopt, threshold}).find("occupancy threshold") !=
          std::string::npos);
  std::filesystem::remove(file);
}

TEST_CASE("at any occupancy threshold the occupied leaves of a .ot are those of OctoMap",
          "[scene][property]") {
  octomap::OcTree tree(0.1);
  Rng rng(5);
  std::vector<double> thresholds{1e-9, 0.1192, 0.5, 0.7, 0.971, 1.0 - 1e-9};
  for (int i = 0; i < 200; ++i) {
    const double threshold = rng.uniform(0.02, 0.98);
    thresholds.push_back(threshold);
    // Exactly at the threshold, and one rounding step to either side of it.
    const float at = octomap::logodds(threshold);
    for (const float value : {at, std::nextafter(at, -10.0F), std::nextafter(at, 10.0F)})
      tree.setNodeValue(octomap::OcTreeKey(static_cast<octomap::key_type>(rng.below(65536)),
                                           static_cast<octomap::key_type>(rng.below(65536)), 32768),
                        value);
  }
  std::ostringstream out;
  tree.write(out);
  for (const double threshold : thresholds) {
    CAPTURE(threshold);
    tree.setOccupancyThres(threshold);
    std::size_t occupied = 0;
    for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf)
      occupied += tree.isNodeOccupied(*leaf) ? 1 : 0;
    CHECK(map_from_bytes(out.str(), "graded.ot", {std::nullopt, threshold}).occupied.size() ==
          occupied);
  }
}

TEST_CASE("an occupancy threshold has no effect on a .bt", "[scene][unit]") {
  octomap::OcTree tree(0.1);
  tree.updateNode(octomap::point3d(0.05F, 0.05F, 0.05F), true);
  tree.updateNode(octomap::point3d(0.55F, 0.05F, 0.05F), false);
  std::ostringstream out;
  tree.writeBinary(out);
  for (const double threshold : {0.01, 0.5, 0.99}) {
    const auto map = map_from_bytes(out.str(), "two.bt", {std::nullopt, threshold});
    CHECK(map.occupied.size() == 1);
    CHECK(map.free_leaves == 1);
    CHECK(map.warnings.size() == (threshold == 0.5 ? 0 : 1));
  }
}

TEST_CASE("a coloured tree is read from both formats, as OctoMap reads it", "[scene][property]") {
  octomap::ColorOcTree tree(0.05);
  Rng rng(9);
  for (int i = 0; i < 400; ++i) {
    const octomap::point3d p(static_cast<float>(rng.uniform(-1.0, 1.0)),
                             static_cast<float>(rng.uniform(-1.0, 1.0)),
                             static_cast<float>(rng.uniform(0.0, 0.3)));
    tree.updateNode(p, rng.below(3) != 0);
    const auto shade = static_cast<std::uint8_t>(rng.below(256));
    tree.integrateNodeColor(p.x(), p.y(), p.z(), shade, 200, 0);
  }
  tree.updateInnerOccupancy();
  for (const bool binary : {false, true}) {
    std::ostringstream out;
    binary ? tree.writeBinary(out) : tree.write(out);  // the binary form last: it prunes
    const std::string where = binary ? "colour.bt" : "colour.ot", bytes = out.str();
    CAPTURE(where);
    CHECK(check_map_bytes(bytes, where).colored);
    const auto map = map_from_bytes(bytes, where);
    std::vector<std::tuple<int, int, int, int>> theirs, ours;
    std::size_t free_leaves = 0;
    for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
      const auto key = leaf.getIndexKey();
      if (tree.isNodeOccupied(*leaf))
        theirs.emplace_back(key[0] - 32768, key[1] - 32768, key[2] - 32768,
                            1 << (16 - leaf.getDepth()));
      else
        ++free_leaves;
    }
    for (const Cell& cell : map.occupied)
      ours.emplace_back(cell.lo[0], cell.lo[1], cell.lo[2], cell.size);
    CHECK(ours.size() > 100);
    CHECK((ours == theirs));
    CHECK(map.free_leaves == free_leaves);
    CHECK(map.node_count == tree.size());
    for (std::size_t length = 0; length < bytes.size(); length += 7)
      CHECK_THROWS_AS(map_from_bytes(std::string_view(bytes).substr(0, length), where), Error);
    CHECK_THROWS_AS(map_from_bytes(bytes + "x", where), Error);
  }
}

TEST_CASE("other trees are refused by name", "[scene][unit]") {
  octomap::OcTreeStamped stamped(0.1);
  stamped.updateNode(octomap::point3d(0.0F, 0.0F, 0.0F), true);
  std::ostringstream out;
  stamped.write(out);
  std::string bytes = out.str();
  CHECK_THROWS_WITH(map_from_bytes(bytes, "tree.ot"),
                    "tree.ot: header line 4: tree type 'OcTreeStamped' is not known, expected "
                    "OcTree or ColorOcTree");
  bytes.replace(bytes.find("OcTreeStamped"), 13, "SemanticOcTree");
  CHECK_THROWS_WITH(map_from_bytes(bytes, "tree.ot"), Catch::Contains("'SemanticOcTree'"));
}

TEST_CASE("a truncation anywhere in a map is refused", "[scene][property]") {
  for (const bool binary : {true, false}) {
    octomap::OcTree tree(0.1);
    for (int i = 0; i < 40; ++i)
      tree.updateNode(
          octomap::point3d(0.1F * static_cast<float>(i % 7), 0.2F * static_cast<float>(i), -0.3F),
          i % 3 != 0);
    tree.updateInnerOccupancy();
    std::ostringstream out;
    binary ? tree.writeBinary(out) : tree.write(out);
    const std::string bytes = out.str(), where = binary ? "cut.bt" : "cut.ot";
    CAPTURE(where);
    CHECK(check_map_bytes(bytes, where).node_count == tree.size());
    for (std::size_t length = 0; length < bytes.size(); ++length) {
      CAPTURE(length);
      CHECK_THROWS_AS(check_map_bytes(std::string_view(bytes).substr(0, length), where), Error);
    }
    CHECK_THROWS_AS(check_map_bytes(bytes + '\0', where), Error);
  }
}

TEST_CASE("a map file that cannot be opened is named", "[scene][unit]") {
  CHECK(refusal("no/such/map.bt").rfind("no/such/map.bt: ", 0) == 0);
  const auto file = write_temporary("hamelin_scene_not_a_map.bt", std::string(300, '\xff'));
  CHECK(refusal(file).find("header line 1") != std::string::npos);
  std::filesystem::remove(file);
}
