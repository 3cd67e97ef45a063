#include "hamelin/scene/scene.hpp"

#include "targets.hpp"

namespace hamelin::fuzz {

void scene(std::string_view bytes) {
  const std::string file = "scene.json";
  Json resolved;
  const bool read = accepts(file, [&] {
    resolved =
        scene::resolved_json(scene::scene_from_json(parse_json(bytes, file), "folder", file));
  });
  if (!read) return;
  // The paths are resolved, so that the folder is empty.
  const bool again = accepts(file, [&] {
    const Json twice =
        scene::resolved_json(scene::scene_from_json(parse_json(resolved.dump(), file), "", file));
    require(twice == resolved, "a resolved scene reads back as the same");
  });
  require(again, "a resolved scene is a scene");
}

}  // namespace hamelin::fuzz
