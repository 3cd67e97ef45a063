#pragma once
#include "roots.hpp"

namespace hamelin::hybrid {

/// A via is reached when the error of every joint is below this [rad or m].
inline constexpr double via_tolerance = 0.1;

/// Searches for an escape path after a stall, some configurations per tick.
class Search {
 public:
  Search() = default;
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;
  virtual ~Search() = default;
  /// Repeats the random numbers from the first one on, for a new start.
  virtual void reset() = 0;
  /// Starts a new search at q.
  /// @param goal_path the goal's path, or null
  /// @param from the arc length at which the arm is on it
  virtual void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* goal_path,
                     double from) = 0;
  /// Checks up to `units` configurations. Does not allocate. @return whether the search has ended
  [[nodiscard]] virtual bool advance(int units) = 0;
  /// Results after the end: the escape path, empty if none was found; whether it arrives at the
  /// goal or on its path; and the arc length at which it rejoins the goal's path.
  [[nodiscard]] virtual const JointPath& path() const = 0;
  [[nodiscard]] virtual bool arrives() const = 0;
  [[nodiscard]] virtual double rejoin_arc_length() const = 0;
  /// The number of configurations checked so far, over all searches.
  [[nodiscard]] virtual long units() const = 0;
};

}  // namespace hamelin::hybrid
