#include "run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/modelled.hpp"

namespace hamelin::report {

namespace {

using Eigen::VectorXd;

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// Limits of the joint values, events and joints' lines in a page, for chains and logs of any
// length.
constexpr std::size_t joint_values_max = 200000, events_max = 2000, plotted_joints_max = 24,
                      stops_max = 500, stop_values_max = 20000, acts_max = 2000,
                      drawn_points_max = 400000;

// Columns of a tick's row after q, v and tau of the joints.
enum Column : std::size_t {
  clearance,
  goal_m,
  goal_rad,
  off_trajectory,
  kinetic,
  potential,
  control,
  gyroscopic,
  filter,
  recovery,
  dissipated,
  held,
  node,
  energy_error,
  updates,
  halvings,
  residual,
  tick_us,
  tick_us_max,
  columns
};

Error line_error(const log::LogReader& reader, const std::string& problem) {
  return Error(ErrorCode::invalid, fmt::format("{}: {}", reader.where(), problem));
}

const Json* find(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at == object.end() || at->is_null() ? nullptr : &*at;
}

// A member that must be an object if it exists; an empty object otherwise.
const Json& object_member(const Json& line, const char* key, const log::LogReader& reader) {
  static const Json empty = Json::object();
  const Json* at = find(line, key);
  if (at == nullptr) return empty;
  if (!at->is_object()) throw line_error(reader, fmt::format("/{}: expected an object", key));
  return *at;
}

// A number, or NaN if it is null or missing.
double number(const Json& object, const char* key, const log::LogReader& reader) {
  const Json* at = find(object, key);
  if (at == nullptr) return unknown;
  if (!at->is_number()) throw line_error(reader, fmt::format("{}: expected a number", key));
  return at->get<double>();
}

// `count` numbers; null becomes NaN. Empty if the member is missing.
VectorXd numbers(const Json& object, const char* key, int count, const char* of_each,
                 const log::LogReader& reader) {
  const Json* at = find(object, key);
  if (at == nullptr) return {};
  if (!at->is_array() || at->size() != static_cast<std::size_t>(count))
    throw line_error(reader,
                     fmt::format("{}: expected {} numbers, one per {}", key, count, of_each));
  VectorXd x(count);
  for (int i = 0; i < count; ++i) {
    const Json& value = (*at)[static_cast<std::size_t>(i)];
    if (!value.is_number() && !value.is_null())
      throw line_error(reader, fmt::format("{}/{}: expected a number", key, i));
    x[i] = value.is_null() ? unknown : value.get<double>();
  }
  return x;
}

VectorXd joint_vector(const Json& object, const char* key, int dof, const log::LogReader& reader) {
  return numbers(object, key, dof, "joint", reader);
}

std::size_t frames_of(const Options& options, int dof) {
  return std::clamp<std::size_t>(joint_values_max / static_cast<std::size_t>(dof), 2,
                                 options.frames_max);
}

}  // namespace

Run::Run(const Json& header, const simulation::Recorded& recorded, const World& world,
         const Options& options)
    : world_(world),
      recorded_(recorded),
      ws_(world.model),
      plotted_joints_(
          std::min<std::size_t>(static_cast<std::size_t>(world.model.dof()), plotted_joints_max)),
      series_count_(header.value("series", Json::array()).size()),
      row_(4 * plotted_joints_ + columns + series_count_, unknown),
      bins_(row_.size(), options.plot_points_max),
      sample_(frames_of(options, world.model.dof())),
      stops_(std::clamp<std::size_t>(
          stop_values_max / static_cast<std::size_t>(2 * world.model.dof()), 1, stops_max)),
      acts_(acts_max),
      loads_(recorded.scene, world.model.robot().tip.pose),
      drawings_(drawn_points_max),
      config_(header["config"]),
      provenance_(header["provenance"]) {
  const auto& links = world.model.robot().links;
  simulation::check_joints(header, recorded, world.model.robot());
  for (const auto& changed : recorded.changed) notes_.push_back(changed.text);
  if (recorded.every > 1)
    notes_.push_back(fmt::format(
        "the log has a tick every {} steps; clearance, energy error, updates, residual and "
        "the longest tick are over all steps",
        recorded.every));

  const auto unit = [](bool first, bool second, const char* one, const char* other) {
    return first && second ? fmt::format("{}, {}", one, other) : std::string(first ? one : other);
  };
  bool has_revolute = false, has_prismatic = false, has_tip_goal = false, has_joint_goal = false,
       has_trajectory = false;
  for (const auto& link : links)
    (link.joint.type == model::JointType::revolute ? has_revolute : has_prismatic) = true;
  for (const auto& goal : world.goals)
    for (const auto& option : scene::options_of(goal)) {
      (option.type == scene::GoalType::joint ? has_joint_goal : has_tip_goal) = true;
      has_trajectory = has_trajectory || option.trajectory;
    }
  const std::string suffix =
      plotted_joints_ < links.size() ? fmt::format(" (first {})", plotted_joints_) : "";
  std::size_t column = 0;
  for (auto [id, title, plot_unit] :
       {std::tuple("q", "joint angles", unit(has_revolute, has_prismatic, "rad", "m")),
        std::tuple("v", "joint rates", unit(has_revolute, has_prismatic, "rad/s", "m/s")),
        std::tuple("tau", "joint torques", unit(has_revolute, has_prismatic, "Nm", "N"))}) {
    plots_.push_back({id, title + suffix, plot_unit, {}, false});
    for (std::size_t i = 0; i < plotted_joints_; ++i)
      plots_.back().lines.emplace_back(links[i].joint.name, column++);
  }
  const auto add = [&](const char* id, const char* title, const std::string& plot_unit,
                       bool wide_range,
                       std::initializer_list<std::pair<const char*, Column>> lines) {
    plots_.push_back({id, title, plot_unit, {}, wide_range});
    for (const auto& [label, at] : lines) plots_.back().lines.emplace_back(label, column + at);
  };
  add("clearance", "clearance", "m", false, {{"smallest", clearance}});
  if (has_tip_goal) add("goal", "distance to the goal", "m", false, {{"tip", goal_m}});
  if (has_joint_goal)
    add(has_tip_goal ? "goal_joint" : "goal", "distance to the joint goal",
        unit(has_revolute, has_prismatic, "rad", "m"), false, {{"largest joint error", goal_rad}});
  if (has_trajectory) {
    add("trajectory", "distance from the trajectory", unit(has_revolute, has_prismatic, "rad", "m"),
        false, {{"largest joint error", off_trajectory}});
    if (scene::limits_in_force(recorded.scene.model, world_.model.robot()).torque) {
      std::size_t share = column + columns + series_count_;  // after the series
      plots_.push_back({"tau_share", "torques as shares of their limits" + suffix, "1", {}, false});
      for (std::size_t i = 0; i < plotted_joints_; ++i)
        plots_.back().lines.emplace_back(links[i].joint.name, share++);
    }
  }
  add("energy", "energy account", "J", false,
      {{"kinetic", kinetic},
       {"potential", potential},
       {"control", control},
       {"gyroscopic work", gyroscopic},
       {"filter work", filter},
       {"recovery work", recovery},
       {"dissipated", dissipated},
       {"held work", held},
       {"node work", node}});
  add("energy_error", "energy error", "J", true, {{"|E - E0 - work|", energy_error}});
  add("solver", "solver updates per step", "1", true,
      {{"updates", updates}, {"halvings", halvings}});
  add("residual", "solver residual", "1", true, {{"residual", residual}});
  add("tick_us", "time of one tick", "µs", true,
      {{"tick", tick_us}, {"longest since the previous line", tick_us_max}});
  add_series_plots(header, column + columns);
}

void Run::add_series_plots(const Json& header, std::size_t column) {
  const std::size_t first = plots_.size();
  for (std::size_t i = 0; i < series_count_; ++i) {
    const Json& series = header["series"][i];
    const auto name = series.at("name").get<std::string>(),
               series_unit = series.at("unit").get<std::string>();
    if (name == "evasion" && series_unit.empty()) evasion_ = i;
    auto plot = std::find_if(plots_.begin() + static_cast<std::ptrdiff_t>(first), plots_.end(),
                             [&](const Plot& other) { return other.unit == series_unit; });
    if (plot == plots_.end()) {
      const char* const title = "series of the planner";
      plots_.push_back({fmt::format("series {}", series_unit), title, series_unit, {}, false});
      plot = plots_.end() - 1;
    }
    plot->lines.emplace_back(name, column + i);
  }
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
  const int dof = world_.model.dof();
  const double k = number(line, "k", reader), t = number(line, "time_s", reader);
  if (!(k > last_k_))
    throw line_error(reader, fmt::format("k: {} after {}, expected increasing steps", k, last_k_));
  if (!std::isfinite(t) || (ticks_ > 0 && !(t > time_s_)))
    throw line_error(reader,
                     fmt::format("time_s: {} after {}, expected increasing times", t, time_s_));
  last_k_ = k;
  time_s_ = t;

  Frame frame;
  frame.time_s = t;
  frame.q = joint_vector(line, "q", dof, reader);
  if (frame.q.size() == 0) throw line_error(reader, "q: is missing, expected one number per joint");
  if (const double goals = number(line, "goal_index", reader); goals >= 0.0 && goals < 65535.0)
    frame.goal_index = static_cast<std::size_t>(goals);
  const Json* channels = find(line, "channels");
  if (channels != nullptr)
    for (std::size_t i = 0; i < channel_names.size(); ++i)
      frame.channels[i] =
          joint_vector(object_member(line, "channels", reader), channel_names[i], dof, reader);

  add_stop(line, frame, reader);
  add_drawing(line, reader);

  std::fill(row_.begin(), row_.end(), unknown);
  const auto joints = [&](std::size_t at, const VectorXd& x) {
    if (x.size() > 0) std::copy_n(x.data(), plotted_joints_, &row_[at * plotted_joints_]);
  };
  joints(0, frame.q);
  joints(1, joint_vector(line, "v", dof, reader));
  const VectorXd tau = joint_vector(line, "tau", dof, reader);
  joints(2, tau);
  for (std::size_t i = 0; tau.size() > 0 && i < plotted_joints_; ++i)
    if (const auto limit = world_.model.robot().links[i].joint.effort_max)
      row_[3 * plotted_joints_ + columns + series_count_ + i] =
          tau[static_cast<Eigen::Index>(i)] / *limit;
  double* const row = &row_[3 * plotted_joints_];
  const Json& energy = object_member(line, "energy", reader);
  const Json& solver = object_member(line, "solver", reader);
  const Json& timing = object_member(line, "timing", reader);
  const Json& extrema = object_member(line, "extrema", reader);

  row[clearance] = number(line, "clearance_m", reader);
  const std::pair<Column, const char*> entries[] = {
      {kinetic, "kinetic_J"},       {potential, "potential_J"},
      {control, "control_J"},       {gyroscopic, "gyroscopic_work_J"},
      {filter, "filter_work_J"},    {recovery, "recovery_work_J"},
      {dissipated, "dissipated_J"}, {held, "held_work_J"},
      {node, "node_work_J"}};
  for (const auto& [column, key] : entries) row[column] = number(energy, key, reader);
  const double balance =
      row[kinetic] + row[potential] + row[control] -
      (row[gyroscopic] + row[held] - row[dissipated] + row[node]) -
      (energy.contains("stop_work_J") ? number(energy, "stop_work_J", reader) : 0.0) -
      (energy.contains("load_energy_J") ? number(energy, "load_energy_J", reader) : 0.0) -
      (energy.contains("external_work_J") ? number(energy, "external_work_J", reader) : 0.0);
  if (ticks_ == 0) first_balance_ = balance;
  row[energy_error] = std::abs(balance - first_balance_);
  row[updates] = number(solver, "updates", reader);
  row[halvings] = number(solver, "halvings", reader);
  row[residual] = number(solver, "residual", reader);
  row[tick_us] = number(timing, "tick_us", reader);
  row[tick_us_max] = number(timing, "tick_us_max", reader);
  if (series_count_ > 0) {
    const VectorXd series =
        numbers(line, "series", static_cast<int>(series_count_), "series", reader);
    if (series.size() > 0) std::copy_n(series.data(), series_count_, row + columns);
    if (evasion_) acts_.add(t, row[columns + *evasion_]);
  }
  if (!extrema.empty()) {
    if (!std::isnan(row[clearance])) row[clearance] = number(extrema, "clearance_m", reader);
    row[energy_error] = number(extrema, "energy_error_J", reader);
    row[updates] = number(extrema, "updates", reader);
    row[halvings] = number(extrema, "halvings", reader);
    row[residual] = number(extrema, "residual", reader);
  }
  ++ticks_;
  if (const Json& target = object_member(line, "target", reader); !target.empty()) {
    row[goal_m] = number(target, "error_m", reader);
    const VectorXd at = numbers(target, "position_m", 3, "position_m", reader);
    if (at.size() == 3 && at.allFinite()) frame.target = at;
  }
  if (const Json& reference = object_member(line, "reference", reader); !reference.empty())
    if (const VectorXd at = joint_vector(reference, "q", dof, reader); at.size() > 0)
      row[off_trajectory] = (frame.q - at).lpNorm<Eigen::Infinity>();
  if (frame.q.allFinite()) {
    set_goal_distance(frame);
    bins_.add(t, row_);
    sample_.add(std::move(frame));
  } else {
    ++not_finite_;
    bins_.add(t, row_);
  }
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

void Run::set_goal_distance(const Frame& frame) {
  if (world_.goals.empty()) return;
  double* const row = &row_[3 * plotted_joints_];
  const auto& goal = world_.goals[std::min(frame.goal_index, world_.goals.size() - 1)];
  if (goal.type == scene::GoalType::follow) return;  // the tick has the distance from its target
  dynamics::forward_kinematics(world_.model, ws_, frame.q);
  const geometry::SE3 tip = dynamics::tip_pose(world_.model, ws_);
  const auto nearer = [](double& least, double distance) {
    if (!(least <= distance)) least = distance;
  };
  for (const scene::Goal& option : scene::options_of(goal))
    if (option.type != scene::GoalType::joint)
      nearer(row[goal_m], (tip.p() - scene::nearest_pose(option, tip).p()).norm());
    else if (option.q.size() == frame.q.size())
      nearer(row[goal_rad], (frame.q - option.q).lpNorm<Eigen::Infinity>());
}

Json Run::finish(const log::LogReader& reader, Container& container, RunSummary& summary) {
  std::vector<Frame> frames = sample_.take();
  if (frames.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no tick with finite joint angles, expected at least one",
                            summary.log.string()));
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

  const auto text = [](const Json& object, const char* key) {
    const Json* at = object.is_object() ? find(object, key) : nullptr;
    return at != nullptr && at->is_string() ? *at : Json(nullptr);
  };
  const Json outcome = text(result_, "outcome"), cause = text(result_, "cause"),
             integrator = text(result_, "integrator");
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
  run["plots"] = plots_json(container);
  run["notes"] = notes_;
  return run;
}

Json Run::marks(const Plot& plot) const {
  Json marks = Json::array();
  const std::string_view id = plot.id;
  const auto& scene = recorded_.scene;
  const auto add = [&marks](double y, const std::string& label) {
    for (const auto& mark : marks)
      if (mark["y"] == y) return;
    marks.push_back({{"y", y}, {"label", label}});
  };
  if (id == "clearance") {
    add(0.0, "contact");
    const Json params = scene.planner ? scene.planner->params : Json::object();
    for (const auto& [key, label] :
         {std::pair("margin_m", "margin"), std::pair("contact_radius_m", "search radius"),
          std::pair("rho0_m", "influence")})
      if (const Json* at = find(params, key); at != nullptr && at->is_number())
        add(at->get<double>(), label);
  } else if (id == "goal" || id == "goal_joint") {
    const bool of_joints = plot.lines.front().second == 3 * plotted_joints_ + goal_rad;
    for (const auto& goal : world_.goals)
      for (const auto& option : scene::options_of(goal))
        if ((option.type == scene::GoalType::joint) == of_joints)
          add(of_joints ? option.tolerance_rad : option.tolerance_m, "tolerance");
  } else if (id == "tau_share") {
    add(1.0, "limit");
    add(-1.0, "limit");
  } else if (id == "v" || id == "tau") {
    // Joints with the same limit share its line. It is drawn if one of them comes near to it; a
    // limit far away would only compress the scale.
    const std::size_t first = (id == "v" ? 1 : 2) * plotted_joints_;
    if (!(id == "v" ? scene.model.velocity_limits : scene.model.torque_limits)) return marks;
    struct Shared {
      std::vector<std::string> joints;
      bool near = false;
    };
    std::map<double, Shared> limits;
    for (std::size_t i = 0; i < plotted_joints_; ++i) {
      const auto& joint = world_.model.robot().links[i].joint;
      const auto limit = id == "v" ? joint.velocity_max : joint.effort_max;
      if (!limit) continue;
      auto& shared = limits[*limit];
      shared.joints.push_back(joint.name);
      for (const double value : bins_.values(first + i))
        shared.near = shared.near || std::abs(value) > *limit / 1.5;
    }
    for (const auto& [limit, shared] : limits) {
      if (!shared.near) continue;
      const std::string label = shared.joints.size() == plotted_joints_ ? "limit"
                                : shared.joints.size() <= 4
                                    ? fmt::format("limit of {}", fmt::join(shared.joints, ", "))
                                    : fmt::format("limit of {} joints", shared.joints.size());
      add(limit, label);
      add(-limit, label);
    }
  }
  return marks;
}

Json Run::plots_json(Container& container) const {
  constexpr int bits = 12;
  Json plots = Json::array();
  const Json t = container.stepped(bins_.times(), recorded_.scene.step_s);
  for (const Plot& plot : plots_) {
    Json series = Json::array();
    for (const auto& [label, column] : plot.lines) {
      const std::vector<double> y = bins_.values(column);
      const bool known =
          std::any_of(y.begin(), y.end(), [](double value) { return !std::isnan(value); });
      const bool nonzero = std::any_of(
          y.begin(), y.end(), [](double value) { return value != 0.0 && !std::isnan(value); });
      // Only the first line is shown if it is zero throughout, for example not the work of an
      // unused channel.
      if (!known || (!nonzero && !series.empty())) continue;
      series.push_back(
          {{"label", label},
           {"y", plot.wide_range ? container.relative(y, bits) : container.levels(y)}});
    }
    if (series.empty()) continue;
    plots.push_back({{"id", plot.id},
                     {"title", plot.title},
                     {"unit", plot.unit},
                     {"t", t},
                     {"series", std::move(series)},
                     {"marks", marks(plot)}});
  }
  return plots;
}

}  // namespace hamelin::report
