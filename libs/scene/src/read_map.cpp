#include <fmt/format.h>

#include <utility>

#include "hamelin/io/file.hpp"
#include "read_scene.hpp"

namespace hamelin::scene {

namespace {

PointsSpec read_points_spec(const Reader& in) {
  PointsSpec points;
  for (auto [key, value] : {std::pair{"margin_m", &points.margin_m},
                            {"time_error_s", &points.time_error_s},
                            {"age_max_s", &points.age_max_s},
                            {"hit", &points.hit},
                            {"miss", &points.miss},
                            {"least", &points.least},
                            {"most", &points.most}})
    *value = in.get(key, *value);
  points.movers = in.get("movers", points.movers);
  points.close_gaps = in.get("close_gaps", points.close_gaps);
  if (points.least > points.most)
    in.fail("least", fmt::format("{} is above most, {}", points.least, points.most));
  return points;
}

}  // namespace

std::vector<Box> read_boxes(const Reader& in, const char* key) {
  std::vector<Box> out;
  for (const auto& six : in.get<std::vector<std::vector<double>>>(key, {})) {
    const Box box{{six[0], six[1], six[2]}, {six[3], six[4], six[5]}};
    if (!(box.lo.array() < box.hi.array()).all())
      in.fail(fmt::format("{}/{}", key, out.size()).c_str(),
              "the low corner is not below the high one on each axis, expected [x, y, z, x, y, z]");
    out.push_back(box);
  }
  return out;
}

MapChangeSpec read_map_change(const Reader& in, const std::filesystem::path& folder) {
  MapChangeSpec change;
  change.time_s = in.get("time_s", 0.0);
  if (const auto file = in.maybe<std::string>("file")) change.file = resolve_path(folder, *file);
  change.free_m = read_boxes(in, "free_boxes_m");
  change.occupied_m = read_boxes(in, "occupied_boxes_m");
  if (!change.file && change.free_m.empty() && change.occupied_m.empty())
    in.fail("file", "is missing, expected a file, free_boxes_m or occupied_boxes_m");
  return change;
}

MapSpec read_map_spec(const Reader& in, const std::filesystem::path& folder) {
  MapSpec map;
  if (const auto file = in.maybe<std::string>("file")) map.file = resolve_path(folder, *file);
  const auto resolution_m = in.maybe<double>("resolution_m");
  if (map.file.empty() && !resolution_m)
    in.fail("file", "is missing, expected it or, for a map that sensors make, resolution_m");
  if (!map.file.empty() && resolution_m)
    in.fail("resolution_m", "is given in addition to file, expected one of them");
  map.resolution_m = resolution_m.value_or(map.resolution_m);
  map.pose = in.pose();
  map.quaternion_wxyz = in.quaternion();
  map.scale = in.maybe<double>("scale");
  map.occupancy_threshold = in.get("occupancy_threshold", 0.5);
  const auto unknown = in.get<std::string>("unknown", "free");
  map.unknown = unknown == "slow"    ? UnknownPolicy::slow
                : unknown == "block" ? UnknownPolicy::block
                                     : UnknownPolicy::free;
  map.keep_out_radius_m = in.get("keep_out_radius_m", 0.0);
  if (const Json* filter = in.find("self_filter"); filter != nullptr && *filter != Json(false))
    map.self_filter_padding_m =
        in.child("self_filter").get("padding_m", default_self_filter_padding_m);
  map.known = in.get("known", true);
  if (!map.known && map.file.empty())
    in.fail("known", "is false, but there is no file, expected one that sensors see");
  map.points = read_points_spec(in.child("points"));
  in.each("changes", [&](const Reader& change) {
    const double last_s = map.changes.empty() ? 0.0 : map.changes.back().time_s;
    map.changes.push_back(read_map_change(change, folder));
    if (const double time_s = map.changes.back().time_s; time_s < last_s)
      change.fail("time_s", fmt::format("{} s is before the change at {} s, expected changes by "
                                        "time",
                                        time_s, last_s));
  });
  return map;
}

}  // namespace hamelin::scene
