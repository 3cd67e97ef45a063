#pragma once
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "hamelin/control/controller.hpp"
#include "hamelin/core/time_histogram.hpp"
#include "hamelin/serve/keeper.hpp"
#include "hamelin/serve/link.hpp"

namespace hamelin::serve {

class Clerk;

struct ServerOptions {
  std::filesystem::path socket;
  bool position = false;  ///< what the controller was made for
  /// How long a measurement may be overdue before its period counts as one without [s]; below 0:
  /// the server waits as long as it takes.
  double patience_s = 0.0;
  /// So many periods in a row are made up for where sequence numbers leave them out.
  int gap_max = 10;
  std::filesystem::path folder;  ///< that relative paths in requests start from
};

/// Serves one client after another with the set points of a controller, see hamelin_frames.h.
class Server {
 public:
  /// What happened while a client was there.
  struct Report {
    Keeper::Counts counts;
    TimeHistogram answer_us;  ///< from the message of a measurement to that of its set point
    control::ControlState state = control::ControlState::running;
    std::size_t goals_reached = 0, goals = 0;
    std::uint64_t refused_requests = 0;  ///< not answered, because too many were waiting
  };
  /// @param controller kept by reference; only the server lets it tick
  /// @throws Error io, or invalid for an arm with too many joints
  Server(control::Controller& controller, const ServerOptions& options);

  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Serves until `stop` is set. @param gone is called when a client has gone; false ends
  void run(const std::atomic<bool>& stop, const std::function<bool(const Report&)>& gone);

 private:
  void serve(const Connection& client, const std::atomic<bool>& stop);
  /// Takes the measurement that is in the memory. @return whether it has its set point
  [[nodiscard]] bool take_measurement(const Connection& client, double since_s);
  /// Hands over a memory of the client's own, which the one before cannot write to.
  [[nodiscard]] bool hand_over_memory(const Connection& client);
  /// Hands the set point of the last period to the client.
  void answer(const Connection& client);
  void answer_text(const Connection& client, std::string text);
  void turn_away_others();
  /// On a thread of its own: it takes longer than a period. @return false if too much waits there
  [[nodiscard]] bool resume();

  control::Controller& controller_;
  ServerOptions options_;
  Listener listener_;
  LinkMemory memory_;
  Keeper keeper_;
  Report report_;
  std::unique_ptr<Clerk> clerk_;
};

}  // namespace hamelin::serve
