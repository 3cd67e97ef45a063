// Calls of a controller's C interface in any order and with any arguments. None may abort or throw;
// each returns a code, failures leave one line, and what is sent to the arm is finite.
#include <array>
#include <cmath>
#include <cstring>
#include <string>

#include "c_choices.hpp"
#include "hamelin/core/text.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

/// A controller, and the calls that an input makes of it.
class Calls {
 public:
  explicit Calls(std::string_view bytes) : choose_(bytes), owned_(make_controller(choose_, true)) {}

  /// @return number of calls
  long run() {
    constexpr int calls_max = 300;
    long made = 0;
    for (; made < calls_max && !choose_.ended(); ++made) {
      error_.fill('\0');
      of_ = choose_.byte() < 4 ? nullptr : owned_.get();
      const std::uint8_t which = choose_.byte();
      if (which < 128)
        tick();
      else
        check(change(which % 28));
    }
    return made;
  }

 private:
  void tick() {
    time_s_ = choose_.rarely() ? choose_.number() : time_s_ + 0.001;
    if (choose_.rarely()) q_ = choose_.numbers<dof>();
    if (choose_.rarely()) v_ = choose_.numbers<dof>();
    hamelin_answer answer{};
    answer.struct_size = choose_.size_or_other(sizeof answer);
    const bool whole = answer.struct_size >= sizeof answer;
    const std::int32_t failed = hamelin_controller_tick(of_, time_s_, choose_.or_null(q_.data()),
                                                        choose_.or_null(v_.data()), &answer);
    require(failed == 0 || failed == 1, "a tick returns 0 or 1");
    if (failed != 0 || !whole) {
      if (!std::isfinite(time_s_)) time_s_ = 0.0;
      q_ = start;
      v_ = {};
      return;
    }
    require(answer.state >= 0 && answer.state <= HAMELIN_CONTROL_STOPPING, "the state is known");
    for (const double* x : {answer.torque, answer.q_next, answer.v_next})
      for (std::size_t i = 0; i < dof; ++i) require(std::isfinite(x[i]), "what is sent is finite");
    std::memcpy(q_.data(), answer.q_next, sizeof q_);
    std::memcpy(v_.data(), answer.v_next, sizeof v_);
    if (!std::isfinite(time_s_) || std::abs(time_s_) > 1e9) time_s_ = 0.0;
  }

  void check(std::int32_t failed) const {
    require(failed == 0 || failed == 1, "a change returns 0 or 1");
    require(failed == 0 || error_.front() != '\0', "a failure leaves a line");
    require(failed != 0 || error_.front() == '\0', "a success leaves none");
    require(one_line(error_.data()) == error_.data(), "the line is one printable line");
  }

  std::int32_t change(int which) {
    char* const error = error_.data();
    const std::size_t size = error_.size();
    std::uint64_t number = 0;
    std::uint64_t* const out = choose_.or_null(&number);
    switch (which) {
      case 0:
        return hamelin_controller_reset(of_, error, size);
      case 1: {
        const Joints q = choose_.rarely() ? choose_.numbers<dof>() : start;
        return hamelin_controller_set_joint_goal(of_, choose_.or_null(q.data()), choose_.number(),
                                                 out, error, size);
      }
      case 2: {
        const auto p = choose_.numbers<3>();
        const auto w = choose_.numbers<4>();
        return hamelin_controller_set_pose_goal(of_, choose_.or_null(p.data()),
                                                choose_.or_null(w.data()), choose_.number(),
                                                choose_.number(), out, error, size);
      }
      case 3:
        return trajectory(out);
      case 4:
        return follow(out);
      case 5: {
        Observed observed(choose_);
        return hamelin_controller_set_target(of_, choose_.or_null(&observed.c), error, size);
      }
      case 6: {
        const auto v = choose_.numbers<3>(), w = choose_.numbers<3>();
        return hamelin_controller_set_target_twist(of_, choose_.number(), choose_.or_null(v.data()),
                                                   choose_.or_null(w.data()), error, size);
      }
      default:
        return change_arm(which, out);
    }
  }

  /// The planner's parameters, loads and obstacles.
  std::int32_t change_arm(int which, std::uint64_t* out) {
    char* const error = error_.data();
    const std::size_t size = error_.size();
    switch (which) {
      case 7: {
        constexpr std::array<const char*, 6> texts{R"({"stiffness": 10})", "{}",  "{",
                                                   R"({"no": 1})",         "[1]", nullptr};
        return hamelin_controller_set_planner_params(of_, texts[choose_.byte() % texts.size()],
                                                     error, size);
      }
      case 8:
        return attach(out);
      case 9:
        return hamelin_controller_detach(of_, choose_.name(), choose_.or_null(start.data()), out,
                                         error, size);
      case 10:
        return obstacle(out);
      case 11: {
        const auto p = choose_.numbers<3>(), v = choose_.numbers<3>();
        const auto w = choose_.numbers<4>();
        return hamelin_controller_move_obstacle(
            of_, choose_.name(), choose_.or_null(p.data()), choose_.or_null(w.data()),
            choose_.or_null(v.data()), choose_.number(), out, error, size);
      }
      default:
        return change_world(which, out);
    }
  }

