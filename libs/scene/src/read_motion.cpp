#include <fmt/format.h>

#include <initializer_list>
#include <memory>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/io/file.hpp"
#include "read_scene.hpp"
#include "waypoint_file.hpp"

namespace hamelin::scene {

namespace {

WaypointMotion read_waypoint_motion(const Reader& in, const std::filesystem::path& folder) {
  WaypointPath::Options options;
  options.repeat = in.get("repeat", false);
  options.gap_max_s = in.maybe<double>("gap_max_s");
  const auto file = in.maybe<std::string>("file");
  const Json* list = in.find("waypoints");
  if (file && list != nullptr)
    in.fail("file", "is given in addition to waypoints, expected one of the two");
  if (list != nullptr)
    return {std::make_shared<WaypointPath>(waypoints_from_json(*list, in.place_of("waypoints")),
                                           options, in.place_of("waypoints"))};
  if (!file) in.fail("waypoints", "is missing, expected waypoints or a file");
  try {
    return {
        std::make_shared<WaypointPath>(read_waypoint_path(resolve_path(folder, *file), options))};
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}", in.place_of("file"), e.what()));
  }
}

}  // namespace

Motion read_motion(const Reader& in, const std::filesystem::path& folder) {
  const auto type = in.get<std::string>("type", "");
  const auto take = [&](std::string_view kind, const std::string& name,
                        std::initializer_list<const char*> keys) {
    for (const char* key : keys)
      if (type != kind) in.refuse(key, name);
  };
  const std::string name = type == "linear"      ? "linear motion"
                           : type == "waypoints" ? "motion by way-points"
                                                 : type;
  take("sine", name, {"amplitude_m", "period_s"});
  take("linear", name, {"velocity_m_s", "start_s", "duration_s"});
  take("waypoints", name, {"waypoints", "file", "repeat", "gap_max_s"});
  if (type == "waypoints") return read_waypoint_motion(in, folder);
  if (type == "sine") {
    in.require("amplitude_m", "sine");
    in.require("period_s", "sine");
    return SineMotion{in.vector("amplitude_m", Eigen::Vector3d::Zero()), in.get("period_s", 0.0)};
  }
  in.require("velocity_m_s", name);
  return LinearMotion{in.vector("velocity_m_s", Eigen::Vector3d::Zero()), in.get("start_s", 0.0),
                      in.get("duration_s", infinity)};
}

}  // namespace hamelin::scene
