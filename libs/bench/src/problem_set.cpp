#include "hamelin/bench/problem_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "hamelin/bench/families.hpp"
#include "hamelin/bench/moving.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "problem_files.hpp"

namespace hamelin::bench {

namespace fs = std::filesystem;

namespace {

Json primitive_json(const scene::Obstacle& o) {
  const Eigen::Vector3d& p = o.pose.p();
  Json out{{"name", o.name}, {"type", to_string(o.shape)}, {"position", list(p)}};
  if (o.shape != scene::Shape::sphere) out["quaternion_wxyz"] = o.quaternion_wxyz;
  if (o.shape == scene::Shape::box)
    out["size"] = list(o.size_m);
  else
    out["radius"] = o.radius_m;
  if (o.shape == scene::Shape::cylinder) out["length"] = o.length_m;
  return out;
}

Json problem_entry(const Problem& problem) {
  Json path = Json::array();
  for (Eigen::Index i = 0; i < problem.path.cols(); ++i) path.push_back(list(problem.path.col(i)));
  const bool moving = is_moving(problem.family);
  Json entry{{"name", problem.name},
             {"family", problem.family},
             {"seed", problem.seed},
             {"sha256", problem.sha256}};
  if (!moving) entry["map_sha256"] = problem.map_sha256;
  entry["path"] = std::move(path);
  if (moving) {
    entry["obstacles"] = problem.obstacles;
    entry["speed_max_m_s"] = problem.speed_max_m_s;
  }
  return entry;
}

Eigen::MatrixXd path_from(const Json& points, const std::string& where) {
  const std::size_t dof = points.at(0).size();
  Eigen::MatrixXd path(static_cast<Eigen::Index>(dof), static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto q = points[i].get<std::vector<double>>();
    if (q.size() != dof)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}/{}: {} values given, expected {} as in the first way-point",
                              where, i, q.size(), dof));
    path.col(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(dof));
  }
  return path;
}

// A problem has either a map, or obstacles that move.
void check_kind(const Problem& problem, const std::string& place) {
  if (is_moving(problem.family) != problem.map_sha256.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}/map_sha256: is {}, expected {} of the family '{}'", place,
                            problem.map_sha256.empty() ? "missing" : "given",
                            is_moving(problem.family) ? "none" : "that", problem.family));
}

std::string path_from_directory(const fs::path& file, const fs::path& directory) {
  return fs::proximate(file, directory.empty() ? "." : directory).generic_string();
}

// Reads the path of a file and checks that its content is the one that the set was drawn for.
fs::path checked_file(const Json& robot, const char* key, const fs::path& set) {
  fs::path file = resolve_path(set.parent_path(), robot.at(key).get<std::string>());
  const std::string expected = robot.at(fmt::format("{}_sha256", key)).get<std::string>();
  if (const std::string found = sha256_of_file(file); found != expected)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: SHA-256 is {}, expected {}, the robot of the problems of {}",
                            file.string(), found, expected, set.string()));
  return file;
}

}  // namespace

std::string to_text(const ProblemSet& set, const fs::path& directory) {
  Json robot{{"file", path_from_directory(set.robot.robot, directory)},
             {"file_sha256", sha256_of_file(set.robot.robot)}};
  if (!set.robot.spheres.empty()) {
    robot["spheres"] = path_from_directory(set.robot.spheres, directory);
    robot["spheres_sha256"] = sha256_of_file(set.robot.spheres);
  }
  if (!set.robot.tip.empty()) robot["tip"] = set.robot.tip;
  const DrawCounts& drawn = set.drawn;
  Json head{{"schema", "hamelin.problems/1"}, {"name", set.name}, {"robot", std::move(robot)}};
  if (set.resolution_m > 0.0) head["resolution_m"] = set.resolution_m;
  head["clearance_m"] = set.clearance_m;
  head["self_clearance_m"] = set.self_clearance_m;
  head["drawn"] = {{"candidates", drawn.candidates},
                   {"no_start_or_goal", drawn.no_start_or_goal},
                   {"straight_is_free", drawn.straight_is_free},
                   {"path_unknown", drawn.path_unknown}};
  if (drawn.no_room > 0) head["drawn"]["no_room"] = drawn.no_room;
  // One line per problem.
  std::string text = head.dump(1);
  text.erase(text.rfind('\n'));
  text += ",\n \"problems\": [";
  for (std::size_t i = 0; i < set.problems.size(); ++i)
    text += (i > 0 ? ",\n  " : "\n  ") + problem_entry(set.problems[i]).dump();
  return text + "\n ]\n}\n";
}

