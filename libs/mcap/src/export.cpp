#include "hamelin/mcap/export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "arm_messages.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/simulation/replay.hpp"
#include "sampler.hpp"
#include "scenery.hpp"
#include "state_messages.hpp"
#include "topics.hpp"

namespace hamelin::mcap {

namespace {

constexpr double time_max_s = 1e9;  // in nanoseconds, this fits 64 bits

std::vector<std::string> series_names(const Json& header) {
  std::vector<std::string> names;
  for (const auto& series : header.value("series", Json::array()))
    names.push_back(series["name"].get<std::string>());
  return names;
}

Eigen::VectorXd vector_of(const Json& numbers) {
  Eigen::VectorXd x(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i)
    x[static_cast<Eigen::Index>(i)] = numbers[i].get<double>();
  return x;
}

std::size_t goal_index_of(const Json& tick) {
  const Json index = tick.value("goal_index", Json());
  return index.is_number_unsigned() ? index.get<std::size_t>() : 0;
}

std::optional<Json> target_transform(std::uint64_t time_ns, const Json& tick) {
  const auto target = tick.find("target");
  if (target == tick.end()) return std::nullopt;
  const Eigen::VectorXd position = vector_of((*target)["position_m"]),
                        wxyz = vector_of((*target)["quaternion_wxyz"]);
  return frame_transform(time_ns, world_frame, target_frame,
                         {geometry::rotation_from_wxyz(wxyz), position});
}

/// Sends the messages of one run.
class Run {
 public:
  Run(const Json& header, const simulation::Recorded& recorded, const model::Model& model,
      Writer& writer)
      : series_(series_names(header)),
        arm_(recorded.scene, model),
        scenery_(recorded.scene, model, simulation::has_original_map(recorded)),
        topics_(writer) {
    for (const auto& link : model.robot().links) joints_.push_back(link.joint.name);
  }

  void send_sample(const log::Trajectory::Point& point, const Json& tick) {
    const std::uint64_t now = advance(point.time_s);
    if (samples_++ == 0) send_start(now, point.time_s);
    end_s_ = point.time_s;
    Json transforms = Json::array();
    arm_.add_transforms(now, point.q, transforms);
    scenery_.add_transforms(now, point.time_s, transforms);
    if (const auto target = target_transform(now, tick)) transforms.push_back(*target);
    topics_.send(Topic::transforms, now, {{"transforms", std::move(transforms)}});
    topics_.send(Topic::joints, now, joint_states(now, joints_, point));
    topics_.send(Topic::state, now, state(now, tick, series_));
    send_changed(Topic::map, now, scenery_.map(now, point.time_s));
    send_changed(Topic::obstacles, now, scenery_.obstacles(now, point.time_s));
    send_changed(Topic::goals, now, scenery_.goals(now, goal_index_of(tick)));
  }

  /// @param time_s at least that of the last sample; infinite: at its time
  void send_line(double time_s, const Json& line) {
    const std::uint64_t now = std::isfinite(time_s) ? advance(time_s) : now_;
    if (line["type"] == "tick") return send_drawing(now, line["paths"]);
    topics_.send(Topic::log, now, log_entry(now, line));
    if (line["type"] != "event") return;
    if (line["text"] == "the map changes") scenery_.change_map();
    const bool attached = line.contains("attached");
    if (!attached && !line.contains("detached")) return;
    if (attached) {
      arm_.attach(line["attached"].get<std::string>());
      scenery_.take_up(line["attached"].get<std::string>());
    } else {
      arm_.detach(line["detached"].get<std::string>(), vector_of(line.value("q", Json::array())));
    }
    topics_.send(Topic::arm, now, arm_.shapes(now));
  }

  [[nodiscard]] std::size_t samples() const noexcept { return samples_; }
  [[nodiscard]] double begin_s() const noexcept { return begin_s_; }
  [[nodiscard]] double end_s() const noexcept { return end_s_; }

 private:
  /// Times in nanoseconds do not decrease, whatever is rounded.
  std::uint64_t advance(double time_s) {
    return now_ = std::max(now_, static_cast<std::uint64_t>(std::llround(1e9 * time_s)));
  }

