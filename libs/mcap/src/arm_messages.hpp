#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "foxglove.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::mcap {

/// The arm as a viewer draws it: frames that move, collision shapes that are fixed to them, and
/// what the arm carries or has left behind.
class ArmMessages {
 public:
  /// @param model must outlive this object
  ArmMessages(const scene::Scene& scene, const model::Model& model);

  /// Appends the poses in the world of all links (their centres of mass) and of the tip.
  void add_transforms(std::uint64_t time_ns, const Eigen::VectorXd& q, Json& transforms);
  void attach(const std::string& name);
  /// @param q configuration in which it is left behind; empty: it is not drawn any more
  void detach(const std::string& name, const Eigen::VectorXd& q);
  /// A foxglove.SceneUpdate of all collision shapes.
  [[nodiscard]] Json shapes(std::uint64_t time_ns) const;

 private:
  struct Load {
    scene::Payload payload;
    std::optional<geometry::SE3> left_at;  ///< pose in the world; none: at the tip
  };
  /// Whether a shape of the model belongs to what the arm carries at the start.
  [[nodiscard]] bool is_carried(const std::string& part) const;
  [[nodiscard]] Entity link_shapes(std::uint64_t time_ns, const model::Link& link) const;
  [[nodiscard]] Entity base_shapes(std::uint64_t time_ns) const;
  [[nodiscard]] Entity load_shapes(std::uint64_t time_ns, const Load& load) const;

  const model::Model& model_;
  dynamics::Workspace ws_;
  std::string carried_at_start_;       ///< name of the payload; empty: none
  std::vector<scene::Payload> known_;  ///< everything that may be attached
  std::vector<Load> loads_;
};

}  // namespace hamelin::mcap
