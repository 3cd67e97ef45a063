#pragma once
#include <Eigen/Core>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "arms.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/core/rng.hpp"
#include "world_updates.hpp"

namespace hamelin::test {

/// How often what was done to a controller.
struct Events {
  long measurements = 0;  ///< ticks whose measurement could not be used
  long late = 0;          ///< ticks in which answers came late
  long stops = 0, resumptions = 0, resets = 0;
  long loads = 0, refused_loads = 0;  ///< that took effect, and that a tick refused
  long worlds = 0, goals = 0, params = 0;
  long refused = 0;  ///< updates that were invalid
  Events& operator+=(const Events& other);
};

/// What a tick is given.
struct Measurement {
  double time_s = 0.0;
  Eigen::VectorXd q, v;
};

/// Does everything to a controller that its interface allows, at random times.
class Disturbances {
 public:
  /// @param bare the model of the arm without loads @param has_map whether the map can change
  Disturbances(control::Controller& controller, Arm& arm, const model::Model& bare, bool has_map,
               std::uint64_t seed);

  /// Before a tick. @return whether it is the first one after reset()
  bool disturb(double time_s);
  /// The measurement for the tick.
  [[nodiscard]] Measurement measure(double time_s);
  /// After a tick. @return the model of the arm with what it carries since this tick, if that is
  /// another one
  [[nodiscard]] std::optional<model::Model> take_load();

  /// The largest number of ticks in a row without a measurement.
  [[nodiscard]] int longest_blind() const noexcept { return longest_blind_; }
  /// Whether disturb() has asked the next tick to resume.
  [[nodiscard]] bool resumes() const noexcept { return resumes_; }
  [[nodiscard]] const Events& events() const noexcept { return events_; }
  /// The last events with their times, the newest first.
  [[nodiscard]] std::string trail() const;
  /// For Options::clock_s: the planners of this thread take as long as disturb() has chosen.
  static double clock_s();

 private:
  void note(const std::string& event);
  [[nodiscard]] bool happens(double share) { return rng_.uniform() < share; }
  template <class F>
  void attempt(long& count, F&& change);
  void stop_or_resume();
  /// Moves the arm by hand and resets the controller, if the arm rests. @return whether it did
  bool guide_by_hand(double time_s);
  [[nodiscard]] std::optional<Eigen::VectorXd> free_configuration(double time_s);
  void change_load();
  void change_goals();
  void change_params();
  void begin_faults();

  control::Controller& controller_;
  Arm& arm_;
  const model::Model& bare_;
  Eigen::VectorXd start_q_;
  Rng rng_;
  WorldUpdates world_;
  Events events_;
  double time_s_ = 0.0;
  std::deque<std::string> trail_;
  bool resumes_ = false;
  bool guided_ = false;                     ///< whether somebody waits to move the arm by hand
  long since_start_ = 0;                    ///< ticks since the first one or the last reset()
  int late_ = 0, blind_ = 0, untimed_ = 0;  ///< ticks for which this goes on
  int how_ = 0;
  int longest_blind_ = 0;
  int payloads_ = 0;
  std::map<std::string, scene::Payload> known_;
  std::map<std::uint64_t, std::vector<scene::Payload>> loads_;
  std::uint64_t load_ = 0, refused_load_ = 0;
};

}  // namespace hamelin::test
