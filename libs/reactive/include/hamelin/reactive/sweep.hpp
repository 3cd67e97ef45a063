#pragma once
#include <algorithm>
#include <vector>

#include "hamelin/reactive/movers.hpp"

namespace hamelin::reactive {

/// Where moving obstacles were in the last seconds. What swings or turns in place will be there
/// again. Only the constructor allocates.
class Sweep {
 public:
  static constexpr double interval_s = 0.1;
  static constexpr std::size_t capacity = 32;  ///< 3.2 s

  explicit Sweep(const Movers& movers) : movers_(movers), places_(capacity) {}
  void clear() noexcept {
    count_ = 0;
    movers_count_ = 0;
  }
  /// Records the present places, if the last ones are old enough.
  void record(double time_s, const Movers::Places& now) {
    if (movers_.count() != movers_count_) clear();
    if (count_ > 0 && time_s < recorded_s_ + interval_s) return;
    movers_count_ = movers_.count();
    recorded_s_ = time_s;
    places_[next_] = now;
    next_ = (next_ + 1) % capacity;
    count_ = std::min(count_ + 1, capacity);
  }
  /// The smallest distance of the arm from all places, or `limit` if that is less [m].
  [[nodiscard]] double clearance(const scene::Shapes& arm, double limit) const {
    for (std::size_t i = 0; i < count_; ++i) limit = movers_.clearance(arm, places_[i], limit);
    return limit;
  }
  /// Calls use(point) for the point of each link that is nearest to any place within `radius`.
  template <class Use>
  void each_near(const scene::Shapes& arm, double radius, const Use& use) {
    nearest_.clear();
    for (std::size_t i = 0; i < count_; ++i)
      movers_.each_near(arm, places_[i], radius, [&](const MoverPoint& point) {
        const auto same = std::find_if(nearest_.begin(), nearest_.end(),
                                       [&](const auto& other) { return other.link == point.link; });
        if (same == nearest_.end())
          nearest_.push_back(point);
        else if (point.distance < same->distance)
          *same = point;
      });
    for (const MoverPoint& point : nearest_) use(point);
  }
  void reserve(std::size_t links) { nearest_.reserve(links); }

 private:
  const Movers& movers_;
  std::vector<Movers::Places> places_;
  std::vector<MoverPoint> nearest_;
  std::size_t count_ = 0, next_ = 0, movers_count_ = 0;
  double recorded_s_ = 0.0;
};

}  // namespace hamelin::reactive
