#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <memory>
#include <optional>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/scene/modelled.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/simulation/run.hpp"
#include "scene_map.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

// `scene info` shows distances up to this; it loads no planner that could set another range.
constexpr double shown_influence_m = 0.2;

struct SceneInfoOptions {
  std::filesystem::path file;
  MapInfoOptions map;
  bool json = false;
};

struct MakeOptions {
  std::optional<std::filesystem::path> problem, primitives, robot, spheres;
  std::optional<double> resolution_m;
  std::string tip, mark, goal;
  std::size_t clutter = 0;
  std::uint64_t seed = 1;
  std::string sizes = "0.05,0.2", bounds = "-0.8,-0.8,0,0.8,0.8,1.2";
  std::vector<std::string> keep_out;
  std::filesystem::path output;
  bool json = false;
};

/// The distances of the arm from its obstacles and from itself, at a configuration at time zero.
class ArmClearance {
 public:
  ArmClearance(const scene::Scene& scene, const model::Model& model,
               const scene::Environment& environment)
      : model_(model),
        environment_(environment),
        ws_(model),
        scratch_(environment, model.shapes().size()),
        arm_(model) {
    if (scene.model.self_collision) self_.emplace(model);
  }

  [[nodiscard]] const std::optional<scene::SelfField>& self() const { return self_; }

  void place_at(const Eigen::VectorXd& q) {
    dynamics::forward_kinematics(model_, ws_, q);
    arm_.place(model_, ws_);
  }

  [[nodiscard]] double clearance() const {
    return environment_.clearance(arm_.view(), 0.0, shown_influence_m);
  }

  /// The closest two parts of the arm; empty if no two parts can touch.
  [[nodiscard]] std::optional<scene::SelfContact> closest_parts() const {
    std::array<scene::SelfContact, 1> nearest;
    if (self_->closest(arm_.view(), std::numeric_limits<double>::infinity(), nearest) == 0)
      return std::nullopt;
    return nearest[0];
  }

  /// Adds a note on the arm's deepest contact with an obstacle, and one on that with itself.
  /// @param moving whether moving obstacles count
  void note_contacts(const std::string& place, bool moving, Json& notes) {
    std::vector<scene::Contact> contacts(environment_.contacts_max(model_.shapes().size()));
    contacts.resize(std::min(contacts.size(), environment_.closest(arm_.view(), 0.0, 0.0, scratch_,
                                                                   contacts, scene::View::judge)));
    const scene::Contact* deepest = nullptr;
    for (const auto& contact : contacts) {
      const bool moves =
          contact.obstacle >= 0 &&
          environment_.obstacles()[static_cast<std::size_t>(contact.obstacle)].motion.has_value();
      if ((moving || !moves) && (deepest == nullptr || contact.distance < deepest->distance))
        deepest = &contact;
    }
    if (deepest != nullptr)
      notes.push_back(fmt::format("{}: {}; the exit direction is {}", place,
                                  environment_.describe(*deepest, model_),
                                  scene::describe_exit_direction(*deepest)));
    if (!self_) return;
    if (const auto nearest = closest_parts(); nearest && nearest->distance <= 0.0)
      notes.push_back(fmt::format("{}: the arm touches itself: {} are {:.2g} mm inside each other",
                                  place, self_->describe(nearest->pair), -1e3 * nearest->distance));
  }

 private:
  const model::Model& model_;
  const scene::Environment& environment_;
  dynamics::Workspace ws_;
  scene::Environment::Scratch scratch_;
  std::optional<scene::SelfField> self_;
  scene::PlacedShapes arm_;
};

