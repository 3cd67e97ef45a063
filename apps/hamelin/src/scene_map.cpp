#include "scene_map.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <memory>

#include "command_line.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/map_crop.hpp"
#include "hamelin/scene/map_field.hpp"
#include "hamelin/scene/map_region.hpp"
#include "hamelin/simulation/run.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

// The influence distance if no planner sets one.
constexpr double default_influence_m = 0.2;

struct CropFlags {
  std::optional<std::filesystem::path> map, scene;
  std::filesystem::path output;
  std::string center, box, unknown;
  std::optional<double> radius, influence, scale, threshold;
  std::vector<std::filesystem::path> plugin_path;
  bool json = false;
};

double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

Eigen::Vector3d point(const std::string& option, const std::string& text) {
  const auto x = number_list(option, text, 3);
  return {x[0], x[1], x[2]};
}

Json list(const Eigen::Vector3d& x) {
  return {x.x(), x.y(), x.z()};
}

std::string point_text(const Json& x) {
  return fmt::format("{:.4g} {:.4g} {:.4g}", x[0].get<double>(), x[1].get<double>(),
                     x[2].get<double>());
}

scene::Box extent(const scene::MapData& map) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  scene::Box box{Eigen::Vector3d::Constant(infinity), Eigen::Vector3d::Constant(-infinity)};
  for (const auto& cell : map.occupied) {
    const scene::Box leaf = scene::to_metres(cell, map.resolution);
    box = {box.lo.cwiseMin(leaf.lo), box.hi.cwiseMax(leaf.hi)};
  }
  return box;
}

// The region of the map to keep for a scene: the reach of its arm plus the influence distance of
// its planner, in the map's frame.
scene::Ball region_of_arm(const scene::Scene& scene, const CropFlags& flags) {
  const model::Model model = control::load_model(scene);
  double influence = default_influence_m;
  if (flags.influence) {
    influence = *flags.influence;
  } else if (scene.planner) {
    const auto plugin = planning::find_plugin(scene.planner->name, plugin_path(flags.plugin_path));
    influence = plugin.influence_m(planning::check_params(plugin, scene.planner->params))
                    .value_or(influence);
  }
  if (!(influence >= 0.0))
    throw Error(ErrorCode::usage,
                fmt::format("scene crop: --influence: {} m, expected at least 0", influence));
  return {scene.map->pose.inverse() * scene.base.p(), model.reach() + influence};
}

