// A planner that drives the arm into the nearest obstacle, into itself, past its limits, or
// anywhere, as hard as it can, through every channel, with answers that are late, stale or not
// numbers. What it does follows from the scene's seed. For tests of the shield.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::planning;
using Eigen::VectorXd;

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "aim": {"description": "What it drives at: any draws one for each attack", "type": "string",
      "enum": ["any", "obstacle", "self", "limit", "random"], "default": "any"},
    "channel": {"description": "With what it drives: any draws one for each attack", "type": "string",
      "enum": ["any", "torque", "potential", "node", "gyroscopic", "alternating"], "default": "any"},
    "nan_share": {"description": "Share of the seeds with which an answer is not a number",
      "type": "number", "minimum": 0, "maximum": 1, "default": 0.05}
  }
})";

enum class Aim { obstacle, self, limit, random };
enum class Channel { torque, potential, node, gyroscopic, alternating };

class Adversary : public Planner {
 public:
  Adversary(const Host&, const Setup& setup, const Json& params)
      : setup_(setup), model_(setup.model()), ws_(model_), rng_(setup.seed() * 7919) {
    aims_ = choices(params.at("aim"), {"obstacle", "self", "limit", "random"});
    channels_ =
        choices(params.at("channel"), {"torque", "potential", "node", "gyroscopic", "alternating"});
    const int n = setup.dof();
    effort_ = setup.effort_max() ? VectorXd(*setup.effort_max()) : VectorXd::Constant(n, 100.0);
    for (auto& effort : effort_)
      if (!std::isfinite(effort)) effort = 100.0;
    for (auto* x : {&direction_, &row_, &other_, &bias_}) x->setZero(n);
    if (rng_.uniform(0.0, 1.0) < params.at("nan_share").get<double>())
      nan_at_s_ = rng_.uniform(0.0, 2.0);
  }

  void tick(const Tick& tick, Command& command) override {
    command.disable_stall_rule();
    if (tick.time_s() >= until_s_) begin_attack(tick.time_s());
    if (tick.time_s() >= nan_at_s_)
      command.held_torque()[0] = std::numeric_limits<double>::quiet_NaN();
    // A late answer is one to an older question.
    if (tick.time_s() >= stale_until_s_) aim_at(tick);
    drive(tick, command);
  }

 private:
  static std::vector<int> choices(const std::string& given, std::vector<std::string> names) {
    std::vector<int> out;
    for (std::size_t i = 0; i < names.size(); ++i)
      if (given == "any" || given == names[i]) out.push_back(static_cast<int>(i));
    return out;
  }
  template <class T>
  T draw(const std::vector<int>& from) {
    const auto last = static_cast<double>(from.size());
    return static_cast<T>(
        from[std::min(from.size() - 1, static_cast<std::size_t>(rng_.uniform(0.0, last)))]);
  }

  void begin_attack(double now) {
    aim_ = draw<Aim>(aims_);
    channel_ = draw<Channel>(channels_);
    until_s_ = now + rng_.uniform(0.02, 0.8);
    stale_until_s_ = rng_.uniform(0.0, 1.0) < 0.2 ? now + rng_.uniform(0.0, 0.1) : 0.0;
    strength_ = rng_.uniform(0.0, 1.0) < 0.5 ? 1.0 : rng_.uniform(0.05, 3.0);
    by_mass_ = rng_.uniform(0.0, 1.0) < 0.5;
    joint_ = std::min(setup_.dof() - 1, static_cast<int>(rng_.uniform(0.0, setup_.dof())));
    side_ = rng_.uniform(-1.0, 1.0) < 0.0 ? -1.0 : 1.0;
    for (auto& x : random_) x = rng_.uniform(-1.0, 1.0);
  }

  // direction_: where the joints are driven, scaled so that the largest number is 1.
  void aim_at(const Tick& tick) {
    dynamics::forward_kinematics(model_, ws_, tick.q());
    bool aimed = false;
    if (aim_ == Aim::obstacle) aimed = aim_at_obstacle(tick);
    if (aim_ == Aim::self) aimed = aim_at_self(tick);
    if (aim_ == Aim::limit) {
      direction_.setZero();
      direction_[joint_] = side_;
      aimed = true;
    }
    if (!aimed)
      for (Eigen::Index j = 0; j < direction_.size(); ++j)
        direction_[j] = random_[static_cast<std::size_t>(j) % random_.size()];
    if (by_mass_ && aimed) {
      row_ = direction_;
      dynamics::solve_mass(model_, ws_, tick.q(), row_, direction_);
    }
    direction_ /= std::max(1e-12, direction_.cwiseAbs().maxCoeff());
  }

