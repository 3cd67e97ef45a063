#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::simulation {

/// A motion that leads out of a moving obstacle's way. From its start the arm brakes along its
/// velocity, and on top of this it moves by `way`:
///
///     q(t) = q + v T (s − F(s)) + way f(s),  s = t/T,
///
/// where T is the duration, f = 10 s³ − 15 s⁴ + 6 s⁵ and F(s) = ∫₀ˢ f. It ends at rest at
/// q + v T/2 + way, and its acceleration is zero at both ends.
struct Evasion {
  enum class Kind : std::int32_t {
    stop,  ///< brakes only
    back,  ///< to where the arm was before
    aside
  };
  struct State {
    Eigen::VectorXd q, v, a, jerk;
  };

  Kind kind = Kind::stop;
  double start_s = 0.0, duration_s = 0.0;
  Eigen::VectorXd q, v, way;  ///< at the start [rad or m, and per s]; way: size of q

  /// The state so long after the start; at rest after the duration.
  void at(double time_s, State& state) const;
  [[nodiscard]] Eigen::VectorXd end() const { return q + 0.5 * duration_s * v + way; }
};
[[nodiscard]] std::string_view to_string(Evasion::Kind kind) noexcept;

/// avoidable: when the controller would have had to decide, it knew of the obstacle, the motion
/// that the arm made was predicted to touch something, and an evasion existed that was clear both
/// as predicted and in fact; avoidable_in_hindsight: evasions existed, but not with what was known;
/// unavoidable: none of the motions that were tried avoids the contact.
enum class Avoidability : std::int32_t { avoidable, avoidable_in_hindsight, unavoidable };
[[nodiscard]] std::string_view to_string(Avoidability verdict) noexcept;

struct ExplainOptions {
  std::uint64_t seed = 1;                 ///< of random motions
  int motions = 2000;                     ///< tried from each start
  static constexpr double back_s = 2.0;   ///< the earliest start before the contact
  static constexpr double grid_s = 0.01;  ///< least time between two starts
  static constexpr double after_s = 0.5;  ///< for so long after the contact it must stay clear
  std::function<void(double done, double all)> progress;  ///< called after each start
};

/// What a search after a run found about the contact at its end.
struct Explanation {
  std::string nothing;  ///< why there is nothing to explain; then the rest is not set
  Json contact;         ///< `mover_contact` of the result
  Avoidability verdict = Avoidability::unavoidable;
  /// Since when the controller knew of the obstacle; none: never.
  std::optional<double> known_since_s;

  struct Found {
    Evasion evasion;
    double decided_s = 0.0;  ///< when the controller had to decide: the delay before the start
    bool known = false;      ///< whether it knew of the obstacle then
    /// Whether the evasion was clear of all obstacles that it knew of, as predicted then.
    bool looked_clear = false;
    /// Whether the motion that the arm made was predicted to come within 1 cm of one of them. False
    /// where it did not know of the obstacle.
    bool contact_predicted = false;
  };
  std::optional<Found> latest;  ///< with the latest start
  /// With the latest start of those that looked clear while a contact was predicted.
  std::optional<Found> latest_foreseen;

  /// The starts that were searched, from the contact backwards until an evasion was found.
  struct Search {
    double first_s = 0.0, last_s = 0.0;  ///< earliest and latest start; equal if there is none
    long starts = 0, motions = 0;        ///< motions within the limits of the joints
    int motions_per_start = 0;
    std::uint64_t seed = 0;
  };
  Search search;

  /// Ticks of the last second in which the same was done.
  struct Act {
    std::string what;  ///< cause of a stop, or value of the planner's series `evasion`
    bool evades = false;
    double from_s = 0.0, to_s = 0.0;
  };
  std::vector<Act> stops, planner_acts;
  std::vector<std::string> notes;  ///< limits of the search, one line each
};

/// Searches motions that would have avoided the contact with a moving or appearing obstacle at the
/// end of a run. They start at logged states, stay within the limits that the scene models, and are
/// clear of everything, sampled every 2 ms, until 0.5 s after the contact.
/// @throws Error io, parse or invalid for files that are not complete logs of hamelin, or whose
///         inputs are missing or have changed
[[nodiscard]] Explanation explain(const std::filesystem::path& log, const ExplainOptions& options);

/// Schema hamelin.explanation/1.
[[nodiscard]] Json to_json(const Explanation& explanation);

}  // namespace hamelin::simulation
