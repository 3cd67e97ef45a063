#pragma once
#include <array>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::reactive {

/// Where a moving obstacle is predicted to be.
struct MoverPlace {
  geometry::SE3 pose;
  double nearer = 0.0;  ///< by how much it may be nearer than its pose says [m]
};

/// The point of a link that is nearest to a moving obstacle.
struct MoverPoint {
  int link = 0, shape = 0, mover = 0;
  int obstacle = 0;            ///< the id of the mover
  double distance = 0.0;       ///< from the shape's surface [m]
  Eigen::Vector3d axis_point;  ///< on the axis of the shape, world
  Eigen::Vector3d direction;   ///< unit, from the obstacle to the shape, world
};

/// Sets row to a = Jᵀ n of the arm's point: the rate at which the arm moves it away from the mover.
/// ws contains the forward kinematics of `arm`.
void row_of(const MoverPoint& point, const model::Model& model, const dynamics::Workspace& ws,
            const scene::Shapes& arm, Eigen::VectorXd& row);

/// The obstacles that move, as the host predicts them. Only the constructor allocates.
class Movers {
 public:
  static constexpr std::size_t max_count = 64;  ///< the first ones of the host's list
  using Places = std::array<MoverPlace, max_count>;

  Movers(const planning::Host& host, const model::Model& model);

  /// Takes the list of a tick. @param count hamelin_tick.moving_count
  void update(std::size_t count);
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] bool contains(int obstacle) const noexcept;
  /// Where they will be some time after the tick of the last update().
  void predict(double ahead_s, Places& places);

  /// The smallest distance of the arm from the movers at these places, or `limit` if that is less
  /// [m].
  [[nodiscard]] double clearance(const scene::Shapes& arm, const Places& places,
                                 double limit) const;
  /// Whether the mover, which is at `now`, will have passed the arm's point when it is where the
  /// point was found: it is then nearest to it from the other side.
  [[nodiscard]] bool has_passed(const MoverPoint& point, const MoverPlace& now) const;
  /// Calls use(point) for the nearest point of each link from each mover that is within `radius`.
  template <class Use>
  void each_near(const scene::Shapes& arm, const Places& places, double radius,
                 const Use& use) const {
    for (std::size_t m = 0; m < count_; ++m)
      for (const Span& link : links_)
        if (MoverPoint point; nearest(arm, link, m, places[m], radius, point)) use(point);
  }

 private:
  /// The shapes of a link: [first, last).
  struct Span {
    int link;
    std::size_t first, last;
  };
  [[nodiscard]] bool nearest(const scene::Shapes& arm, const Span& link, std::size_t mover,
                             const MoverPlace& place, double radius, MoverPoint& point) const;

  planning::Host host_;
  std::vector<Span> links_;
  std::size_t count_ = 0;
  std::vector<hamelin_obstacle_state> states_;
  std::array<int, max_count> ids_{};
  std::array<scene::Obstacle, max_count> solids_;  ///< shapes and sizes
  std::array<double, max_count> balls_{};          ///< bounding radii [m]
};

}  // namespace hamelin::reactive
