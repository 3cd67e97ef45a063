#pragma once
#include <span>
#include <vector>

#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/sweep.hpp"

namespace hamelin::reactive {

/// Contacts at configurations other than the arm's present one with what stands still, queried from
/// the host, and on demand with where moving obstacles were in the last seconds. Only the
/// constructor allocates.
class Surroundings {
 public:
  Surroundings(const planning::Host& host, const planning::Setup& setup, const model::Model& model)
      : host_(host),
        model_(model),
        ws_(model),
        arm_(model),
        self_collision_(setup.self_collision()),
        contacts_(setup.shapes().size() * 4 + 16),
        self_contacts_(self_collision_ ? setup.shapes().size() * 4 + 16 : 0) {}

  /// What counts in addition to what stands still; null: nothing.
  void count(Sweep* sweep) noexcept { sweep_ = sweep; }
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
    if (sweep_ != nullptr) add_sweep(q, radius);
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
    if (sweep_ != nullptr && sweep_->clearance(place(q), margin) < margin) return false;
    return !self_collision_ || host_.closest_self(at, self_margin, {}) == 0;
  }

 private:
  [[nodiscard]] scene::Shapes place(const Eigen::VectorXd& q) {
    dynamics::forward_kinematics(model_, ws_, q);
    arm_.place(model_, ws_);
    return arm_.view();
  }
  void add_sweep(const Eigen::VectorXd& q, double radius) {
    const scene::Shapes arm = place(q);
    sweep_->each_near(arm, radius, [&](const MoverPoint& point) {
      if (count_ == contacts_.size()) return;
      hamelin_contact& contact = contacts_[count_++];
      contact = {};
      contact.shape = point.shape;
      contact.obstacle = point.obstacle;
      contact.distance_m = point.distance;
      const Eigen::Vector3d on_arm =
          point.axis_point - arm.radii[static_cast<std::size_t>(point.shape)] * point.direction;
      planning::VectorMap(contact.arm_point_world_m, 3) = on_arm;
      planning::VectorMap(contact.obstacle_point_world_m, 3) =
          on_arm - point.distance * point.direction;
      planning::VectorMap(contact.direction_world, 3) = point.direction;
    });
  }

  planning::Host host_;
  const model::Model& model_;
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  bool self_collision_;
  Sweep* sweep_ = nullptr;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_self_contact> self_contacts_;
  std::size_t count_ = 0, self_count_ = 0;
};

}  // namespace hamelin::reactive
