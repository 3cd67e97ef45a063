#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/identification/record.hpp"
#include "hamelin/log/trajectory.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const Json* find(const Json& document, const char* pointer) {
  const Json::json_pointer at(pointer);
  if (!document.contains(at) || document[at].is_null()) return nullptr;
  return &document[at];
}

double number(const Json& document, const char* pointer, double otherwise) {
  const Json* const found = find(document, pointer);
  return found != nullptr && found->is_number() ? found->get<double>() : otherwise;
}

// Joint torques of one channel of a tick; zero if it is not used.
VectorXd channel(const Json& tick, const char* name, Index dof) {
  VectorXd out = VectorXd::Zero(dof);
  if (!tick.contains("channels") || !tick["channels"].contains(name)) return out;
  const Json& numbers = tick["channels"][name];
  for (Index i = 0; i < dof && static_cast<std::size_t>(i) < numbers.size(); ++i) {
    const Json& value = numbers[static_cast<std::size_t>(i)];
    out[i] = value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

void check_joints(const std::filesystem::path& file, const std::vector<std::string>& joints,
                  const model::Robot& robot) {
  bool equal = joints.size() == robot.links.size();
  std::string logged, expected;
  for (const std::string& name : joints)
    logged += fmt::format("{}{}", logged.empty() ? "" : ", ", name);
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const std::string& name = robot.links[i].joint.name;
    expected += fmt::format("{}{}", expected.empty() ? "" : ", ", name);
    equal = equal && joints[i] == name;
  }
  if (!equal)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: line 1: /joints: {}, expected those of robot '{}': {}",
                            file.string(), logged, robot.name, expected));
}

/// How the torques of a log act, by its header.
struct LoggedTorque {
  bool ideal = false;      ///< channels act each in its own way
  bool every_step = true;  ///< no torque changed between two lines
  double step_s = 0.0;     ///< of the integrator
  double hold_s = 0.0;     ///< for which a torque acts at least

  explicit LoggedTorque(const Json& header) {
    const Json& config = header["config"];
    const Json* const type = find(config, "/actuation/type");
    const std::string name = type != nullptr ? type->get<std::string>() : "";
    ideal = name == "ideal";
    step_s = number(config, "/step_s", 0.0);
    hold_s = name == "sampled" ? number(config, "/actuation/control_period_s", step_s) : step_s;
    constexpr double rounding = 1e-9;
    every_step = header["every"].get<double>() * step_s <= hold_s * (1.0 + rounding);
  }
};

class LogRecord {
 public:
  LogRecord(const std::filesystem::path& file, const model::Robot& robot)
      : reader_(file), file_(file), dof_(robot.dof()), torque_(reader_.header()) {
    check_joints(file, reader_.joints(), robot);
    const Json& config = reader_.header()["config"];
    if (const Json* const payload = find(config, "/model/payload"))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: line 1: /config/model/payload: the arm carries '{}', expected "
                              "an arm without payload",
                              file.string(), payload->value("name", "")));
    if (const Json* const wrenches = find(config, "/wrenches"))
      for (const Json& wrench : *wrenches)
        wrench_times_.emplace_back(
            number(wrench, "/from_s", 0.0),
            number(wrench, "/to_s", std::numeric_limits<double>::infinity()));
    if (find(config, "/model/friction_speed") != nullptr)
      record_.friction_speed = number(config, "/model/friction_speed", 0.01);
    record_.where = file.string();
  }

  Record read() {
    while (reader_.next()) {
      if (const auto* point = reader_.point())
        add_tick(*point);
      else
        note_load(reader_.line());
    }
    if (record_.ticks() == 0)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: has no ticks, expected a motion", file_.string()));
    if (with_torque_ == 0)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: its ticks have no torques, expected a run with a planner or a "
                              "table with the torques of the motors",
                              file_.string()));
    finish();
    return std::move(record_);
  }

 private:
  void add_tick(const log::Trajectory::Point& point);
  void note_load(const Json& event);
  void finish();
  [[nodiscard]] bool under_wrench(double time_s) const {
    const double margin = torque_.step_s * reader_.header()["every"].get<double>();
    return std::any_of(wrench_times_.begin(), wrench_times_.end(), [&](const auto& times) {
      return time_s + margin >= times.first && time_s <= times.second + margin;
    });
  }
  void append(std::vector<double>& column, const VectorXd& x) {
    column.insert(column.end(), x.begin(), x.end());
  }

  log::TickReader reader_;
  std::filesystem::path file_;
  Index dof_;
  LoggedTorque torque_;
  Record record_;
  std::vector<double> q_, held_, sampled_, impulses_;
  std::vector<std::pair<double, double>> wrench_times_;
  std::set<std::string> attached_;
  bool any_impulse_ = false;
  std::size_t with_torque_ = 0, contacts_ = 0, wrenches_ = 0, loaded_ = 0;
};

