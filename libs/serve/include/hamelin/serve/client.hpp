#pragma once
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>

#include "hamelin/core/time_histogram.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/serve/hamelin_frames.h"
#include "hamelin/serve/link.hpp"
#include "hamelin/simulation/plant.hpp"

namespace hamelin::serve {

/// The client's end of a link: a measurement goes out, a set point comes back.
class Client {
 public:
  /// @throws Error io if there is no server, or it has another client
  explicit Client(const std::filesystem::path& socket);
  [[nodiscard]] const hamelin_link& link() const noexcept { return *memory_; }
  /// Puts a measurement into the memory, with its checksum, and says so.
  void send(hamelin_measurement measurement);
  /// The same as it is.
  void send_raw(const hamelin_measurement& measurement);
  /// Waits for the set point of a period, at most so long. @return whether there is one
  [[nodiscard]] bool receive(std::uint64_t sequence, double timeout_s);
  /// The last one that was whole.
  [[nodiscard]] const hamelin_setpoint& setpoint() const noexcept { return setpoint_; }
  [[nodiscard]] bool is_open() const noexcept { return connection_.is_open(); }
  /// Set points whose checksum was wrong.
  [[nodiscard]] std::uint64_t damaged() const noexcept { return damaged_; }

 private:
  LinkMemory memory_;
  Connection connection_;
  hamelin_setpoint setpoint_{};
  std::uint64_t damaged_ = 0;
  std::string text_;
};

/// What a simulated robot does wrong: shares of its periods.
struct Faults {
  double lost = 0.0;      ///< the measurement is not sent
  double late = 0.0;      ///< it is sent after the server has given up waiting
  double repeated = 0.0;  ///< it is sent twice
  double damaged = 0.0;   ///< a bit of it is wrong
  std::uint64_t seed = 1;
};

struct SimulatedClientOptions {
  std::filesystem::path socket;
  Faults faults;
  bool real_time = false;  ///< keep to the period by the clock; else as fast as the server answers
  /// Periods whose set point does not come within this time go on with the last one [s].
  double patience_s = 1.0;
  const std::atomic<bool>* stop = nullptr;  ///< ends the run
};

struct SimulatedClientReport {
  log::Result result;  ///< outcome and figures of the robot's side
  long periods = 0;
  Faults made;                  ///< counts of what it did wrong, not shares
  long unanswered = 0;          ///< periods without a set point of their own
  TimeHistogram round_trip_us;  ///< from sending a measurement to its set point, without faults
  std::uint64_t lost = 0, late = 0, damaged = 0;  ///< measurements by the server's account
  long stopping = 0;                              ///< periods in which the controller stopped
};

/// Moves the simulated robot of a scene by the set points of a server, until its goals are reached,
/// the scene's duration is over, or it touches something.
/// @throws Error as simulation::Robot and Client, and invalid if the server is for another arm
[[nodiscard]] SimulatedClientReport run_simulated_client(
    const scene::Scene& scene, const simulation::PlantFactory& plant_factory,
    const SimulatedClientOptions& options);

}  // namespace hamelin::serve