// The map of a scene, as `scene info` describes it.
Json map_json(const scene::Scene& scene, const scene::Environment& environment, double reach_m) {
  const auto& summary = environment.summary();
  const scene::Shares shares = summary.within_reach
                                   ? *summary.within_reach
                                   : scene::shares_within_reach(*scene.map, scene.base, reach_m);
  Json map{{"file", summary.map_file},
           {"sha256", summary.map_sha256},
           {"resolution_m", summary.resolution_m},
           {"nodes", summary.nodes},
           {"occupied_leaves", summary.leaves},
           {"free_leaves", summary.free_leaves},
           {"unknown", scene::to_string(summary.unknown)},
           {"self_filter", nullptr}};
  map["within_reach"] = {{"reach_m", reach_m},
                         {"occupied_share", shares.occupied},
                         {"free_share", shares.free},
                         {"unknown_share", shares.unknown},
                         {"occupied_leaves", summary.leaves_cropped},
                         {"boxes", summary.boxes},
                         {"unknown_boxes", summary.unknown_boxes},
                         {"structure_bytes", environment.map_field().bytes()}};
  if (summary.self_filter_padding_m)
    map["self_filter"] = {{"padding_m", *summary.self_filter_padding_m},
                          {"occupied_voxels", summary.self_filter_voxels},
                          {"occupied_leaves", summary.self_filter_leaves},
                          {"unknown_voxels", summary.self_filter_unknown_voxels}};
  return map;
}

Json scene_info(const std::filesystem::path& file) {
  const scene::Scene scene = scene::read_scene(file);
  const model::Model model = control::load_model(scene);
  const auto begin = std::chrono::steady_clock::now();
  const auto environment = scene::make_environment(scene, model, shown_influence_m);
  const double build_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  const auto& summary = environment.summary();
  Json goals = Json::array();
  for (const auto& goal : scene.goals) goals.push_back(scene::type_name(goal));
  Json info{{"file", file.string()},
            {"kind", "scene"},
            {"robot", model.robot().name},
            {"dof", model.dof()},
            {"spheres", model.shapes().size()},
            {"reach_m", model.reach()},
            {"goals", goals},
            {"planner", scene.planner ? Json(scene.planner->name) : Json(nullptr)},
            {"integrator", scene.integrator.name},
            {"model", scene::modelled_info(scene, model)},
            {"obstacles", summary.obstacles},
            {"map", nullptr},
            {"clearance_at_start_m", nullptr},
            {"self_clearance_at_start_m", nullptr},
            {"timing", {{"build_ms", build_ms}}},
            {"warnings", summary.warnings}};
  if (summary.has_map) info["map"] = map_json(scene, environment, model.reach());
  const auto check_size = [&](const Eigen::VectorXd& q, const std::string& place) {
    if (q.size() != model.dof())
      throw Error(ErrorCode::invalid, fmt::format("{}: {}: {} values given, expected {}",
                                                  file.string(), place, q.size(), model.dof()));
  };
  if (scene.start_q.size() > 0) check_size(scene.start_q, "/start/q");
  if (scene.start_v.size() > 0) check_size(scene.start_v, "/start/v");
  if (const std::string defect = scene::start_defect(scene, model); !defect.empty())
    info["warnings"].push_back(defect);
  if (model.shapes().empty()) return info;
  ArmClearance arm(scene, model, environment);
  const Eigen::VectorXd q =
      scene.start_q.size() > 0 ? scene.start_q : Eigen::VectorXd::Zero(model.dof());
  arm.place_at(q);
  if (environment.has_obstacles()) info["clearance_at_start_m"] = arm.clearance();
  if (arm.self()) {
    if (!arm.self()->note().empty()) info["warnings"].push_back(arm.self()->note());
    if (const auto nearest = arm.closest_parts())
      info["self_clearance_at_start_m"] = nearest->distance;
  }
  arm.note_contacts("start", true, info["warnings"]);
  for (std::size_t i = 0; i < scene.goals.size(); ++i) {
    if (scene.goals[i].type != scene::GoalType::joint) continue;
    check_size(scene.goals[i].q, fmt::format("/goals/{}/q", i));
    arm.place_at(scene.goals[i].q);
    // Where moving obstacles will be at arrival is not known.
    arm.note_contacts(fmt::format("goal {}", i + 1), false, info["warnings"]);
  }
  return info;
}

