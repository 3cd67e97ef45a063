#pragma once
#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::report {

/// What the arm of a run carries, from the events of its log.
class Loads {
 public:
  /// @param scene its events describe what is attached @param tip in the base frame at q = 0
  Loads(const scene::Scene& scene, const geometry::SE3& tip);

  /// @param q configuration of the event
  void attach(const std::string& name, double time_s);
  void detach(const std::string& name, double time_s, const Eigen::VectorXd& q);
  /// One object for each: name, times, the obstacle that it is, balls in the base frame at q = 0
  /// that move with the tip, and the configuration in which it was detached.
  [[nodiscard]] Json take() { return std::move(loads_); }

 private:
  [[nodiscard]] Json balls_of(const std::string& name) const;
  /// The obstacle of this name is not where it was left any more.
  void take_up(const Json& obstacle, double time_s);

  std::vector<scene::Payload> known_;
  std::map<std::string, std::string> obstacles_;  ///< by the name of the load
  geometry::SE3 tip_;
  Json loads_ = Json::array();
};

/// Centres of the balls as which a capsule is drawn, from one end of its axis to the other.
[[nodiscard]] std::vector<Eigen::Vector3d> balls_along(const Eigen::Vector3d& from,
                                                       const Eigen::Vector3d& to, double radius);

}  // namespace hamelin::report
