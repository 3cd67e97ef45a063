#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "hamelin/model/model.hpp"

namespace hamelin::scene {

/// The nearest spheres of two parts of the arm; world frame. The fields are those of hamelin_self_contact.
struct SelfContact {
  static constexpr int base = -1;  ///< `sphere_b`: one of Robot::base_spheres
  int pair = 0;                    ///< index into SelfField::pairs()
  int sphere_a = 0, sphere_b = 0;  ///< indices into Model::spheres()
  double distance = 0.0;           ///< between the surfaces [m]; zero or below is contact
  Eigen::Vector3d point_a = Eigen::Vector3d::Zero(), point_b = Eigen::Vector3d::Zero();  ///< on the surfaces
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();                                   ///< unit, from b towards a
};

/// What the arm can touch of itself: pairs of its parts (links, and what was lumped into them or into the base) that
/// move against each other and that the robot does not list as disabled. A robot that lists none at all is taken to
/// mean that neighbouring links may overlap at their joint; note() says so. Immutable and shared between threads.
class SelfField {
 public:
  struct Part {
    std::string name;
    int body = 0;              ///< the moving link it is on; −1: the base
    std::vector<int> spheres;  ///< indices into Model::spheres(); of the base −1 − (index into base_spheres)
    int center = 0;            ///< the sphere about which the part's ball is drawn
    double radius = 0.0;       ///< of that ball, which holds the part [m]
  };
  struct Pair {
    int part_a = 0, part_b = 0;  ///< indices into parts(); a moves, and is nearer to the base if both do
  };

  explicit SelfField(const model::Model& model);

  [[nodiscard]] const std::vector<Part>& parts() const noexcept { return parts_; }
  [[nodiscard]] const std::vector<Pair>& pairs() const noexcept { return pairs_; }
  /// The names of a pair's parts: "'a' and 'b'".
  [[nodiscard]] std::string words(int pair) const;
  /// One line if pairs of neighbours were left out for want of a list; else empty.
  [[nodiscard]] const std::string& note() const noexcept { return note_; }

  /// The nearest spheres of each pair of parts no farther apart than `limit` [m], in the order of pairs().
  /// @param centers of Model::spheres(), world [m], as dynamics::sphere_centers gives them
  /// @param out receives them; if it is too small, the nearest of all
  /// @return how many there are, also if out is smaller. No allocation.
  std::size_t closest(std::span<const Eigen::Vector3d> centers, double limit, std::span<SelfContact> out) const;

  /// Distance of one pair of parts [m], or `limit` if that is less. No allocation.
  [[nodiscard]] double distance(std::size_t pair, std::span<const Eigen::Vector3d> centers, double limit) const;

 private:
  struct Nearest {
    double distance = 0.0;
    int a = 0, b = 0;
  };
  [[nodiscard]] const Eigen::Vector3d& center(int sphere, std::span<const Eigen::Vector3d> centers) const {
    return sphere >= 0 ? centers[static_cast<std::size_t>(sphere)]
                       : base_centers_[static_cast<std::size_t>(-1 - sphere)];
  }
  [[nodiscard]] double radius(int sphere) const {
    return sphere >= 0 ? radii_[static_cast<std::size_t>(sphere)] : base_radii_[static_cast<std::size_t>(-1 - sphere)];
  }
  /// Lowers `best` to the pair's nearest spheres if they are nearer.
  bool nearer(const Pair& pair, std::span<const Eigen::Vector3d> centers, Nearest& best) const;

  std::vector<Part> parts_;
  std::vector<Pair> pairs_;
  std::vector<double> radii_, base_radii_;
  std::vector<Eigen::Vector3d> base_centers_;  ///< world
  std::string note_;
};

}  // namespace hamelin::scene