std::string scene_text(const Json& info) {
  const auto text_of = [](const Json& value) {
    return value.is_null() ? "none" : value.get<std::string>();
  };
  std::string out =
      fmt::format("{}: scene of '{}', {} joints, {} collision shapes, reach {:.4g} m\n",
                  text_of(info["file"]), text_of(info["robot"]), info["dof"].dump(),
                  info["spheres"].dump(), info["reach_m"].get<double>());
  std::string goals;
  for (const auto& goal : info["goals"]) goals += (goals.empty() ? "" : ", ") + text_of(goal);
  out += info_line("goals", goals.empty() ? "none" : goals);
  out += info_line("planner", fmt::format("{}; integrator {}", text_of(info["planner"]),
                                          text_of(info["integrator"])));
  const char* label = "model";
  for (const auto& line : scene::describe_modelled(info["model"])) {
    out += info_line(label, line);
    label = "";
  }
  out += info_line("obstacles", fmt::format("{} besides the map", info["obstacles"].dump()));
  if (const Json& map = info["map"]; !map.is_null()) {
    const Json& near = map["within_reach"];
    out += info_line("map", fmt::format("{}, voxels of {:.4g} m, {} occupied leaves, {} free",
                                        text_of(map["file"]), map["resolution_m"].get<double>(),
                                        map["occupied_leaves"].dump(), map["free_leaves"].dump()));
    out +=
        info_line("within reach",
                  fmt::format("{} occupied, {} free, {} unknown (treated as {})",
                              percent(near["occupied_share"]), percent(near["free_share"]),
                              percent(near["unknown_share"]),
                              map["unknown"] == "block" ? "an obstacle" : text_of(map["unknown"])));
    if (const Json& filter = map["self_filter"]; !filter.is_null())
      out += info_line(
          "self-filter",
          fmt::format(
              "{} occupied voxels of {} leaves and {} unknown voxels removed, within {:.3g} m of "
              "the robot at its start",
              filter["occupied_voxels"].dump(), filter["occupied_leaves"].dump(),
              filter["unknown_voxels"].dump(), filter["padding_m"].get<double>()));
    out +=
        info_line("structure", fmt::format("{} boxes of {} leaves, {}; read and built in {:.3g} ms",
                                           near["boxes"].dump(), near["occupied_leaves"].dump(),
                                           bytes_text(near["structure_bytes"].get<std::size_t>()),
                                           info["timing"]["build_ms"].get<double>()));
  }
  const auto clearance = [&](const char* label, const Json& distance) {
    if (!distance.is_null())
      out += info_line(label, fmt::format("{:.4g} m at the start", distance.get<double>()));
  };
  clearance("clearance", info["clearance_at_start_m"]);
  clearance("self-distance", info["self_clearance_at_start_m"]);
  return out;
}

void print_scene_info(const SceneInfoOptions& options) {
  const Kind kind = kind_of(options.file);
  if (kind != Kind::map && kind != Kind::scene)
    throw Error(ErrorCode::usage, fmt::format("{}: is a {}, expected a map or a scene",
                                              options.file.string(), to_string(kind)));
  const MapInfoOptions& of_map = options.map;
  if (kind == Kind::scene &&
      (of_map.scale || of_map.threshold || of_map.reach || !of_map.base.empty()))
    throw Error(
        ErrorCode::usage,
        "scene info: --scale, --threshold, --base and --reach apply to a map; a scene has its own");
  const Json document =
      kind == Kind::map ? map_info(options.file, of_map) : scene_info(options.file);
  if (options.json) {
    print_json(document);
    return;
  }
  fmt::print("{}", kind == Kind::map ? map_text(document) : scene_text(document));
  for (const auto& warning : document["warnings"]) note(warning.get<std::string>());
}

