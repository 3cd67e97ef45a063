#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "container.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/environment.hpp"
#include "world.hpp"

namespace hamelin::report {

/// Channels of a tick, in the order of Frame::channels.
inline constexpr std::array<const char*, 5> channel_names{"potential", "damping", "gyroscopic",
                                                          "held", "node"};

/// A tick that becomes a pose of the replayed arm.
struct Frame {
  double time_s = 0.0;
  Eigen::VectorXd q;
  std::size_t goal_index = 0;
  std::optional<Eigen::Vector3d> target{};  ///< position of the target that is followed
  /// Joint torques of the channels; empty if a channel is not used.
  std::array<Eigen::VectorXd, channel_names.size()> channels;
};

/// Collects the columns of the frames and computes what the log does not contain: clearances,
/// closest points, forces at the tip.
class Frames {
 public:
  explicit Frames(const World& world);
  void add(const Frame& frame);
  [[nodiscard]] Json json(Container& container, double step_s) const;

 private:
  /// Adds the clearance of each collision shape, and the closest points of the nearest shapes.
  void add_contacts(const Frame& frame);
  /// Adds, for each channel, the force that accelerates the tip as the channel's torque does.
  void add_forces(const Frame& frame);
  void add_target(const Frame& frame);

  const World& world_;
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  scene::Environment::Scratch scratch_;
  std::vector<scene::Contact> found_;
  dynamics::Matrix3Xd J_;
  Eigen::VectorXd acceleration_;
  std::vector<double> t_, q_, clearances_, points_;
  std::vector<double> targets_;  ///< three numbers per frame, from the first with a target on
  std::vector<std::uint16_t> goal_index_;
  std::vector<std::uint8_t> counts_;
  std::array<std::vector<double>, channel_names.size()> forces_;
  std::array<bool, channel_names.size()> channel_used_{};
};

}  // namespace hamelin::report
