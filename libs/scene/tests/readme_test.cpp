#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <vector>

#include "hamelin/scene/environment.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;
using namespace hamelin::scene;

TEST_CASE("the README's example runs and finds the shelf", "[scene][unit]") {
  const auto data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
  // clang-format off
  // [example]
MapSpec map;
map.file = data / "maps" / "shelf.bt";
const geometry::SE3 base;
const double reach = 0.9, influence = 0.15;
const Environment environment(map, {}, base, reach, influence);
Environment::Scratch scratch(environment, 1);
const std::vector<Eigen::Vector3d> centers{{0.5, 0.2, 0.55}};
const std::vector<double> radii{0.06};
std::array<Contact, 8> contacts;
const std::size_t count = environment.closest({centers, radii}, influence, 0.0, scratch, contacts);
  // [example]
  // clang-format on
  REQUIRE(count >= 1);
  CHECK(contacts[0].obstacle == Contact::map);
  // The middle board: lower face at 0.61, front edge at 0.60.
  CHECK(contacts[0].distance == Approx(std::hypot(0.1, 0.06) - 0.06).margin(1e-9));
  test::check_readme_example("libs/scene");
}