scene::Clutter clutter_of(const MakeOptions& options) {
  scene::Clutter clutter;
  clutter.count = options.clutter;
  clutter.seed = options.seed;
  const auto sizes = number_list("--sizes", options.sizes, 2);
  clutter.size_min_m = sizes[0];
  clutter.size_max_m = sizes[1];
  const auto b = number_list("--bounds", options.bounds, 6);
  clutter.bounds.lo = {b[0], b[1], b[2]};
  clutter.bounds.hi = {b[3], b[4], b[5]};
  for (const auto& text : options.keep_out) {
    const auto k = number_list("--keep-out", text, 4);
    clutter.keep_out.push_back({{k[0], k[1], k[2]}, k[3]});
  }
  return clutter;
}

scene::MakeReport make_map(const MakeOptions& options) {
  scene::MakeMapOptions make;
  if (options.primitives)
    make =
        scene::make_options_from_json(read_json(*options.primitives), options.primitives->string());
  if (options.clutter > 0) {
    make.clutter = clutter_of(options);
    if (!make.free_bounds) make.free_bounds = make.clutter->bounds;
  }
  if (options.resolution_m) make.resolution_m = *options.resolution_m;
  if (!options.mark.empty()) make.mark = scene::mark_from(options.mark);
  make.output = options.output;
  return scene::make_map(make);
}

scene::MakeReport make_scene(const MakeOptions& options) {
  if (!options.robot)
    throw Error(ErrorCode::usage,
                "scene make: --robot is missing, expected the robot of the problem");
  scene::ProblemOptions make;
  make.robot = *options.robot;
  make.spheres = options.spheres.value_or("");
  make.tip = options.tip;
  if (options.resolution_m) make.resolution_m = *options.resolution_m;
  if (!options.mark.empty()) make.mark = scene::mark_from(options.mark);
  if (options.goal == "position") make.goal = scene::GoalType::position;
  if (options.goal == "pose") make.goal = scene::GoalType::pose;
  make.output = options.output;
  return scene::make_scene_from_problem(*options.problem, make);
}

void make(const MakeOptions& options) {
  const bool map = options.primitives || options.clutter > 0;
  if (map == options.problem.has_value())
    throw Error(ErrorCode::usage,
                "scene make: expected either a problem, or --primitives or --clutter");
  if (map && !options.goal.empty())
    throw Error(ErrorCode::usage, "scene make: --goal applies to a problem; a map has no goal");
  const auto made = map ? make_map(options) : make_scene(options);
  if (options.json)
    print_json({{"file", made.output.string()},
                {"primitives", made.primitives},
                {"occupied_voxels", made.occupied_voxels},
                {"free_voxels", made.free_voxels},
                {"nodes", made.nodes},
                {"bytes", made.bytes},
                {"sha256", made.sha256}});
  else
    report(fmt::format(
        "{}: {} primitives, {} occupied voxels, {} free, {} nodes, {} bytes, sha256 {}\n",
        made.output.string(), made.primitives, made.occupied_voxels, made.free_voxels, made.nodes,
        made.bytes, made.sha256));
}

void add_scene_info(CLI::App& scene) {
  auto* info_command =
      add_command(scene, "info",
                  "Print what a map or a scene contains, and the clearance of an arm at its start",
                  "hamelin scene info data/scenes/shelf.json\n"
                  "hamelin scene info data/maps/clutter.bt --base 0,0,0.3 --reach 0.9\n"
                  "hamelin scene info data/maps/clutter.bt --json");
  const auto info_options = std::make_shared<SceneInfoOptions>();
  info_command->add_option("file", info_options->file, "map (.bt, .ot) or scene file")
      ->required()
      ->type_name("MAP_OR_SCENE");
  MapInfoOptions& of_map = info_options->map;
  info_command->add_option("--scale", of_map.scale, "metres per unit of the map")->type_name("S");
  info_command
      ->add_option("--threshold", of_map.threshold,
                   "occupancy probability from which a leaf of a .ot map is occupied (default 0.5)")
      ->type_name("P");
  info_command
      ->add_option("--base", of_map.base,
                   "base of an arm in the map's frame [m] (default the centre of the occupied "
                   "region, or the origin "
                   "if --reach is given)")
      ->type_name("X,Y,Z");
  info_command
      ->add_option("--reach", of_map.reach,
                   "reach of the arm [m] (default up to the farthest occupied leaf)")
      ->type_name("R");
  info_command->add_flag("--json", info_options->json, "print JSON");
  info_command->callback([info_options] { print_scene_info(*info_options); });
}

