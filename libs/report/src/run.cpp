#include "run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "log_fields.hpp"

namespace hamelin::report {

namespace {

using Eigen::VectorXd;

// Limits of the joint values, events and others in a page, for chains and logs of any length.
constexpr std::size_t joint_values_max = 200000, events_max = 2000, stops_max = 500,
                      stop_values_max = 20000, acts_max = 2000, drawn_points_max = 400000;

std::size_t frames_of(const Options& options, int dof) {
  return std::clamp<std::size_t>(joint_values_max / static_cast<std::size_t>(dof), 2,
                                 options.frames_max);
}

// A text of the result, which may be null.
Json text_or_null(const Json& result, const char* key) {
  const Json* at = result.is_object() ? find(result, key) : nullptr;
  return at != nullptr && at->is_string() ? *at : Json(nullptr);
}

}  // namespace

Run::Run(const Json& header, const simulation::Recorded& recorded, const World& world,
         const Options& options)
    : world_(world),
      recorded_(recorded),
      plots_(header, recorded_, world, options.plot_points_max),
      sample_(frames_of(options, world.model.dof())),
      stops_(std::clamp<std::size_t>(
          stop_values_max / static_cast<std::size_t>(2 * world.model.dof()), 1, stops_max)),
      acts_(acts_max),
      loads_(recorded.scene, world.model.robot().tip.pose),
      drawings_(drawn_points_max),
      config_(header["config"]),
      provenance_(header["provenance"]) {
  simulation::check_joints(header, recorded, world.model.robot());
  for (const auto& changed : recorded.changed) notes_.push_back(changed.text);
  if (recorded.every > 1)
    notes_.push_back(fmt::format(
        "the log has a tick every {} steps; clearance, energy error, updates, residual and "
        "the longest tick are over all steps",
        recorded.every));
}

void Run::add_line(Json line, const log::LogReader& reader) {
  const Json type = line.value("type", Json());
  if (!result_.is_null())
    throw line_error(reader, "follows the result, expected the end of the log");
  if (type == "tick") {
    add_tick(line, reader);
  } else if (type == "event") {
    add_event(line, reader);
  } else if (type == "result") {
    log::check_line(line, reader.where());
    line.erase("type");
    result_ = std::move(line);
  } else {
    throw line_error(reader, fmt::format("type {}, expected tick, event or result", type.dump()));
  }
}

void Run::add_event(const Json& line, const log::LogReader& reader) {
  const Json* text = find(line, "text");
  if (text == nullptr || !text->is_string())
    throw line_error(reader, "text: expected one line of text");
  const double t = number(line, "time_s", reader);
  const auto name_of = [&](const char* key) -> std::optional<std::string> {
    const Json* name = find(line, key);
    if (name == nullptr || std::isnan(t)) return std::nullopt;
    if (!name->is_string()) throw line_error(reader, fmt::format("{}: expected a name", key));
    return name->get<std::string>();
  };
  const VectorXd q = joint_vector(line, "q", world_.model.dof(), reader);
  if (const auto name = name_of("attached")) loads_.attach(*name, t);
  if (const auto name = name_of("detached")) loads_.detach(*name, t, q);
  if (const Json* seen = find(line, "seen")) {
    if (!seen_.add(*seen, t))
      throw line_error(reader, "seen: expected runs of voxels, four integers each");
    return;  // as many as frames: the map shows them
  }
  if (events_.size() < events_max)
    events_.push_back({{"t", std::isnan(t) ? Json(nullptr) : Json(t)}, {"text", *text}});
  else
    ++events_left_out_;
}

void Run::add_tick(const Json& line, const log::LogReader& reader) {
  advance(line, reader);
  Frame frame = read_frame(line, reader);
  add_stop(line, frame, reader);
  add_drawing(line, reader);
  plots_.add(line, frame, reader);
  if (const auto number = plots_.evasion()) acts_.add(time_s_, *number);
  ++ticks_;
  if (frame.q.allFinite())
    sample_.add(std::move(frame));
  else
    ++not_finite_;
}

void Run::advance(const Json& line, const log::LogReader& reader) {
  const double k = number(line, "k", reader), t = number(line, "time_s", reader);
  if (!(k > last_k_))
    throw line_error(reader, fmt::format("k: {} after {}, expected increasing steps", k, last_k_));
  if (!std::isfinite(t) || (ticks_ > 0 && !(t > time_s_)))
    throw line_error(reader,
                     fmt::format("time_s: {} after {}, expected increasing times", t, time_s_));
  last_k_ = k;
  time_s_ = t;
}

Frame Run::read_frame(const Json& line, const log::LogReader& reader) const {
  const int dof = world_.model.dof();
  Frame frame;
  frame.time_s = time_s_;
  frame.q = joint_vector(line, "q", dof, reader);
  if (frame.q.size() == 0) throw line_error(reader, "q: is missing, expected one number per joint");
  if (const double goals = number(line, "goal_index", reader); goals >= 0.0 && goals < 65535.0)
    frame.goal_index = static_cast<std::size_t>(goals);
  if (const Json& channels = object_member(line, "channels", reader); !channels.empty())
    for (std::size_t i = 0; i < channel_names.size(); ++i)
      frame.channels[i] = joint_vector(channels, channel_names[i], dof, reader);
  if (const Json& target = object_member(line, "target", reader); !target.empty()) {
    const VectorXd at = numbers(target, "position_m", 3, "position_m", reader);
    if (at.size() == 3 && at.allFinite()) frame.target = at;
  }
  return frame;
}

void Run::add_drawing(const Json& line, const log::LogReader& reader) {
  const Json* paths = find(line, "paths");
  if (paths == nullptr) return;
  std::vector<std::vector<double>> lines;
  const auto fail = [&] {
    throw line_error(reader, "paths: expected lists of numbers, three per point");
  };
  if (!paths->is_array()) fail();
  for (const Json& path : *paths) {
    if (!path.is_array() || path.size() % 3 != 0) fail();
    std::vector<double>& points = lines.emplace_back();
    for (const Json& x : path) {
      if (!x.is_number()) fail();
      points.push_back(x.get<double>());
    }
  }
  drawings_.add(time_s_, lines);
}

void Run::add_stop(const Json& line, const Frame& frame, const log::LogReader& reader) {
  if (find(line, "stop") == nullptr) return stops_.add(frame.time_s, nullptr, frame.q, frame.q);
  const Json& stop = object_member(line, "stop", reader);
  const Json* cause = find(stop, "cause");
  if (cause == nullptr || !cause->is_string())
    throw line_error(reader, "/stop/cause: expected the name of a cause");
  const VectorXd end = joint_vector(stop, "q_end", world_.model.dof(), reader);
  if (end.size() == 0)
    throw line_error(reader, "/stop/q_end: is missing, expected one number per joint");
  stops_.add(frame.time_s, cause->get_ptr<const std::string*>(), frame.q, end);
}

void Run::add_notes(const log::LogReader& reader) {
  if (reader.cut())
    notes_.push_back("the log ends in the middle of a line or frame, which is omitted");
  if (result_.is_null()) notes_.push_back("the log has no result: the run was not finished");
  if (not_finite_ > 0)
    notes_.push_back(fmt::format(
        "{} ticks have joint angles that are not finite; they are not drawn", not_finite_));
  if (events_left_out_ > 0)
    notes_.push_back(fmt::format("{} more events are in the log", events_left_out_));
  if (stops_.left_out() > 0)
    notes_.push_back(fmt::format("{} more stops are in the log", stops_.left_out()));
  if (drawings_.left_out() > 0)
    notes_.push_back(
        fmt::format("{} more drawings of the planner are in the log", drawings_.left_out()));
  if (acts_.left_out() > 0)
    notes_.push_back(fmt::format("{} more evasions are in the log", acts_.left_out()));
  notes_.insert(notes_.end(), world_.notes.begin(), world_.notes.end());
  if (recorded_.scene.map && world_.json["map"].is_null())
    notes_.push_back("without the map of the run there are no clearances and closest points");
}

Json Run::finish(const log::LogReader& reader, Container& container, RunSummary& summary) {
  std::vector<Frame> frames = sample_.take();
  if (frames.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no tick with finite joint angles, expected at least one",
                            summary.log.string()));
  add_notes(reader);
  const Json outcome = text_or_null(result_, "outcome"), cause = text_or_null(result_, "cause"),
             integrator = text_or_null(result_, "integrator");
  summary.outcome = outcome.is_null() ? "unfinished" : outcome.get<std::string>();
  summary.time_s = time_s_;
  summary.ticks = ticks_;
  summary.frames = frames.size();
  summary.notes = notes_;
  Json run;
  run["log"] = summary.log.filename().string();
  run["scene"] = recorded_.scene.name;
  run["planner"] = recorded_.scene.planner ? Json(recorded_.scene.planner->name) : Json(nullptr);
  // A plant that is not hamelin's own has its own integrator.
  run["integrator"] = integrator.is_null() ? Json(recorded_.scene.integrator.name) : integrator;
  run["outcome"] = summary.outcome;
  run["cause"] = cause == "" ? Json(nullptr) : cause;
  run["result"] = std::move(result_);
  run["config"] = std::move(config_);
  run["provenance"] = std::move(provenance_);
  Frames columns(world_);
  for (const Frame& frame : frames) columns.add(frame);
  run["frames"] = columns.json(container, recorded_.scene.step_s);
  run["events"] = std::move(events_);
  run["stops"] = stops_.json();
  run["acts"] = acts_.json();
  run["loads"] = loads_.take();
  run["seen"] = seen_.json(container, recorded_.scene.map && !recorded_.scene.map->known, notes_);
  run["drawings"] = drawings_.json(container);
  run["plots"] = plots_.json(container);
  run["notes"] = notes_;
  return run;
}

}  // namespace hamelin::report