  void send_start(std::uint64_t now, double time_s) {
    begin_s_ = time_s;
    Json transforms = Json::array();
    scenery_.add_static_transforms(now, transforms);
    topics_.send(Topic::static_transforms, now, {{"transforms", std::move(transforms)}});
    topics_.send(Topic::arm, now, arm_.shapes(now));
  }

  void send_changed(Topic topic, std::uint64_t now, const std::optional<Json>& update) {
    if (update) topics_.send(topic, now, *update);
  }

  void send_drawing(std::uint64_t now, const Json& paths) {
    constexpr Color color{0.55, 0.35, 0.8};
    Entity entity(now, world_frame, "drawing");
    for (const Json& path : paths) {
      std::vector<Eigen::Vector3d> points;
      for (std::size_t i = 0; i + 2 < path.size(); i += 3)
        points.emplace_back(path[i].get<double>(), path[i + 1].get<double>(),
                            path[i + 2].get<double>());
      entity.add_path(points, color);
    }
    topics_.send(Topic::drawing, now, scene_update(now, {entity}));
  }

  std::vector<std::string> joints_, series_;
  ArmMessages arm_;
  Scenery scenery_;
  Topics topics_;
  std::uint64_t now_ = 0;
  std::size_t samples_ = 0;
  double begin_s_ = 0.0, end_s_ = 0.0;
};

std::vector<std::string> notes_of(const simulation::Recorded& recorded) {
  std::vector<std::string> notes;
  for (const auto& changed : recorded.changed) notes.push_back(changed.text);
  const auto& map = recorded.scene.map;
  if (map && !map->file.empty() && !simulation::has_original_map(recorded))
    notes.push_back("without the map of the run the file has no map");
  return notes;
}

// Checks what the schema of lines does not.
void check_values(const Json& line, const std::string& where) {
  const Json time = line.value("time_s", Json());
  if (time.is_number() && !(time.get<double>() >= 0.0 && time.get<double>() <= time_max_s))
    throw Error(ErrorCode::invalid, fmt::format("{}: /time_s: {} s, expected 0 to {:g} s", where,
                                                time.get<double>(), time_max_s));
  const Json target = line.value("target", Json());
  if (!target.is_object()) return;
  if (const double norm = vector_of(target["quaternion_wxyz"]).norm(); std::abs(norm - 1.0) > 1e-6)
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: /target/quaternion_wxyz: has the norm {}, expected 1", where, norm));
}

// Passes on all lines of the log in the order of their times.
void read_lines(log::TickReader& reader, Sampler& sampler) {
  while (reader.next()) {
    const Json& line = reader.line();
    const std::string where = reader.lines().where();
    if (const auto* point = reader.point()) {
      check_values(line, where);
      sampler.add_tick(*point, line);
      // A drawing is kept even if no sample falls on its tick.
      if (line.contains("paths")) sampler.add_line(line);
      continue;
    }
    log::check_line(line, where);
    check_values(line, where);
    sampler.add_line(line);
  }
  sampler.finish();
}

}  // namespace

ExportSummary export_log(const std::filesystem::path& log, std::optional<double> rate_hz,
                         const Writer::Sink& sink) {
  log::TickReader reader(log);
  const simulation::Recorded recorded = simulation::read_header(reader.header(), log);
  const model::Model model = control::load_model(recorded.scene);
  simulation::check_joints(reader.header(), recorded, model.robot());
  Writer writer(sink, fmt::format("hamelin {}", version()));
  Run run(reader.header(), recorded, model, writer);
  Sampler sampler(rate_hz,
                  {[&](const auto& point, const Json& tick) { run.send_sample(point, tick); },
                   [&](double time_s, const Json& line) { run.send_line(time_s, line); }});
  read_lines(reader, sampler);
  if (run.samples() == 0)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no ticks, expected a motion", log.string()));
  writer.finish();

  ExportSummary summary{writer.messages(), run.samples(), run.begin_s(), run.end_s(),
                        notes_of(recorded)};
  if (reader.lines().cut())
    summary.notes.push_back("the log ends in the middle of a line or frame, which is omitted");
  return summary;
}

}  // namespace hamelin::mcap
