#pragma once
#include <span>
#include <vector>

#include "hamelin/planning/plugin.hpp"

namespace hamelin::reactive {

/// Contacts at configurations other than the arm's present one with what stands still, queried from
/// the host, and on demand with where moving obstacles were in the last seconds. Only the
/// constructor allocates.
class Surroundings {
 public:
  Surroundings(const planning::Host& host, const planning::Setup& setup)
      : host_(host),
        self_collision_(setup.self_collision()),
        contacts_(setup.shapes().size() * 4 + 16),
        self_contacts_(self_collision_ ? setup.shapes().size() * 4 + 16 : 0) {}

  /// Finds the contacts at q up to `radius` from obstacles and the self contacts up to
  /// `self_radius` [m]. @param ahead_s time at which moving obstacles count where they are
  /// predicted to be; below 0 they do not count
  void query(const Eigen::VectorXd& q, double radius, double self_radius, double ahead_s = -1.0) {
    const std::span<const double> at(q.data(), static_cast<std::size_t>(q.size()));
    const bool moving = ahead_s >= 0.0;
    count_ =
        std::min(host_.closest_ahead(at, moving ? ahead_s : 0.0,
                                     moving ? HAMELIN_STANDING | HAMELIN_MOVING : HAMELIN_STANDING,
                                     radius, contacts_),
                 contacts_.size());
    self_count_ = 0;
    if (self_collision_)
      self_count_ =
          std::min(host_.closest_self(at, self_radius, self_contacts_), self_contacts_.size());
  }
  [[nodiscard]] std::span<const hamelin_contact> contacts() const {
    return {contacts_.data(), count_};
  }
  [[nodiscard]] std::span<const hamelin_self_contact> self_contacts() const {
    return {self_contacts_.data(), self_count_};
  }
  /// Whether all obstacles are farther than `margin` and all parts of the arm farther from each
  /// other than `self_margin` at q [m].
  [[nodiscard]] bool is_clear(const Eigen::VectorXd& q, double margin, double self_margin) {
    const std::span<const double> at(q.data(), static_cast<std::size_t>(q.size()));
    if (host_.closest_ahead(at, 0.0, HAMELIN_STANDING, margin, {}) > 0) return false;
    return !self_collision_ || host_.closest_self(at, self_margin, {}) == 0;
  }

 private:
  planning::Host host_;
  bool self_collision_;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_self_contact> self_contacts_;
  std::size_t count_ = 0, self_count_ = 0;
};

}  // namespace hamelin::reactive
