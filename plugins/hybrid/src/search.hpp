#pragma once
#include "roots.hpp"

namespace hamelin::hybrid {

/// A via counts as reached when no joint is farther from it than this [rad or m].
inline constexpr double via_tolerance = 0.1;

/// Looks for a way out of a stall, some configurations a tick.
class Search {
 public:
  Search() = default;
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;
  virtual ~Search() = default;
  /// Starts anew at q. @param path the goal's path, or null; `from` is how far along it the arm is
  virtual void begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const Way* path, double from) = 0;
  /// Looks at up to `units` configurations; true when it is over. Does not allocate.
  [[nodiscard]] virtual bool advance(int units) = 0;
  /// After the end: the way found, empty if none; whether it leads all the way; and how far along the goal's path.
  [[nodiscard]] virtual const Way& way() const = 0;
  [[nodiscard]] virtual bool arrives() const = 0;
  [[nodiscard]] virtual double along() const = 0;
  /// Configurations looked at since it was made.
  [[nodiscard]] virtual long units() const = 0;
};

}  // namespace hamelin::hybrid