  std::int32_t change_world(int which, std::uint64_t* out) {
    char* const error = error_.data();
    const std::size_t size = error_.size();
    switch (which) {
      case 12: {
        Observed observed(choose_);
        return hamelin_controller_observe_obstacle(of_, choose_.name(),
                                                   choose_.or_null(&observed.c), out, error, size);
      }
      case 13: {
        double time_s = 0.0;
        return hamelin_controller_last_observed(of_, choose_.name(), choose_.or_null(&time_s),
                                                error, size);
      }
      case 14:
        return hamelin_controller_remove_obstacle(of_, choose_.name(), out, error, size);
      case 15:
        return hamelin_controller_set_map(of_, choose_.or_null("/no/such/map.bt"), out, error,
                                          size);
      case 22:
        return hamelin_controller_set_map_json(of_, map(), choose_.or_null("/no/such/folder"),
                                               choose_.or_null(q_.data()), out, error, size);
      case 23:
        return hamelin_controller_change_map(of_, map_change(), nullptr, out, error, size);
      default:
        return control(which, out);
    }
  }

  /// Stops, goals as JSON, and what is read.
  std::int32_t control(int which, std::uint64_t* out) {
    char* const error = error_.data();
    const std::size_t size = error_.size();
    constexpr std::array<const char*, 5> causes{"a request", "two\nlines", "\xff\x01", "", nullptr};
    switch (which) {
      case 17:
        return hamelin_controller_stop(of_, causes[choose_.byte() % causes.size()], error, size);
      case 18:
      case 19:
        return hamelin_controller_resume(of_, error, size);
      case 20:
        return hamelin_controller_run_guide(of_, error, size);
      case 21:
        return hamelin_controller_set_goals(of_, goals(), choose_.or_null("/no/such/folder"), out,
                                            error, size);
      case 24:
        return written(hamelin_controller_planner_params);
      case 25:
        return written(hamelin_controller_attached);
      case 26:
        return shield();
      case 27:
        return guide();
      default:
        return make_again();
    }
  }

  const char* goals() {
    constexpr std::array<const char*, 9> texts{
        R"([{"type": "joint", "q": [0, -0.7, 0, -2.3, 0, 1.5, 0.7]}])",
        R"({"type": "position", "position_m": [0.4, 0.2, 0.5]})",
        R"([{"type": "joint", "q": [0]}])",
        R"([{"type": "joint", "q": [1e999]}])",
        R"({"type": "path", "file": "way.json"})",
        "[]",
        "null",
        "[",
        nullptr};
    return texts[choose_.byte() % texts.size()];
  }

  const char* map() {
    constexpr std::array<const char*, 6> texts{
        R"({"file": "/no/such/map.bt"})", "null", R"({"file": 1})", "[]", "{", nullptr};
    return texts[choose_.byte() % texts.size()];
  }

  const char* map_change() {
    constexpr std::array<const char*, 6> texts{
        R"({"occupied_boxes_m": [[0.3, 0.3, 0.3, 0.4, 0.4, 0.4]]})",
        R"({"free_boxes_m": [[-1e308, 0, 0, 1e308, 0, 0]]})",
        R"({"file": "/no/such/map.bt"})",
        "null",
        "{",
        nullptr};
    return texts[choose_.byte() % texts.size()];
  }

  /// A function that writes JSON to memory of any size.
  template <class Write>
  std::int32_t written(Write&& write) {
    std::array<char, 64> json{};
    json.fill('#');
    std::size_t needed = 0;
    const std::size_t size = choose_.byte() % json.size();
    const std::int32_t failed = write(of_, choose_.or_null(json.data()), size,
                                      choose_.or_null(&needed), error_.data(), error_.size());
    for (std::size_t i = size; i < json.size(); ++i)
      require(json[i] == '#', "nothing is written beyond the end");
    return failed;
  }

  std::int32_t shield() {
    hamelin_shield shield{};
    shield.struct_size = choose_.size_or_other(sizeof shield);
    const bool whole = shield.struct_size >= sizeof shield;
    const std::int32_t failed =
        hamelin_controller_shield(of_, choose_.or_null(&shield), error_.data(), error_.size());
    if (failed == 0 && whole) {
      require(shield.active == 1 && shield.refused <= shield.steps, "its counts agree");
      require(one_line(shield.line) == shield.line, "what is in the way is one line");
    }
    return failed;
  }

  std::int32_t guide() {
    hamelin_guide guide{};
    guide.struct_size = choose_.size_or_other(sizeof guide);
    const std::int32_t failed =
        hamelin_controller_guide(of_, choose_.or_null(&guide), error_.data(), error_.size());
    require(guide.active == 0 && guide.searches == 0, "the scene has no guide");
    return failed;
  }

