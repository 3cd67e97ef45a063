#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/serve/client.hpp"
#include "hamelin/simulation/robot.hpp"

namespace hamelin::serve {

namespace {

using Eigen::VectorXd;

// An arm that has been stopped for so long ends the run [s].
constexpr double stopped_max_s = 2.0;

/// One run of a simulated robot with a server.
class SimulatedClient {
 public:
  SimulatedClient(const scene::Scene& scene, const simulation::PlantFactory& plant_factory,
                  const SimulatedClientOptions& options)
      : scene_(scene),
        options_(options),
        robot_(scene, plant_factory),
        client_(options.socket),
        random_(options.faults.seed) {
    check_link();
    q_ = v_ = VectorXd::Zero(robot_.dof());
    answer_.torque = answer_.q_next = answer_.v_next = q_;
  }

  SimulatedClientReport run();

 private:
  enum class Fault { none, lost, late, repeated, damaged };

  void check_link() const {
    const bool position = scene_.actuation.type == scene::ActuationType::position;
    const hamelin_link& link = client_.link();
    if (link.joints == static_cast<std::uint32_t>(robot_.dof()) &&
        (link.position != 0) == position && std::abs(link.period_s - robot_.period_s()) < 1e-12)
      return;
    throw Error(ErrorCode::invalid,
                fmt::format("{}: the server is for {} joints, {} and a period of {} s, expected {} "
                            "joints, {} and {} s",
                            options_.socket.string(), link.joints,
                            link.position != 0 ? "positions" : "torques", link.period_s,
                            robot_.dof(), position ? "positions" : "torques", robot_.period_s()));
  }
  Fault choose_fault();
  /// Sends the measurement, and waits for its set point.
  void exchange(Fault fault);
  [[nodiscard]] hamelin_measurement measurement();
  void take_setpoint();
  /// Whether the controller says that the run is over.
  [[nodiscard]] bool is_over();
  void finish(log::Outcome outcome, std::string cause);
  void keep_time();

  const scene::Scene& scene_;
  SimulatedClientOptions options_;
  simulation::Robot robot_;
  Client client_;
  Rng random_;
  std::uint64_t sequence_ = 0;
  VectorXd q_, v_;
  control::Answer answer_;
  bool begun_ = false;
  double stopped_s_ = 0.0;
  std::chrono::steady_clock::time_point due_ = std::chrono::steady_clock::now();
  SimulatedClientReport report_;
};

SimulatedClient::Fault SimulatedClient::choose_fault() {
  double x = random_.uniform();
  const Faults& faults = options_.faults;
  const auto in = [&](double share, double& made) {
    const bool hit = x >= 0.0 && x < share;
    x -= share;
    if (hit) made += 1.0;
    return hit;
  };
  if (!begun_) return Fault::none;
  if (in(faults.lost, report_.made.lost)) return Fault::lost;
  if (in(faults.late, report_.made.late)) return Fault::late;
  if (in(faults.repeated, report_.made.repeated)) return Fault::repeated;
  if (in(faults.damaged, report_.made.damaged)) return Fault::damaged;
  return Fault::none;
}

hamelin_measurement SimulatedClient::measurement() {
  robot_.measure(q_, v_);
  hamelin_measurement out{};
  out.sequence = sequence_;
  out.time_s = robot_.time_s();
  std::copy(q_.begin(), q_.end(), out.q);
  std::copy(v_.begin(), v_.end(), out.v);
  return out;
}

void SimulatedClient::exchange(Fault fault) {
  hamelin_measurement frame = measurement();
  const double since_s = control::steady_clock_s();
  if (fault == Fault::damaged) {
    frame.checksum = hamelin_measurement_checksum(&frame) ^ 1U;
    client_.send_raw(frame);
  } else if (fault == Fault::none || fault == Fault::repeated) {
    client_.send(frame);
  }
  const bool answered = client_.receive(sequence_, options_.patience_s);
  if (!answered) ++report_.unanswered;
  if (answered && fault == Fault::none)
    report_.round_trip_us.add(1e6 * (control::steady_clock_s() - since_s));
  if (fault == Fault::late || fault == Fault::repeated) client_.send(frame);
}

void SimulatedClient::take_setpoint() {
  const hamelin_setpoint& setpoint = client_.setpoint();
  const auto n = static_cast<std::size_t>(robot_.dof());
  std::copy_n(setpoint.torque, n, answer_.torque.data());
  std::copy_n(setpoint.q, n, answer_.q_next.data());
  std::copy_n(setpoint.v, n, answer_.v_next.data());
  answer_.saturated = (setpoint.flags & HAMELIN_SETPOINT_SATURATED) != 0;
  report_.lost = setpoint.lost;
  report_.late = setpoint.late;
  report_.damaged = setpoint.damaged;
  begun_ = true;
}

bool SimulatedClient::is_over() {
  const hamelin_setpoint& setpoint = client_.setpoint();
  const std::string cause = setpoint.cause;
  if ((setpoint.flags & HAMELIN_SETPOINT_NOT_BEGUN) != 0)
    finish(log::Outcome::refused, cause);
  else if (setpoint.state == static_cast<std::int32_t>(control::ControlState::reached))
    finish(log::Outcome::reached, "");
  else if (setpoint.state == static_cast<std::int32_t>(control::ControlState::stalled) ||
           setpoint.state == static_cast<std::int32_t>(control::ControlState::gave_up))
    finish(log::Outcome::stalled, cause);
  else
    return false;
  return true;
}

void SimulatedClient::finish(log::Outcome outcome, std::string cause) {
  report_.result.outcome = outcome;
  report_.result.cause = std::move(cause);
}

void SimulatedClient::keep_time() {
  due_ += std::chrono::duration_cast<std::chrono::steady_clock::duration>(
      std::chrono::duration<double>(robot_.period_s()));
  std::this_thread::sleep_until(due_);
}

SimulatedClientReport SimulatedClient::run() {
  finish(log::Outcome::timeout, fmt::format("goal not reached within {} s", scene_.duration_s));
  if (!robot_.cause().empty()) finish(log::Outcome::refused, robot_.cause());
  while (robot_.cause().empty() && robot_.time_s() < scene_.duration_s - 1e-9) {
    ++sequence_;
    exchange(choose_fault());
    if (!client_.is_open()) {
      finish(log::Outcome::interrupted, "the server has closed the connection");
      break;
    }
    take_setpoint();
    if (is_over()) break;
    const bool stopping =
        client_.setpoint().state == static_cast<std::int32_t>(control::ControlState::stopping);
    if (stopping) ++report_.stopping;
    stopped_s_ = stopping ? stopped_s_ + robot_.period_s() : 0.0;
    if (stopped_s_ > stopped_max_s) {
      finish(log::Outcome::stalled, client_.setpoint().cause);
      break;
    }
    if (!robot_.move(answer_)) finish(robot_.outcome(), robot_.cause());
    ++report_.periods;
    if (options_.stop != nullptr && *options_.stop) {
      finish(log::Outcome::interrupted, "stopped from outside");
      break;
    }
    if (options_.real_time) keep_time();
  }
  robot_.fill(report_.result);
  return report_;
}

}  // namespace

SimulatedClientReport run_simulated_client(const scene::Scene& scene,
                                           const simulation::PlantFactory& plant_factory,
                                           const SimulatedClientOptions& options) {
  return SimulatedClient(scene, plant_factory, options).run();
}

}  // namespace hamelin::serve
