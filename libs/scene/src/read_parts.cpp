#include <fmt/format.h>

#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/parts.hpp"
#include "read_scene.hpp"

namespace hamelin::scene {

namespace {

// The smallest scene that has the part: schema, checks and places in messages are those of a scene.
Scene scene_with(const char* key, Json part, const std::filesystem::path& base_dir,
                 const std::string& where) {
  Json document{{"schema", "hamelin.scene/1"}, {"robot", {{"file", "none"}}}};
  document[key] = std::move(part);
  return parts_from_json(document, base_dir, where);
}

void require_object(const Json& document, const std::string& where, const char* place) {
  if (!document.is_object())
    throw Error(ErrorCode::invalid, fmt::format("{}: {}: has the type {}, expected an object",
                                                where, place, document.type_name()));
}

}  // namespace

std::vector<Goal> goals_from_json(const Json& document, const std::filesystem::path& base_dir,
                                  const std::string& where) {
  Json list = document.is_object() ? Json::array({document}) : document;
  return scene_with("goals", std::move(list), base_dir, where).goals;
}

std::optional<MapSpec> map_from_json(const Json& document, const std::filesystem::path& base_dir,
                                     const std::string& where) {
  return scene_with("map", document, base_dir, where).map;
}

MapChangeSpec map_change_from_json(const Json& document, const std::filesystem::path& base_dir,
                                   const std::string& where) {
  require_object(document, where, "/map/changes/0");
  Json change = document;
  if (!change.contains("time_s")) change["time_s"] = 0.0;
  Json map = Json::object();
  map["file"] = "none";
  map["changes"] = Json::array({change});
  return scene_with("map", std::move(map), base_dir, where).map->changes.front();
}

Obstacle obstacle_from_json(const Json& document, const std::filesystem::path& base_dir,
                            const std::string& where) {
  require_object(document, where, "/obstacles/0");
  return scene_with("obstacles", Json::array({document}), base_dir, where).obstacles.front();
}

Payload payload_from_json(const Json& document, const std::string& where) {
  require_object(document, where, "/model/payload");
  Json model = Json::object();
  model["payload"] = document;
  return *scene_with("model", std::move(model), {}, where).model.payload;
}

}  // namespace hamelin::scene
