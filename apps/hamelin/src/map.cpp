#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sensing/point_file.hpp"
#include "map_maker.hpp"
#include "output.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct PointsOptions {
  std::vector<std::filesystem::path> files;
  std::filesystem::path output;
  std::optional<std::filesystem::path> poses;
  std::string origin;
  double resolution_m = 0.01;
  std::optional<double> range_m;
  bool json = false;
};

scene::MapFormat format_of(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".bt") return scene::MapFormat::bt;
  if (ending == ".ot") return scene::MapFormat::ot;
  throw Error(ErrorCode::usage,
              fmt::format("--output: {} ends in '{}', expected .bt or .ot", file.string(), ending));
}

// Where each file's points were seen from: its pose in the map, or the place alone.
std::vector<geometry::SE3> poses_of(const PointsOptions& options) {
  std::vector<geometry::SE3> poses = sensing::read_poses(*options.poses);
  if (poses.size() != options.files.size())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: {} poses, expected {} (one per file)", options.poses->string(),
                            poses.size(), options.files.size()));
  return poses;
}

void from_points(const PointsOptions& options) {
  const scene::MapFormat format = format_of(options.output);
  if (options.poses && !options.origin.empty())
    throw Error(ErrorCode::usage,
                "--origin: is given in addition to --poses, expected one of them");
  std::vector<std::filesystem::path> inputs = options.files;
  if (options.poses) inputs.push_back(*options.poses);
  const auto target = output_target(options.output, inputs);
  const std::vector<geometry::SE3> poses =
      options.poses ? poses_of(options) : std::vector<geometry::SE3>();
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  if (!options.origin.empty()) {
    const auto given = number_list("--origin", options.origin, 3);
    place = {given[0], given[1], given[2]};
  }
  MapMaker maker(options.resolution_m);
  std::size_t points = 0, not_finite = 0;
  for (std::size_t i = 0; i < options.files.size(); ++i) {
    sensing::PointFile frame = sensing::read_points(options.files[i]);
    Eigen::Vector3d origin = place;
    if (options.poses) {
      origin = poses[i].p();
      frame.points =
          ((poses[i].R() * frame.points.cast<double>()).colwise() + origin).cast<float>();
    } else if (options.origin.empty() && frame.viewpoint) {
      origin = frame.viewpoint->p();
    }
    try {
      maker.insert(frame.points, origin.cast<float>(),
                   options.range_m.value_or(std::numeric_limits<double>::infinity()));
    } catch (const Error& e) {
      throw Error(e.code(), fmt::format("{}: {}", options.files[i].string(), e.what()));
    }
    points += static_cast<std::size_t>(frame.points.cols());
    not_finite += frame.not_finite;
  }
  const std::string bytes = maker.bytes(format);
  write_file_atomically(target, bytes);
  if (options.json)
    print_json({{"file", options.output.string()},
                {"frames", options.files.size()},
                {"points", points},
                {"not_finite", not_finite},
                {"occupied_voxels", maker.occupied()},
                {"free_voxels", maker.free()},
                {"bytes", bytes.size()}});
  else
    report(fmt::format("{}: {} points of {} frames{}, {} occupied voxels, {} free, {} bytes\n",
                       options.output.string(), points, options.files.size(),
                       not_finite > 0 ? fmt::format(" ({} not finite)", not_finite) : "",
                       maker.occupied(), maker.free(), bytes.size()));
}

void add_from_points(CLI::App& map) {
  auto* command = add_command(map, "from-points", "Make an OctoMap of the points of a depth sensor",
                              "hamelin map from-points scan.ply --origin 0.2,0,0.9 -o cell.bt\n"
                              "hamelin map from-points f1.pcd f2.pcd --poses poses.txt -o cell.ot");
  const auto options = std::make_shared<PointsOptions>();
  command
      ->add_option(
          "file", options->files,
          "points of one frame each: .ply, .pcd, .npy, or text with three numbers per line")
      ->required()
      ->type_name("FILE...");
  command->add_option("-o,--output", options->output, "map to write, .bt or .ot")
      ->required()
      ->type_name("FILE");
  command
      ->add_option(
          "--poses", options->poses,
          "pose of the sensor in the map, one line per file: x y z qw qx qy qz; the points "
          "are in the sensor's frame")
      ->type_name("FILE");
  command
      ->add_option("--origin", options->origin,
                   "place of the sensor; points and place are in the map's frame [m] (default that "
                   "of a .pcd, or 0,0,0)")
      ->type_name("X,Y,Z");
  command->add_option("--resolution", options->resolution_m, "edge of a voxel [m] (default 0.01)")
      ->type_name("R");
  command
      ->add_option("--range", options->range_m,
                   "of points that are farther only the way up to there is free [m]")
      ->type_name("R");
  command->add_flag("--json", options->json, "print a summary as JSON");
  command->callback([options] { from_points(*options); });
}

void add_map(CLI::App& app, int&) {
  auto* map = add_command(app, "map", "Make maps of what sensors saw",
                          "hamelin map from-points scan.ply --origin 0.2,0,0.9 -o cell.bt\n"
                          "hamelin map from-points f1.pcd f2.pcd --poses poses.txt -o cell.ot");
  map->require_subcommand(1);
  add_from_points(*map);
}

const RegisteredCommand registered_map("map", add_map);

}  // namespace

}  // namespace hamelin::app