  std::int32_t make_again() {
    (void)hamelin_controller_series_name(of_, choose_.byte());
    (void)hamelin_controller_deadline_s(of_);
    require(hamelin_controller_dof(of_) == (of_ != nullptr ? dof : 0), "it has seven joints");
    require(hamelin_controller_period_s(of_) == (of_ != nullptr ? 0.001 : 0.0), "and a period");
    if (choose_.byte() < 64) {
      OwnedController other = make_controller(choose_, false);
      if (other) owned_ = make_controller(choose_, true);
    }
    return 0;
  }

  struct Observed {
    explicit Observed(Choices& choose)
        : v(choose.numbers<3>()), a(choose.numbers<3>()), w(choose.numbers<3>()) {
      c.struct_size = choose.size_or_other(sizeof c);
      c.time_s = choose.number();
      for (double& x : c.position_m) x = choose.number();
      for (double& x : c.quaternion_wxyz) x = choose.number();
      c.velocity_m_s = choose.or_null(v.data());
      c.acceleration_m_s2 = choose.or_null(a.data());
      c.angular_velocity_rad_s = choose.or_null(w.data());
    }
    hamelin_observation c{};
    std::array<double, 3> v, a, w;
  };

  std::int32_t trajectory(std::uint64_t* out) {
    constexpr std::size_t points_max = 4;
    std::array<double, points_max> time_s{};
    std::array<double, points_max * dof> q{}, v{}, a{};
    for (std::size_t i = 0; i < points_max; ++i) {
      time_s[i] = choose_.rarely() ? choose_.number() : 0.5 * static_cast<double>(i);
      for (std::size_t j = 0; j < dof; ++j)
        q[i * dof + j] = choose_.rarely() ? choose_.number() : start[j];
    }
    return hamelin_controller_set_trajectory(
        of_, choose_.or_null(time_s.data()), choose_.or_null(q.data()), choose_.or_null(v.data()),
        choose_.or_null(a.data()), choose_.byte() % (points_max + 1), choose_.number(), out,
        error_.data(), error_.size());
  }

  std::int32_t follow(std::uint64_t* out) {
    hamelin_target_stream stream{};
    stream.struct_size = choose_.size_or_other(sizeof stream);
    for (double* x : {&stream.gap_max_s, &stream.jump_max_m, &stream.jump_max_rad, &stream.noise_m,
                      &stream.noise_rad, &stream.leash_m, &stream.leash_rad})
      *x = choose_.number();
    return hamelin_controller_follow(of_, choose_.or_null(&stream), out, error_.data(),
                                     error_.size());
  }

  std::int32_t attach(std::uint64_t* out) {
    std::array<hamelin_payload_capsule, 3> shapes{};
    for (auto& shape : shapes) {
      shape.radius_m = choose_.rarely() ? choose_.number() : 0.02;
      shape.to_m[2] = choose_.rarely() ? choose_.number() : 0.1;
    }
    hamelin_payload payload{};
    payload.struct_size = choose_.size_or_other(sizeof payload);
    payload.name = choose_.name();
    payload.mass_kg = choose_.rarely() ? choose_.number() : 0.5;
    for (double& x : payload.inertia_kg_m2) x = choose_.rarely() ? choose_.number() : 0.0;
    payload.inertia_kg_m2[0] = payload.inertia_kg_m2[1] = payload.inertia_kg_m2[2] = 1e-3;
    payload.shapes = choose_.or_null(shapes.data());
    payload.shape_count = choose_.byte() % (shapes.size() + 1);
    return hamelin_controller_attach(of_, choose_.or_null(&payload), choose_.or_null(start.data()),
                                     out, error_.data(), error_.size());
  }

  std::int32_t obstacle(std::uint64_t* out) {
    hamelin_obstacle obstacle{};
    obstacle.struct_size = choose_.size_or_other(sizeof obstacle);
    obstacle.name = choose_.name();
    obstacle.shape = static_cast<std::int32_t>(choose_.byte() % 6) - 1;
    obstacle.radius_m = choose_.rarely() ? choose_.number() : 0.05;
    obstacle.length_m = choose_.rarely() ? choose_.number() : 0.1;
    for (double& x : obstacle.size_m) x = choose_.rarely() ? choose_.number() : 0.1;
    for (double& x : obstacle.position_m) x = choose_.number();
    obstacle.quaternion_wxyz[0] = 1.0;
    if (choose_.rarely())
      for (double& x : obstacle.quaternion_wxyz) x = choose_.number();
    obstacle.prediction = static_cast<std::int32_t>(choose_.byte() % 5) - 1;
    obstacle.speed_max_m_s = choose_.rarely() ? choose_.number() : 1.0;
    return hamelin_controller_set_obstacle(of_, choose_.or_null(&obstacle), out, error_.data(),
                                           error_.size());
  }

  Choices choose_;
  OwnedController owned_;
  hamelin_controller* of_ = nullptr;  ///< of the call; now and then null
  double time_s_ = 0.0;
  Joints q_ = start, v_{};
  std::array<char, 300> error_{};
};

}  // namespace

long count_c_calls(std::string_view bytes) {
  return Calls(bytes).run();
}

void c_interface(std::string_view bytes) {
  (void)count_c_calls(bytes);
}

}  // namespace hamelin::fuzz
