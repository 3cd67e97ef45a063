#include "hamelin/scene/make.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

void primitives(std::string_view bytes) {
  const std::string file = "primitives.json";
  scene::MakeMapOptions options;
  if (!accepts(file,
               [&] { options = scene::make_options_from_json(parse_json(bytes, file), file); }))
    return;
  require(options.resolution_m > 0.0, "the resolution is positive");
  for (const auto& primitive : options.primitives)
    require(primitive.pose.p().allFinite() && primitive.pose.R().allFinite(),
            "a primitive's pose is finite");
}

}  // namespace hamelin::fuzz