void LogRecord::add_tick(const log::Trajectory::Point& point) {
  const Json& line = reader_.line();
  const bool has_torque = point.tau.size() > 0;
  VectorXd held = VectorXd::Zero(dof_), sampled = held, impulse = held;
  if (has_torque) {
    ++with_torque_;
    if (!torque_.ideal) {
      (torque_.every_step ? held : sampled) = point.tau;
    } else {
      impulse = torque_.step_s * channel(line, "node", dof_);
      sampled = channel(line, "potential", dof_) + channel(line, "damping", dof_) +
                channel(line, "gyroscopic", dof_);
      (torque_.every_step ? held : sampled) +=
          channel(line, "held", dof_) + channel(line, "stop", dof_);
    }
  }
  if (!impulse.isZero(0.0)) any_impulse_ = true;
  const auto touches = [&](const char* key) {
    return line.contains(key) && line[key].is_number() && line[key].get<double>() <= 0.0;
  };
  const bool contact = touches("clearance_m") || touches("self_clearance_m");
  const bool wrench = under_wrench(point.time_s), loaded = !attached_.empty();
  contacts_ += contact ? 1 : 0;
  wrenches_ += wrench ? 1 : 0;
  loaded_ += loaded ? 1 : 0;
  const bool finite =
      point.q.allFinite() && held.allFinite() && sampled.allFinite() && impulse.allFinite();
  record_.time_s.push_back(point.time_s);
  record_.usable.push_back(has_torque && finite && !contact && !wrench && !loaded ? 1 : 0);
  append(q_, point.q);
  append(held_, held);
  append(sampled_, sampled);
  append(impulses_, impulse);
}

void LogRecord::note_load(const Json& event) {
  if (event.contains("attached")) {
    attached_.insert(event["attached"].get<std::string>());
    // the tick before acts up to the event, or beyond it
    if (!record_.usable.empty()) record_.usable.back() = 0;
  }
  if (event.contains("detached")) attached_.erase(event["detached"].get<std::string>());
}

void LogRecord::finish() {
  const auto ticks = static_cast<Index>(record_.ticks());
  const auto matrix = [&](const std::vector<double>& numbers) {
    return MatrixXd(Eigen::Map<const MatrixXd>(numbers.data(), dof_, ticks));
  };
  record_.q = matrix(q_);
  record_.held = matrix(held_);
  record_.sampled = matrix(sampled_);
  if (!torque_.ideal && !torque_.every_step) record_.sampled_shift_s = 0.5 * torque_.hold_s;
  if (any_impulse_) {
    if (!torque_.every_step)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: line 1: /every: {}, expected 1, since the planner sets node "
                              "velocities, whose impulses are needed at every step",
                              file_.string(), reader_.header()["every"].get<long>()));
    record_.impulses = matrix(impulses_);
  }
  const auto note = [&](std::size_t count, const char* reason) {
    if (count > 0)
      record_.notes.push_back(
          fmt::format("{}: left out {} ticks {}", file_.string(), count, reason));
  };
  note(contacts_, "in contact");
  note(wrenches_, "under wrenches of the surroundings");
  note(loaded_, "with an attached object");
}

}  // namespace

Record read_log(const std::filesystem::path& file, const model::Robot& robot, long every) {
  return thinned(LogRecord(file, robot).read(), every);
}

}  // namespace hamelin::identification