  bool aim_at_obstacle(const Tick& tick) {
    const hamelin_contact* nearest = nullptr;
    for (const auto& contact : tick.contacts())
      if (nearest == nullptr || contact.distance_m < nearest->distance_m) nearest = &contact;
    if (nearest == nullptr) return false;
    const int link = setup_.shapes()[static_cast<std::size_t>(nearest->shape)].link;
    dynamics::point_jacobian_transpose(model_, ws_, link, vec3(nearest->arm_point_world_m),
                                       -vec3(nearest->direction_world), direction_);
    return direction_.cwiseAbs().maxCoeff() > 1e-6;
  }

  bool aim_at_self(const Tick& tick) {
    const hamelin_self_contact* nearest = nullptr;
    for (const auto& contact : tick.self_contacts())
      if (nearest == nullptr || contact.distance_m < nearest->distance_m) nearest = &contact;
    if (nearest == nullptr) return false;
    const auto row = [&](int shape, const double(&point)[3], VectorXd& out) {
      const int link = setup_.shapes()[static_cast<std::size_t>(shape)].link;
      dynamics::point_jacobian_transpose(model_, ws_, link, vec3(point),
                                         vec3(nearest->direction_world), out);
    };
    row(nearest->shape_a, nearest->point_a_world_m, direction_);
    if (nearest->shape_b != HAMELIN_SHAPE_OF_BASE) {
      row(nearest->shape_b, nearest->point_b_world_m, other_);
      direction_ -= other_;
    }
    direction_ *= -1.0;
    return direction_.cwiseAbs().maxCoeff() > 1e-6;
  }

  void drive(const Tick& tick, Command& command) {
    Channel channel = channel_;
    if (channel == Channel::alternating) channel = static_cast<Channel>(tick.k() % 4);
    const VectorXd q = tick.q(), v = tick.v();
    switch (channel) {
      case Channel::torque:
        dynamics::gravity_torque(model_, ws_, q, bias_);
        command.held_torque() += bias_ + strength_ * effort_.cwiseProduct(direction_);
        break;
      case Channel::potential:
        command.set_potential(rng_.uniform(-5.0, 5.0));
        command.potential_gradient() = -strength_ * effort_.cwiseProduct(direction_);
        break;
      case Channel::node:
        dynamics::bias_torque(model_, ws_, q, v, bias_);
        command.held_torque() += bias_;
        command.node_velocity() = 3.0 * strength_ * direction_;
        break;
      default:
        gyrate(tick, command);
    }
  }

  // A strong gyroscopic force at each near point, while a torque keeps the arm moving.
  void gyrate(const Tick& tick, Command& command) {
    command.held_torque() += strength_ * effort_.cwiseProduct(direction_);
    std::size_t terms = 0;
    for (const auto& contact : tick.contacts()) {
      if (++terms > 8) return;
      const int link = setup_.shapes()[static_cast<std::size_t>(contact.shape)].link;
      command.add_gyroscopic(link, Eigen::Vector3d::Zero(),
                             Eigen::Vector3d(rng_.normal(), rng_.normal(), rng_.normal()) * 100.0);
    }
  }

  Setup setup_;
  model::Model model_;
  dynamics::Workspace ws_;
  Rng rng_;
  std::vector<int> aims_, channels_;
  VectorXd effort_, direction_, row_, other_, bias_;
  double nan_at_s_ = std::numeric_limits<double>::infinity();
  Aim aim_ = Aim::random;
  Channel channel_ = Channel::torque;
  double until_s_ = 0.0, stale_until_s_ = 0.0, strength_ = 1.0, side_ = 1.0;
  bool by_mass_ = false;
  int joint_ = 0;
  std::array<double, 8> random_{};
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Adversary, "adversary", "0.0.1", "drives the arm into whatever is near",
                       schema);
