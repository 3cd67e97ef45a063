#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::scene {

/// The nearest shapes of two parts of the arm; world frame. The fields are those of
/// hamelin_self_contact.
struct SelfContact {
  static constexpr int base = -1;  ///< `sphere_b`: a shape of Robot::base_spheres or base_segments
  int pair = 0;                    ///< index into SelfField::pairs()
  int sphere_a = 0, sphere_b = 0;  ///< indices into Model::shapes()
  double distance = 0.0;           ///< between the surfaces [m]; zero or below is contact
  Eigen::Vector3d point_a = Eigen::Vector3d::Zero(),
                  point_b = Eigen::Vector3d::Zero();    ///< on the surfaces
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit, from b towards a
};

/// Distances between the pairs of parts of the arm that can collide: docs/theory.md (11.34). Parts
/// are links, and bodies that were lumped into links or into the base. Pairs on the same link are
/// left out, as are pairs that the robot lists as disabled. If a robot lists no pairs, neighbouring
/// links are not checked, because they may overlap at their joint; note() says so. Immutable; may
/// be shared between threads.
class SelfField {
 public:
  struct Part {
    std::string name;
    int body = 0;             ///< index of its moving link; −1: the base
    std::vector<int> shapes;  ///< into Model::shapes(); base: −1 − (index: spheres, then capsules)
    int center = 0;           ///< the shape at the centre of the bounding ball (11.36)
    double radius = 0.0;      ///< of the bounding ball [m]
  };
  struct Pair {
    int part_a = 0, part_b = 0;  ///< into parts(); a moves, and is nearer to the base if both move
  };

  explicit SelfField(const model::Model& model);

  [[nodiscard]] const std::vector<Part>& parts() const noexcept { return parts_; }
  [[nodiscard]] const std::vector<Pair>& pairs() const noexcept { return pairs_; }
  /// Describes a pair by its parts: "'a' and 'b'".
  [[nodiscard]] std::string describe(int pair) const;
  /// One line if neighbouring links are not checked because the robot lists no disabled pairs; else
  /// empty.
  [[nodiscard]] const std::string& note() const noexcept { return note_; }

  /// The nearest shapes of each pair of parts no farther apart than `limit` [m], in the order of
  /// pairs().
  /// @param arm Model::shapes() in the world, see PlacedShapes
  /// @param out receives them; if it is too small, the nearest of all
  /// @return how many there are, even if out is smaller. No allocation.
  std::size_t closest(const Shapes& arm, double limit, std::span<SelfContact> out) const;

  /// Distance of one pair of parts [m], or `limit` if that is less. No allocation.
  [[nodiscard]] double distance(std::size_t pair, const Shapes& arm, double limit) const;

 private:
  struct Nearest {
    double distance = 0.0;
    int a = 0, b = 0;
  };
  void add_parts(const model::Model& model);
  void add_bounding_balls(const model::Model& model);
  void add_pairs(const model::Robot& robot);
  [[nodiscard]] const Eigen::Vector3d& center(int shape, const Shapes& arm) const {
    return shape >= 0 ? arm.centers[static_cast<std::size_t>(shape)]
                      : base_centers_[static_cast<std::size_t>(-1 - shape)];
  }
  [[nodiscard]] double radius(int shape) const {
    return shape >= 0 ? radii_[static_cast<std::size_t>(shape)]
                      : base_radii_[static_cast<std::size_t>(-1 - shape)];
  }
  [[nodiscard]] Eigen::Vector3d half_axis(int shape, const Shapes& arm) const;
  /// Half the length of a shape's axis.
  [[nodiscard]] double half_length(int shape) const {
    return shape >= 0 ? half_lengths_[static_cast<std::size_t>(shape)]
                      : base_half_lengths_[static_cast<std::size_t>(-1 - shape)];
  }
  /// Replaces `best` by the pair's nearest shapes if they are nearer. `capsules`: whether there may
  /// be any.
  template <bool capsules>
  bool update_nearest(const Pair& pair, const Shapes& arm, Nearest& best) const;
  bool update_nearest(const Pair& pair, const Shapes& arm, Nearest& best) const {
    return has_capsules_ ? update_nearest<true>(pair, arm, best)
                         : update_nearest<false>(pair, arm, best);
  }

  std::vector<Part> parts_;
  std::vector<Pair> pairs_;
  bool has_capsules_ = false;
  std::vector<double> radii_, base_radii_, half_lengths_, base_half_lengths_;
  std::vector<Eigen::Vector3d> base_centers_, base_half_axes_;  ///< world
  std::string note_;
};

struct RobotRef;

/// Advice for a start that is refused because two parts touch: the command that finds pairs that
/// touch by construction and lists them as disabled.
[[nodiscard]] std::string self_contact_remedy(const RobotRef& robot);

/// The nearest points of two segments, each given by its centre and half axis (zero for a point),
/// as positions on the axes from −1 to 1: docs/theory.md (11.35). For parallel and degenerate
/// segments, the result is one of the nearest pairs, always the same.
struct AxisPair {
  double on_a = 0.0, on_b = 0.0;
};
[[nodiscard]] AxisPair nearest_on_axes(const Eigen::Vector3d& center_a,
                                       const Eigen::Vector3d& half_a,
                                       const Eigen::Vector3d& center_b,
                                       const Eigen::Vector3d& half_b);

}  // namespace hamelin::scene