ProblemSet read_problem_set(const fs::path& file) {
  const std::string text = read_file(file), where = file.string();
  const Json document = parse_json(text, where);
  check_shipped_schema(document, "problems", where);
  ProblemSet set;
  set.sha256 = sha256_hex(text);
  set.name = document["name"];
  const Json& robot = document["robot"];
  set.robot.robot = checked_file(robot, "file", file);
  if (robot.contains("spheres")) set.robot.spheres = checked_file(robot, "spheres", file);
  set.robot.tip = robot.value("tip", "");
  set.resolution_m = document.value("resolution_m", 0.0);
  set.clearance_m = document["clearance_m"];
  set.self_clearance_m = document["self_clearance_m"];
  const Json& drawn = document["drawn"];
  set.drawn = {drawn["candidates"], drawn["no_start_or_goal"], drawn["straight_is_free"],
               drawn["path_unknown"], drawn.value("no_room", std::uint64_t{0})};
  std::map<std::string, std::size_t> names;
  for (std::size_t i = 0; i < document["problems"].size(); ++i) {
    const Json& from = document["problems"][i];
    const std::string place = fmt::format("{}: /problems/{}", where, i);
    Problem problem;
    problem.name = from["name"];
    if (!names.emplace(problem.name, i).second)
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}/name: '{}' occurs twice, expected unique names", place, problem.name));
    problem.family = from["family"];
    if (!is_moving(problem.family)) (void)describe(problem.family);
    problem.seed = from["seed"];
    problem.path = path_from(from["path"], place + "/path");
    problem.sha256 = from["sha256"];
    problem.map_sha256 = from.value("map_sha256", "");
    problem.obstacles = from.value("obstacles", std::size_t{0});
    problem.speed_max_m_s = from.value("speed_max_m_s", 0.0);
    check_kind(problem, place);
    set.problems.push_back(std::move(problem));
  }
  return set;
}

std::string problem_text(const Problem& problem) {
  Json document{{"units", "m,rad"},
                {"family", problem.family},
                {"start", list(problem.path.leftCols(1))},
                {"goal", list(problem.path.rightCols(1))},
                {"obstacles", Json::array()}};
  for (const auto& obstacle : make_layout(problem.family, problem.seed).obstacles)
    document["obstacles"].push_back(primitive_json(obstacle));
  return document.dump(1) + "\n";
}

std::vector<Problem> select(const ProblemSet& set, const Selection& selection) {
  const auto& wanted = selection.families;
  std::vector<std::string> present;
  for (const auto& problem : set.problems)
    if (std::find(present.begin(), present.end(), problem.family) == present.end())
      present.push_back(problem.family);
  for (const auto& family : wanted)
    if (std::find(present.begin(), present.end(), family) == present.end())
      throw Error(ErrorCode::usage, fmt::format("--family {}: the set has no such family, expected "
                                                "one of {}",
                                                family, fmt::join(present, ", ")));
  std::vector<Problem> selected;
  std::map<std::string, std::size_t> of_family, of_cell;
  for (const auto& problem : set.problems) {
    const bool has_family =
        wanted.empty() || std::find(wanted.begin(), wanted.end(), problem.family) != wanted.end();
    const std::string cell =
        fmt::format("{} {} {}", problem.family, problem.obstacles, problem.speed_max_m_s);
    if (has_family && of_family[problem.family] < selection.per_family &&
        of_cell[cell] < selection.per_cell) {
      ++of_family[problem.family];
      ++of_cell[cell];
      selected.push_back(problem);
    }
  }
  return selected;
}

void check_made(const Problem& problem, const std::string& text, const std::string& where) {
  if (const std::string made = sha256_hex(text); made != problem.sha256)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: problem '{}': this build makes it with SHA-256 {}, expected {}",
                            where, problem.name, made, problem.sha256));
}

void make_directory(const fs::path& directory) {
  std::error_code ec;
  fs::create_directories(directory, ec);
  if (ec)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be created: {}", directory.string(), ec.message()));
}

std::vector<fs::path> write_problems(const std::vector<Problem>& problems,
                                     const fs::path& directory, const std::string& where) {
  std::vector<std::string> texts;
  for (const auto& problem : problems) {
    texts.push_back(problem_text(problem));
    check_made(problem, texts.back(), where);
  }
  make_directory(directory);
  std::vector<fs::path> files;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    files.push_back(directory / (problems[i].name + ".json"));
    write_file_atomically(files.back(), texts[i]);
  }
  return files;
}

void check_maps(const std::vector<Problem>& problems, const sweep::Plan& plan,
                const std::string& where) {
  std::map<std::string, std::string> hashes;
  for (const auto& input : plan.inputs) hashes[fs::path(input.file).filename()] = input.sha256;
  for (const auto& problem : problems)
    if (const std::string& made = hashes[problem.name + ".bt"]; made != problem.map_sha256)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: the map of problem '{}' is made with SHA-256 {}, expected {}",
                              where, problem.name, made, problem.map_sha256));
}

}  // namespace hamelin::bench
