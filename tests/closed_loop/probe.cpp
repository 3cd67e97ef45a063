// A planner that commands torques, velocities and accounts given by parameters, and checks the
// host's contacts and answers.
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "hamelin/planning/plugin.hpp"

namespace {

using namespace hamelin::planning;

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "torque": {"type": "array", "items": {"type": "number"}, "default": []},
    "torque_until_s": {"type": "number", "default": 1e9},
    "velocity": {"type": "array", "items": {"type": "number"}, "default": []},
    "filter_work_J": {"type": "number", "default": 0},
    "recovery_work_J": {"type": "number", "default": 0},
    "books_at_tick": {"type": "integer", "minimum": 0, "default": 0},
    "series": {"type": "boolean", "default": false},
    "draw_every": {"type": "integer", "minimum": 0, "default": 0},
    "think_of": {"type": "array", "items": {"type": "number"}, "default": []},
    "influence_m": {"type": "number", "default": 0.3}
  }
})";

class Probe : public Planner {
 public:
  static double influence_m(const hamelin::Json& params) {
    return params.at("influence_m").get<double>();
  }

  Probe(const Host& host, const Setup& setup, const hamelin::Json& params)
      : host_(host),
        setup_(setup),
        torque_(params.at("torque").get<std::vector<double>>()),
        velocity_(params.at("velocity").get<std::vector<double>>()),
        think_of_(params.at("think_of").get<std::vector<double>>()),
        torque_until_s_(params.at("torque_until_s").get<double>()),
        filter_(params.at("filter_work_J").get<double>()),
        recovery_(params.at("recovery_work_J").get<double>()),
        books_at_(params.at("books_at_tick").get<std::uint64_t>()),
        draw_every_(params.at("draw_every").get<std::uint64_t>()),
        contacts_(10000),
        self_(100) {
    if (params.at("series").get<bool>()) {
      time_series_ = host.declare_series("time", "s");
      even_series_ = host.declare_series("even ticks", "");
    }
    std::string rates = "none";
    if (const auto rate = setup.effort_rate_max()) rates = std::to_string((*rate)[0]);
    host.info("sampled " + std::to_string(setup.sampled() ? 1 : 0) + ", delay " +
              std::to_string(setup.delay_s()) + ", rate " + rates + ", path " +
              std::to_string(setup.path(setup.goals()[0]).cols()));
  }

  void tick(const Tick& tick, Command& command) override {
    const auto dof = static_cast<std::size_t>(setup_.dof());
    if (!think_of_.empty()) {
      const auto thought = host_.closest_points(think_of_, setup_.influence_m(), contacts_);
      if (thought != thought_) host_.info("thought of " + std::to_string(thought) + " contacts");
      thought_ = thought;
    }
    log_contact_kinds(tick);
    if (tick.contacts().size() != shown_)
      host_.info("shown " + std::to_string(tick.contacts().size()) + " contacts");
    shown_ = tick.contacts().size();
    const auto found = host_.closest_self({tick.q().data(), dof}, setup_.influence_m(), self_);
    const auto shown = tick.self_contacts();
    if (found != shown.size())
      throw std::runtime_error("closest_self and the tick have different numbers of contacts");
    for (std::size_t i = 0; i < found; ++i)
      if (std::memcmp(&self_[i], &shown[i], sizeof self_[i]) != 0)
        throw std::runtime_error("closest_self differs from the tick");
    if (torque_.size() == dof && tick.time_s() < torque_until_s_)
      command.held_torque() = ConstVectorMap(torque_.data(), setup_.dof());
    if (velocity_.size() == dof)
      command.node_velocity() = ConstVectorMap(velocity_.data(), setup_.dof());
    command.set_series(time_series_, tick.time_s());
    if (tick.k() % 2 == 0) command.set_series(even_series_, 2.0);
    if (draw_every_ > 0 && tick.k() % draw_every_ == 0) {
      const auto k = static_cast<double>(tick.k());
      host_.draw_path(std::vector<Eigen::Vector3d>{{k, 0.0, 0.12345}, {k, 1.0, 0.0}});
      host_.draw_path(std::vector<Eigen::Vector3d>{{-k, 0.0, 0.0}});
    }
    if (tick.k() == books_at_) command.set_accounts(filter_, recovery_);
  }

 private:
  /// Logs in one line what the contacts of the first tick are with.
  void log_contact_kinds(const Tick& tick) const {
    if (tick.k() > 0) return;
    std::size_t map = 0, unknown = 0, obstacles = 0;
    for (const auto& contact : tick.contacts()) {
      const ContactKind kind = kind_of(contact);
      ++(kind == ContactKind::map ? map : kind == ContactKind::unknown ? unknown : obstacles);
      if ((kind == ContactKind::unknown) != (contact.obstacle == HAMELIN_OBSTACLE_UNKNOWN))
        throw std::runtime_error("kind_of() and the contact disagree");
    }
    host_.info("contacts with the map " + std::to_string(map > 0 ? 1 : 0) + ", unknown space " +
               std::to_string(unknown > 0 ? 1 : 0) + ", obstacles " +
               std::to_string(obstacles > 0 ? 1 : 0));
  }

  Host host_;
  Setup setup_;
  std::vector<double> torque_, velocity_, think_of_;
  double torque_until_s_, filter_, recovery_;
  std::uint64_t books_at_, draw_every_;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_self_contact> self_;
  std::size_t thought_ = 0, shown_ = 0;
  std::int32_t time_series_ = -1, even_series_ = -1;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Probe, "probe", "0.0.1", "moves as its parameters say and checks the host",
                       schema);