scene::CropOptions crop_options(const CropFlags& flags) {
  if (!flags.center.empty() + !flags.box.empty() + flags.scene.has_value() != 1)
    throw Error(ErrorCode::usage,
                "scene crop: expected one of --center with --radius, --box, or --scene");
  if (flags.center.empty() == flags.radius.has_value())
    throw Error(ErrorCode::usage, "scene crop: --center and --radius belong together");
  if (flags.influence && !flags.scene)
    throw Error(ErrorCode::usage, "scene crop: --influence applies to --scene only");
  if (!flags.map && !flags.scene)
    throw Error(ErrorCode::usage, "scene crop: no map given, expected a map file or --scene");
  scene::CropOptions options;
  options.output = flags.output;
  options.unknown_is_free = flags.unknown == "free";
  if (flags.map) options.map = *flags.map;
  if (flags.scene) {
    const scene::Scene scene = scene::read_scene(*flags.scene);
    if (!scene.map || scene.map->file.empty())
      throw Error(ErrorCode::invalid, fmt::format("{}: /map{}: is missing, expected a map to crop",
                                                  flags.scene->string(), scene.map ? "/file" : ""));
    if (!flags.map) options.map = scene.map->file;
    options.read.scale = scene.map->scale;
    options.read.occupancy_threshold = scene.map->occupancy_threshold;
    options.region = region_of_arm(scene, flags);
  } else if (!flags.center.empty()) {
    options.region = scene::Ball{point("--center", flags.center), *flags.radius};
  } else {
    const auto b = number_list("--box", flags.box, 6);
    options.region = scene::Box{{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
  }
  if (flags.scale) options.read.scale = flags.scale;
  if (flags.threshold) options.read.occupancy_threshold = *flags.threshold;
  return options;
}

void crop(const CropFlags& flags) {
  const auto options = crop_options(flags);
  const auto made = scene::crop_map(options);
  for (const auto& warning : made.warnings)
    note(fmt::format("{}: {}", options.map.string(), warning));
  if (flags.json) {
    Json region;
    if (const auto* ball = std::get_if<scene::Ball>(&options.region)) {
      region = {{"center_m", list(ball->center)}, {"radius_m", ball->radius}};
    } else {
      const auto& box = std::get<scene::Box>(options.region);
      region = {{"low_m", list(box.lo)}, {"high_m", list(box.hi)}};
    }
    print_json({{"file", options.output.string()},
                {"map", options.map.string()},
                {"region", region},
                {"resolution_m", made.resolution_m},
                {"bytes_before", made.bytes_before},
                {"bytes", made.bytes},
                {"nodes_before", made.nodes_before},
                {"nodes", made.nodes},
                {"occupied_leaves_before", made.occupied_leaves_before},
                {"occupied_leaves", made.occupied_leaves},
                {"free_leaves_before", made.free_leaves_before},
                {"free_leaves", made.free_leaves},
                {"sha256", made.sha256},
                {"warnings", made.warnings}});
    return;
  }
  report(fmt::format(
      "{}: {} of {} occupied leaves, {} of {} free leaves; {} (before: {}), sha256 {}\n",
      options.output.string(), made.occupied_leaves, made.occupied_leaves_before, made.free_leaves,
      made.free_leaves_before, bytes_text(made.bytes), bytes_text(made.bytes_before), made.sha256));
}

}  // namespace

std::string info_line(std::string_view label, const std::string& text) {
  return fmt::format("  {:<14}{}\n", label, text);
}

std::string percent(const Json& share) {
  return fmt::format("{:.1f} %", 100.0 * share.get<double>());
}

std::string bytes_text(std::size_t bytes) {
  const auto size = static_cast<double>(bytes);
  if (size >= 1e6) return fmt::format("{:.1f} MB", 1e-6 * size);
  if (size >= 1e4) return fmt::format("{:.1f} kB", 1e-3 * size);
  return fmt::format("{} bytes", bytes);
}

Json map_info(const std::filesystem::path& file, const MapInfoOptions& options) {
  if (options.reach && !(*options.reach > 0.0 && std::isfinite(*options.reach)))
    throw Error(ErrorCode::usage,
                fmt::format("--reach: {} m, expected a number above 0", *options.reach));
  const auto begin = std::chrono::steady_clock::now();
  const auto map = scene::read_map(file, {options.scale, options.threshold.value_or(0.5)});
  const double read_ms = ms_since(begin);
  const bool any = !map.occupied.empty();
  const scene::Box box = extent(map);
  scene::Ball ball;
  if (!options.base.empty())
    ball.center = point("--base", options.base);
  else if (any && !options.reach)
    ball.center = 0.5 * (box.lo + box.hi);
  if (options.reach)
    ball.radius = *options.reach;
  else if (any)
    ball.radius =
        (ball.center - box.lo).cwiseAbs().cwiseMax((box.hi - ball.center).cwiseAbs()).norm();
  Json info{{"file", file.string()},
            {"kind", "map"},
            {"bytes", std::filesystem::file_size(file)},
            {"sha256", map.sha256},
            {"resolution_m", map.resolution},
            {"scale", options.scale ? Json(*options.scale) : Json(nullptr)},
            {"nodes", map.node_count},
            {"occupied_leaves", map.occupied.size()},
            {"free_leaves", map.free_leaves},
            {"occupied_low_m", any ? list(box.lo) : Json(nullptr)},
            {"occupied_high_m", any ? list(box.hi) : Json(nullptr)}};
  const auto shares = scene::shares_within(map, ball);
  const auto build = std::chrono::steady_clock::now();
  const auto cells = scene::crop(map.occupied, map.resolution, ball);
  const scene::MapField field(cells, map.resolution, ball.center);
  const double build_ms = ms_since(build);
  info["within_reach"] = {
      {"base_m", list(ball.center)},           {"reach_m", ball.radius},
      {"occupied_share", shares.occupied},     {"free_share", shares.free},
      {"unknown_share", shares.unknown},       {"occupied_leaves", cells.size()},
      {"boxes", field.boxes().boxes().size()}, {"structure_bytes", field.bytes()}};
  info["timing"] = {{"read_ms", read_ms}, {"build_ms", build_ms}};
  info["warnings"] = map.warnings;
  return info;
}

std::string map_text(const Json& info) {
  const Json& near = info["within_reach"];
  std::string out =
      fmt::format("{}: OctoMap with voxels of {:.4g} m, {}\n", info["file"].get<std::string>(),
                  info["resolution_m"].get<double>(), bytes_text(info["bytes"].get<std::size_t>()));
  out += info_line("leaves",
                   fmt::format("{} occupied, {} free; {} nodes", info["occupied_leaves"].dump(),
                               info["free_leaves"].dump(), info["nodes"].dump()));
  if (!info["occupied_low_m"].is_null())
    out += info_line("occupied", fmt::format("from {} to {} m", point_text(info["occupied_low_m"]),
                                             point_text(info["occupied_high_m"])));
  out += info_line(
      "within reach",
      fmt::format("{:.4g} m of {}: {} occupied, {} free, {} unknown", near["reach_m"].get<double>(),
                  point_text(near["base_m"]), percent(near["occupied_share"]),
                  percent(near["free_share"]), percent(near["unknown_share"])));
  out +=
      info_line("structure",
                fmt::format("{} boxes of {} leaves, {}; built in {:.3g} ms, map read in {:.3g} ms",
                            near["boxes"].dump(), near["occupied_leaves"].dump(),
                            bytes_text(near["structure_bytes"].get<std::size_t>()),
                            info["timing"]["build_ms"].get<double>(),
                            info["timing"]["read_ms"].get<double>()));
  out += info_line("sha256", info["sha256"].get<std::string>());
  return out;
}

void add_scene_crop(CLI::App& scene) {
  auto* command = add_command(
      scene, "crop", "Write the part of a map that an arm can come near as a new map",
      "hamelin scene crop data/maps/clutter.bt --center 0,0,0.3 --radius 0.6 -o near.bt\n"
      "hamelin scene crop data/maps/shelf.bt --box 0,-1,0,1,1,1 -o front.bt\n"
      "hamelin scene crop --scene data/scenes/shelf.json -o near.bt");
  const auto flags = std::make_shared<CropFlags>();
  command->add_option("map", flags->map, "map file, .bt or .ot (default the scene's)")
      ->type_name("MAP");
  command
      ->add_option("--center", flags->center,
                   "keep what touches a ball about this point in the map's frame [m]")
      ->type_name("X,Y,Z");
  command->add_option("--radius", flags->radius, "radius of the ball [m]")->type_name("R");
  command
      ->add_option("--box", flags->box,
                   "keep what touches the box with these corners in the map's frame [m]")
      ->type_name("X,Y,Z,X,Y,Z");
  command
      ->add_option("--scene", flags->scene,
                   "keep what is within reach of its arm, plus the planner's influence distance")
      ->type_name("SCENE.json");
  command
      ->add_option("--influence", flags->influence,
                   "distance added to the reach [m] (default the planner's, or 0.2)")
      ->type_name("D");
  command->add_option("--scale", flags->scale, "metres per unit of the map (default the scene's)")
      ->type_name("S");
  command
      ->add_option("--threshold", flags->threshold,
                   "occupancy probability from which a leaf of a .ot map is occupied (default 0.5)")
      ->type_name("P");
  restrict_values(
      command->add_option(
          "--unknown", flags->unknown,
          "keep unknown space unknown, or mark as free the part that touches the region "
          "(default keep)"),
      {"keep", "free"});
  add_plugin_path_option(*command, flags->plugin_path);
  command
      ->add_option("-o,--output", flags->output,
                   "map to write (.bt), in metres, so that it needs no scale")
      ->required()
      ->type_name("OUT.bt");
  command->add_flag("--json", flags->json, "print a summary of the file as JSON");
  command->callback([flags] { crop(*flags); });
}

}  // namespace hamelin::app
