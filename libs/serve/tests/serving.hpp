#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/hamelin_control.h"
#include "hamelin/serve/client.hpp"
#include "hamelin/serve/server.hpp"
#include "hamelin/test/temporary.hpp"

namespace hamelin::test {

inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
inline const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";

/// The clutter at 1 kHz, with one goal in joint space that is near, or with its own goals.
inline scene::Scene clutter(bool near_goal = true) {
  scene::Scene scene = scene::read_scene(data / "scenes" / "clutter.json");
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.control_period_s = scene.step_s = 0.001;
  if (!near_goal) return scene;
  Eigen::VectorXd q = scene.start_q;
  q[0] += 0.1;
  scene.goals = {scene::joint_goal(q)};
  return scene;
}

/// A controller for an arm whose servos follow positions, which is thus simulated by copying them.
inline control::ControllerOptions for_positions() {
  control::ControllerOptions options;
  options.position = true;
  options.lost_measurements_max = 10;
  options.late_answers_max = 0;
  options.payload_reach_m = 0.3;
  options.payload_shapes_max = 8;
  return options;
}

inline const std::vector<std::filesystem::path> planners{HAMELIN_TEST_PLUGIN_DIR};

/// Makes the measurements of an arm that follows set points exactly.
class ExactArm {
 public:
  explicit ExactArm(const Eigen::VectorXd& q) { std::copy(q.begin(), q.end(), next_.q); }
  /// The measurement of the next period, with its checksum.
  hamelin_measurement measure() {
    ++next_.sequence;
    next_.time_s += 0.001;
    next_.checksum = hamelin_measurement_checksum(&next_);
    return next_;
  }
  void follow(const hamelin_setpoint& setpoint) {
    std::copy(std::begin(setpoint.q), std::end(setpoint.q), next_.q);
    std::copy(std::begin(setpoint.v), std::end(setpoint.v), next_.v);
  }
  void request(std::uint32_t what) { next_.request = what; }
  /// After periods in which no measurement was sent.
  void skip(std::uint64_t periods) {
    next_.sequence += periods;
    next_.time_s += 0.001 * static_cast<double>(periods);
  }
  [[nodiscard]] double speed() const {
    return *std::max_element(std::begin(next_.v), std::end(next_.v),
                             [](double a, double b) { return std::abs(a) < std::abs(b); });
  }

 private:
  hamelin_measurement next_{};
};

/// A measurement whose checksum is made right again after a change.
inline hamelin_measurement with_checksum(hamelin_measurement frame) {
  frame.checksum = hamelin_measurement_checksum(&frame);
  return frame;
}

/// A server on a thread of its own.
class Serving {
 public:
  /// @param patience_s below 0: in lockstep
  explicit Serving(double patience_s = -1.0, const scene::Scene& scene = clutter())
      : controller_(scene, planners, for_positions()),
        server_(controller_, options(patience_s)),
        thread_([this] {
          server_.run(stop_, [this](const serve::Server::Report& report) {
            report_ = report;
            ++gone_;
            return true;
          });
        }) {}
  ~Serving() { stop(); }
  Serving(const Serving&) = delete;
  Serving& operator=(const Serving&) = delete;

  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  /// Waits until so many clients have gone, at most ten seconds.
  bool wait_for_gone(int clients) const {
    for (int i = 0; i < 1000 && gone_ < clients; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return gone_ >= clients;
  }
  /// After wait_for_gone().
  [[nodiscard]] const serve::Server::Report& report() const { return report_; }
  [[nodiscard]] std::filesystem::path socket() const { return folder_.path() / "arm"; }

 private:
  [[nodiscard]] serve::ServerOptions options(double patience_s) const {
    serve::ServerOptions out;
    out.socket = socket();
    out.position = true;
    out.patience_s = patience_s;
    out.gap_max = 11;
    out.folder = data / "scenes";
    return out;
  }
  TemporaryFolder folder_;
  control::Controller controller_;
  serve::Server server_;
  serve::Server::Report report_;
  std::atomic<int> gone_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Exchanges a frame in lockstep. @return the set point of the period
inline const hamelin_setpoint& exchange(serve::Client& client, ExactArm& arm) {
  const hamelin_measurement frame = arm.measure();
  client.send_raw(frame);
  REQUIRE(client.receive(frame.sequence, 10.0));
  arm.follow(client.setpoint());
  return client.setpoint();
}

}  // namespace hamelin::test