void add_scene_make(CLI::App& scene) {
  auto* make_command = add_command(
      scene, "make", "Make an OctoMap from primitives or random clutter, or a scene from a problem",
      "hamelin scene make --primitives data/maps/shelf.primitives.json -o shelf.bt\n"
      "hamelin scene make --clutter 30 --seed 4 --keep-out 0,0,0.3,0.4 -o clutter.bt\n"
      "hamelin scene make problem.json --robot arm.urdf --spheres s.json --goal pose -o "
      "scene.json");
  const auto options = std::make_shared<MakeOptions>();
  make_command->add_option("problem", options->problem, "MotionBenchMaker problem")
      ->type_name("PROBLEM.json");
  make_command
      ->add_option(
          "--primitives", options->primitives,
          "file of spheres, boxes, cylinders and capsules (see `hamelin schema print primitives`)")
      ->type_name("FILE.json");
  make_command->add_option("--clutter", options->clutter, "number of random primitives")
      ->type_name("N")
      ->check(unsigned_range());
  make_command->add_option("--seed", options->seed, "seed of the clutter (default 1)")
      ->type_name("S")
      ->check(unsigned_range());
  make_command
      ->add_option("--sizes", options->sizes,
                   "smallest and largest edge of a random primitive [m] (default 0.05,0.2)")
      ->type_name("A,B");
  make_command
      ->add_option("--bounds", options->bounds,
                   "lower and upper corner of the clutter [m] (default -0.8,-0.8,0,0.8,0.8,1.2)")
      ->type_name("X,Y,Z,X,Y,Z");
  make_command
      ->add_option("--keep-out", options->keep_out,
                   "centre and radius of a ball that stays free of clutter [m]; may be repeated")
      ->type_name("X,Y,Z,R")
      ->allow_extra_args(false);
  make_command->add_option("--robot", options->robot, "robot file of the problem")
      ->type_name("FILE");
  make_command->add_option("--spheres", options->spheres, "collision spheres of the robot")
      ->type_name("FILE.json");
  make_command->add_option("--tip", options->tip, "tip link of the robot")->type_name("LINK");
  restrict_values(make_command->add_option(
                      "--goal", options->goal,
                      "goal of the scene: the joint vector of the problem, or the position or "
                      "pose of the tip there (default joint)"),
                  {"joint", "position", "pose"});
  make_command
      ->add_option("--resolution", options->resolution_m,
                   "edge of a voxel [m] (default the file's, or 0.02)")
      ->type_name("R");
  restrict_values(
      make_command->add_option("--mark", options->mark,
                               "mark voxels that a primitive touches, or whose centre it contains "
                               "(default touch)"),
      {"touch", "centre"});
  make_command->add_option("-o,--output", options->output, "map (.bt) or scene (.json) to write")
      ->required()
      ->type_name("FILE");
  make_command->add_flag("--json", options->json, "print a summary of the file as JSON");
  make_command->callback([options] { make(*options); });
}

void add_scene(CLI::App& app, int&) {
  auto* scene =
      add_command(app, "scene", "Inspect, crop and make scenes and maps",
                  "hamelin scene info data/maps/shelf.bt\n"
                  "hamelin scene crop --scene data/scenes/shelf.json -o near.bt\n"
                  "hamelin scene make --primitives data/maps/shelf.primitives.json -o shelf.bt");
  scene->require_subcommand(1);

  add_scene_info(*scene);
  add_scene_crop(*scene);
  add_scene_make(*scene);
}

const RegisteredCommand registered_scene("scene", add_scene);

}  // namespace

}  // namespace hamelin::app
