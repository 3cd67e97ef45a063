// A planner that reports what the host tells it about the future of obstacles. It holds the arm
// against gravity.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/planning/nominal_arm.hpp"

namespace {

using namespace hamelin::planning;

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "influence_m": {"type": "number", "default": 0.2},
    "radius_m": {"type": "number", "default": 5},
    "ahead_s": {"type": "number", "default": 0},
    "kinds": {"type": "integer", "default": 3}
  }
})";

class Foreseeing : public Planner {
 public:
  Foreseeing(const Host& host, const Setup& setup, const hamelin::Json& params)
      : host_(host),
        query_(host),
        arm_(setup),
        torque_(Eigen::VectorXd::Zero(setup.dof())),
        radius_(params["radius_m"]),
        ahead_(params["ahead_s"]),
        kinds_(params["kinds"]),
        contacts_(4096),
        states_(16) {
    for (const char* name : {"moving", "listed", "id", "x", "y", "z", "nearer", "contacts",
                             "distance", "query clearance", "query distance", "proved", "margin"})
      series_.push_back(host.declare_series(name, ""));
  }
  static constexpr std::uint32_t properties = HAMELIN_TICK_ALLOCATES;  // refresh() does
  static double influence_m(const hamelin::Json& params) { return params["influence_m"]; }

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    torque_.setZero();
    arm_.add_gravity(torque_);
    command.held_torque() = torque_;
    std::size_t next = 0;
    const auto report = [&](double value) { command.set_series(series_[next++], value); };
    const std::span<const double> q(tick.q().data(), static_cast<std::size_t>(tick.q().size()));

    report(static_cast<double>(tick.moving_count()));
    const std::size_t listed = host_.obstacles_ahead(ahead_, kinds_, states_);
    report(static_cast<double>(listed));
    const hamelin_obstacle_state state = listed > 0 ? states_[0] : hamelin_obstacle_state{};
    report(state.id);
    for (const double x : state.position_world_m) report(x);
    report(state.nearer_m);
    const std::size_t found = host_.closest_ahead(q, ahead_, kinds_, radius_, contacts_);
    report(static_cast<double>(found));
    report(nearest(found));

    (void)query_.refresh();
    report(query_.clearance(q, ahead_));
    report(nearest(query_.contacts(q, ahead_, radius_, contacts_)));
    double margin = 0.0;
    report(query_.motion_clear(q, q, 0.0, ahead_, &margin) ? 1.0 : 0.0);
    report(margin);
  }

 private:
  [[nodiscard]] double nearest(std::size_t found) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < std::min(found, contacts_.size()); ++i)
      least = std::min(least, contacts_[i].distance_m);
    return found > 0 ? least : -1e9;
  }

  Host host_;
  Query query_;
  NominalArm arm_;
  Eigen::VectorXd torque_;
  double radius_, ahead_;
  std::int32_t kinds_;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_obstacle_state> states_;
  std::vector<std::int32_t> series_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Foreseeing, "foreseeing", "0.0.1", "reports what is known of the future",
                       schema);
