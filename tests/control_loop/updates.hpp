#pragma once
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "hamelin/control/controller.hpp"
#include "hamelin/core/rng.hpp"

namespace hamelin::test {

/// A sphere, box, cylinder or capsule that the arm of data/ can reach, or nearly so.
[[nodiscard]] scene::Obstacle random_obstacle(Rng& rng, std::string name);
/// A configuration within the limits of the joints.
[[nodiscard]] Eigen::VectorXd random_joints(Rng& rng, const model::Robot& robot);

/// Two threads that change the world, the goals and the parameters of a controller at random, and a
/// third one that streams poses of obstacles, until it is destroyed. Some of the changes are bad
/// and must be refused.
class Updates {
 public:
  /// What the threads tell about the changes that they made; called by these threads.
  struct Record {
    std::function<void(std::shared_ptr<const control::WorldSnapshot>)> world;
    std::function<void(std::uint64_t number, const std::vector<scene::Goal>&)> goals;
    std::function<void(const Json& params)> before_params;  ///< before the call that sets them
  };
  struct Counts {
    std::atomic<long> obstacles{0}, observations{0}, maps{0}, goals{0}, params{0}, refused{0};
    /// Changes that were refused although they are good, or made although they are bad.
    std::atomic<long> wrong{0};
  };

  /// @param param a number of the planner that can be changed while it runs, and its range
  struct Param {
    std::string name;
    double low, high;
  };
  /// @param now_s time of the controller's last tick, for obstacles that move
  /// @param streams how many further obstacles are streamed; 0: there is no third thread
  Updates(control::Controller& controller, const scene::Scene& scene,
          const std::atomic<double>& now_s, Param param, std::uint64_t seed, Record record = {},
          std::size_t streams = 0);
  Updates(const Updates&) = delete;
  Updates& operator=(const Updates&) = delete;
  ~Updates() { stop(); }
  /// Ends the threads.
  void stop();
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  void change_obstacles(std::uint64_t seed);
  void observe_obstacles(std::uint64_t seed);
  void observe_wrongly(Rng& rng, const std::string& name, double last_s);
  void change_rest(std::uint64_t seed);
  void set_goals(Rng& rng);
  void set_params(Rng& rng);
  void change_map(Rng& rng);
  /// Makes a change of the world. @return whether it was accepted
  template <class F>
  bool attempt(bool good, std::atomic<long>& count, F&& change);
  template <class F>
  void change_world(bool good, std::atomic<long>& count, F&& change);

  control::Controller& controller_;
  scene::Scene scene_;
  model::Robot robot_;
  const std::atomic<double>& now_s_;
  Param param_;
  Record record_;
  std::size_t streams_;
  Counts counts_;
  std::atomic<bool> stop_{false};
  std::thread obstacles_, observations_, rest_;
};

}  // namespace hamelin::test
