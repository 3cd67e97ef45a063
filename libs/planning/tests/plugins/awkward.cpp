// A test planner that uses every channel and breaks one rule of the interface on request.
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "hamelin/core/isa.hpp"
#include "hamelin/planning/plugin.hpp"

namespace {

using namespace hamelin::planning;

constexpr const char* schema = R"({
  "type": "object",
  "properties": {
    "fault": {"type": "string", "default": ""},
    "gain": {"type": "number", "minimum": 0, "maximum": 10, "default": 2},
    "nested": {"type": "object", "default": {}, "properties": {"depth": {"type": "integer", "default": 3}}}
  }
})";

class Awkward : public Planner {
 public:
  static double influence_m(const hamelin::Json& params) {
    return 0.25 * params.at("gain").get<double>();
  }

  Awkward(const Host& host, const Setup& setup, const hamelin::Json& params)
      : host_(host),
        setup_(setup),
        fault_(params.at("fault").get<std::string>()),
        gain_(params.at("gain").get<double>()),
        contacts_(4) {
    if (fault_ == "throw in constructor")
      throw hamelin::Error(hamelin::ErrorCode::invalid, "this gain\nis out of tune");
    if (fault_ == "throw an int") throw 42;
    if (params.at("nested").at("depth") != 3) throw std::runtime_error("nested default missing");
    host_.warning("awkward is here");
    if (fault_ == "instruction set")
      host_.warning(std::string(hamelin::name_of(hamelin::default_isa())));
  }

  void tick(const Tick& tick, Command& command) override {
    if (fault_ == "throw in tick") throw std::runtime_error("tick went wrong");
    if (fault_ == "give up") command.give_up("no way on");
    command.set_potential(0.5 * gain_);
    command.potential_gradient() = gain_ * tick.q();
    command.damping().setConstant(gain_);
    command.held_torque() = -tick.v();
    command.add_gyroscopic(setup_.dof() - 1, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ());
    command.set_accounts(-0.5, 0.25);
    if (fault_ == "nan") command.held_torque()[0] = std::numeric_limits<double>::quiet_NaN();
    if (fault_ == "negative damping") command.damping()[0] = -1.0;
    if (fault_ == "wrong link")
      command.add_gyroscopic(setup_.dof(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    if (fault_ == "many terms")
      for (int i = 0; i < 100; ++i)
        command.add_gyroscopic(0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    if (fault_ == "state") command.raw().state = 17;
    if (fault_ == "sum")  // as plain_c.c
      command.held_torque() << sum_of_contacts(tick), sum_of_query(tick), sum_of_setup();
    if (fault_ == "node velocity") command.node_velocity() = 0.5 * tick.v();
    if (fault_ == "closest points") {
      const auto q = tick.q();
      const auto count = host_.closest_points({q.data(), static_cast<std::size_t>(q.size())},
                                              setup_.influence_m(), contacts_);
      command.held_torque()[0] = static_cast<double>(count) + contacts_[0].distance_m;
    }
  }

 private:
  static double sum_of_contacts(const Tick& tick) {
    double sum = 0.0;
    for (const auto& contact : tick.contacts()) sum += contact.distance_m;
    return sum;
  }
  double sum_of_query(const Tick& tick) {
    const auto q = tick.q();
    const auto count =
        host_.closest_points({q.data(), static_cast<std::size_t>(q.size())}, 0.5, contacts_);
    double sum = 0.0;
    for (std::size_t i = 0; i < std::min(count, contacts_.size()); ++i)
      sum += contacts_[i].distance_m;
    return sum;
  }
  [[nodiscard]] double sum_of_setup() const {
    double sum = 0.0;
    for (const auto& goal : setup_.goals()) sum += goal.tolerance_m;
    for (std::size_t i = 0; i < setup_.shapes().size(); ++i) sum += setup_.shapes()[i].radius_m;
    return sum;
  }

  Host host_;
  Setup setup_;
  std::string fault_;
  double gain_;
  std::vector<hamelin_contact> contacts_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Awkward, "awkward", "0.0.1",
                       "breaks a rule of the plugin interface on request", schema);
