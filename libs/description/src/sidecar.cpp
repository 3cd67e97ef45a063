#include <fmt/format.h>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::description {

namespace {

using Eigen::Vector3d;

// Reads a sidecar with collision shapes; messages name the place in the document.
class SidecarReader {
 public:
  explicit SidecarReader(const std::string& where) : where_(where) {}

  detail::SphereFile read(const Json& document) const {
    if (!document.is_object() || !document.contains("links") || !document["links"].is_object())
      fail("expected an object whose \"links\" maps link names to lists of spheres");
    detail::SphereFile out;
    out.where = where_;
    for (const auto& [name, list] : document["links"].items())
      out.links[name] = spheres(list, "/links/" + name);
    if (document.contains("capsules")) {
      if (!document["capsules"].is_object())
        fail("/capsules: expected an object that maps link names to capsules");
      for (const auto& [name, list] : document["capsules"].items())
        out.capsules[name] = capsules(list, "/capsules/" + name);
    }
    if (document.contains("self_collision_disabled"))
      out.self_collision_disabled = pairs(document["self_collision_disabled"]);
    return out;
  }

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", where_, message));
  }
  [[nodiscard]] double number(const Json& value, const std::string& place) const {
    if (!value.is_number()) fail(fmt::format("{}: expected a number", place));
    return value.get<double>();
  }
  [[nodiscard]] Vector3d point(const Json& value, const std::string& place) const {
    return {number(value[0], place), number(value[1], place), number(value[2], place)};
  }
  [[nodiscard]] double radius(const Json& value, const std::string& place) const {
    const double r = number(value, place + "/radius");
    if (!(r > 0.0)) fail(fmt::format("{}/radius: {} m, expected a positive number", place, r));
    return r;
  }
  static bool has_point(const Json& shape, const char* key) {
    return shape.contains(key) && shape[key].is_array() && shape[key].size() == 3;
  }

  [[nodiscard]] std::vector<Sphere> spheres(const Json& list, const std::string& where) const {
    if (!list.is_array()) fail(where + ": expected a list of spheres");
    std::vector<Sphere> out;
    for (const Json& sphere : list) {
      const std::string place = fmt::format("{}/{}", where, out.size());
      if (!sphere.is_object() || sphere.size() != 2 || !has_point(sphere, "center") ||
          !sphere.contains("radius"))
        fail(fmt::format("{}: expected {{\"center\": [x, y, z], \"radius\": r}}", place));
      out.push_back({point(sphere["center"], place + "/center"), radius(sphere["radius"], place)});
    }
    return out;
  }

  [[nodiscard]] std::vector<Segment> capsules(const Json& list, const std::string& where) const {
    if (!list.is_array()) fail(where + ": expected a list of capsules");
    std::vector<Segment> out;
    for (const Json& capsule : list) {
      const std::string place = fmt::format("{}/{}", where, out.size());
      if (!capsule.is_object() || capsule.size() != 3 || !has_point(capsule, "from") ||
          !has_point(capsule, "to") || !capsule.contains("radius"))
        fail(fmt::format("{}: expected {{\"from\": [x, y, z], \"to\": [x, y, z], \"radius\": r}}",
                         place));
      out.push_back({point(capsule["from"], place + "/from"), point(capsule["to"], place + "/to"),
                     radius(capsule["radius"], place)});
    }
    return out;
  }

  [[nodiscard]] std::vector<std::pair<std::string, std::string>> pairs(const Json& list) const {
    constexpr const char* expected =
        "/self_collision_disabled: expected a list of pairs of link names";
    if (!list.is_array()) fail(expected);
    std::vector<std::pair<std::string, std::string>> out;
    for (const Json& pair : list) {
      if (!pair.is_array() || pair.size() != 2 || !pair[0].is_string() || !pair[1].is_string())
        fail(expected);
      out.emplace_back(pair[0].get<std::string>(), pair[1].get<std::string>());
    }
    return out;
  }

  const std::string& where_;
};

}  // namespace

std::size_t check_spheres(const std::filesystem::path& file) {
  const detail::SphereFile given = detail::read_spheres(read_json(file), file.string());
  std::size_t count = 0;
  for (const auto& [name, spheres] : given.links) count += spheres.size();
  for (const auto& [name, capsules] : given.capsules) count += capsules.size();
  return count;
}

detail::SphereFile detail::read_spheres(const Json& document, const std::string& where) {
  return SidecarReader(where).read(document);
}

std::optional<detail::SphereFile> detail::sidecar_of(const RobotOptions& options) {
  if (options.sidecar) return read_spheres(*options.sidecar, "sidecar");
  if (options.spheres) return read_spheres(read_json(*options.spheres), options.spheres->string());
  return std::nullopt;
}

}  // namespace hamelin::description
