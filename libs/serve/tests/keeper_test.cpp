// One tick per period, whatever becomes of its measurement.
#include "hamelin/serve/keeper.hpp"

#include <fmt/format.h>

#include <cmath>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "serving.hpp"

using namespace hamelin;
using Catch::Contains;
using serve::Keeper;
using test::clutter;
using test::ExactArm;
using test::with_checksum;

namespace {

struct Kept {
  explicit Kept(const scene::Scene& with = clutter())
      : scene(with), controller(scene, test::planners, test::for_positions()), arm(scene.start_q) {}

  /// @return whether there was a set point, which the arm then follows
  bool take(const hamelin_measurement& frame) {
    const bool taken = keeper.take(frame);
    if (taken) arm.follow(keeper.setpoint());
    return taken;
  }
  void run(int periods) {
    for (int k = 0; k < periods; ++k) REQUIRE(take(arm.measure()));
  }
  void check_setpoint() const {
    const hamelin_setpoint& setpoint = keeper.setpoint();
    CHECK(setpoint.checksum == hamelin_setpoint_checksum(&setpoint));
    for (int j = 0; j < HAMELIN_LINK_JOINTS; ++j) {
      CHECK(std::isfinite(setpoint.torque[j]));
      CHECK(std::isfinite(setpoint.q[j]));
      CHECK(std::isfinite(setpoint.v[j]));
    }
  }
  [[nodiscard]] std::int32_t state() const { return keeper.setpoint().state; }
  [[nodiscard]] bool has(std::uint32_t flag) const { return (keeper.setpoint().flags & flag) != 0; }

  scene::Scene scene;
  control::Controller controller;
  Keeper keeper{controller, 11};
  ExactArm arm;
};

}  // namespace

TEST_CASE("each measurement gets its set point, and the arm reaches its goal", "[serve]") {
  Kept kept;
  int periods = 0;
  do {
    kept.run(1);
    kept.check_setpoint();
    CHECK(kept.keeper.setpoint().sequence == static_cast<std::uint64_t>(periods + 1));
    CHECK_FALSE(kept.has(HAMELIN_SETPOINT_UNSEEN));
  } while (kept.state() == HAMELIN_CONTROL_RUNNING && ++periods < 5000);
  CHECK(kept.state() == HAMELIN_CONTROL_REACHED);
  CHECK(kept.keeper.setpoint().goal_index == 1);
  CHECK(kept.keeper.counts().lost + kept.keeper.counts().late + kept.keeper.counts().damaged == 0);
}

TEST_CASE("damaged, repeated and late measurements are counted and not used", "[serve]") {
  Kept kept;
  kept.run(20);
  const hamelin_setpoint before = kept.keeper.setpoint();
  hamelin_measurement frame = kept.arm.measure();
  frame.q[3] += 1e-9;  // after the checksum was made
  CHECK_FALSE(kept.take(frame));
  CHECK(kept.keeper.counts().damaged == 1);
  CHECK(std::memcmp(&before, &kept.keeper.setpoint(), sizeof before) == 0);
  CHECK(kept.take(with_checksum(frame)));  // the same period, now whole
  CHECK_FALSE(kept.take(with_checksum(frame)));
  frame.sequence = 3;
  CHECK_FALSE(kept.take(with_checksum(frame)));
  CHECK(kept.keeper.counts().late == 2);
  CHECK(kept.keeper.counts().ticks == 21);
  kept.run(1);
  CHECK(kept.keeper.setpoint().late == 2);
  CHECK(kept.keeper.setpoint().damaged == 1);
}

TEST_CASE("a period without a measurement has a set point, and too many in a row stop the arm",
          "[serve]") {
  Kept kept(clutter(false));
  CHECK_FALSE(kept.keeper.miss());  // no arm was seen
  kept.run(100);
  for (int k = 1; k <= 10; ++k) {
    REQUIRE(kept.keeper.miss());
    CHECK(kept.has(HAMELIN_SETPOINT_UNSEEN));
    CHECK(kept.keeper.setpoint().sequence == static_cast<std::uint64_t>(100 + k));
    CHECK(kept.keeper.setpoint().time_s == Approx(0.100 + 0.001 * k));
    CHECK(kept.state() == HAMELIN_CONTROL_RUNNING);
  }
  CHECK(kept.keeper.miss());
  CHECK(kept.state() == HAMELIN_CONTROL_STOPPING);
  CHECK(kept.keeper.setpoint().reason == HAMELIN_STOP_MEASUREMENT);
  CHECK(kept.keeper.counts().lost == 11);
  CHECK(kept.keeper.counts().stops == 1);
  kept.check_setpoint();
}

TEST_CASE("a gap in the sequence numbers is made up for period by period, at most gap_max",
          "[serve]") {
  Kept kept(clutter(false));
  kept.run(100);
  kept.arm.skip(3);
  kept.arm.follow(kept.keeper.setpoint());
  kept.run(1);
  CHECK(kept.keeper.counts().lost == 3);
  CHECK(kept.keeper.counts().ticks == 104);
  CHECK(kept.keeper.setpoint().sequence == 104);
  CHECK(kept.state() == HAMELIN_CONTROL_RUNNING);
  const std::uint64_t jump =
      GENERATE(std::uint64_t{1000}, std::uint64_t{1} << 63, ~std::uint64_t{0} - 110);
  hamelin_measurement frame = kept.arm.measure();
  frame.sequence += jump;
  CHECK(kept.take(with_checksum(frame)));
  CHECK(kept.keeper.counts().lost == 3 + 11);
  CHECK(kept.keeper.setpoint().sequence == frame.sequence);
  CHECK(kept.state() == HAMELIN_CONTROL_STOPPING);
  kept.check_setpoint();
}

TEST_CASE("the largest sequence number does not end the periods", "[serve]") {
  Kept kept;
  hamelin_measurement frame = kept.arm.measure();
  frame.sequence = ~std::uint64_t{0};
  CHECK(kept.take(with_checksum(frame)));
  CHECK(kept.keeper.miss());
  kept.check_setpoint();
}

TEST_CASE("a first measurement that cannot be used does not begin, and the next good one does",
          "[serve]") {
  Kept kept;
  hamelin_measurement frame = kept.arm.measure();
  (GENERATE(true, false) ? frame.q[2] : frame.time_s) = test::not_a_number;
  CHECK(kept.keeper.take(with_checksum(frame)));
  CHECK(kept.has(HAMELIN_SETPOINT_NOT_BEGUN));
  CHECK(kept.keeper.setpoint().sequence == 1);
  CHECK_THAT(kept.keeper.setpoint().cause, Contains("finite"));
  CHECK(kept.keeper.counts().ticks == 0);
  CHECK_FALSE(kept.keeper.miss());
  kept.check_setpoint();
  kept.run(1);
  CHECK_FALSE(kept.has(HAMELIN_SETPOINT_NOT_BEGUN));
  CHECK(kept.state() == HAMELIN_CONTROL_RUNNING);
}

TEST_CASE("numbers that are not finite are never sent, whatever is measured", "[serve]") {
  for (const double bad : {test::not_a_number, 1e300, -1e300}) {
    Kept kept(clutter(false));
    kept.run(50);
    for (int k = 0; k < 30; ++k) {
      hamelin_measurement frame = kept.arm.measure();
      frame.q[k % 7] = bad;
      frame.v[(k + 1) % 7] = bad;
      REQUIRE(kept.take(with_checksum(frame)));
      kept.check_setpoint();
    }
    CHECK(kept.state() == HAMELIN_CONTROL_STOPPING);
    CHECK(kept.keeper.setpoint().reason == HAMELIN_STOP_MEASUREMENT);
  }
}

TEST_CASE("a request acts once, when it changes", "[serve]") {
  Kept kept(clutter(false));
  kept.run(100);
  kept.arm.request(HAMELIN_REQUEST_STOP);
  kept.run(1000);
  CHECK(kept.state() == HAMELIN_CONTROL_STOPPING);
  CHECK(kept.keeper.setpoint().reason == HAMELIN_STOP_REQUEST);
  CHECK_THAT(kept.keeper.setpoint().cause, Contains("client"));
  CHECK(std::abs(kept.arm.speed()) < 1e-6);
  CHECK_FALSE(kept.keeper.wants_resume());
  kept.arm.request(HAMELIN_REQUEST_RESUME);
  kept.run(1);
  CHECK(kept.keeper.wants_resume());
  CHECK_FALSE(kept.keeper.wants_resume());
  kept.controller.resume();
  kept.run(200);
  CHECK_FALSE(kept.keeper.wants_resume());  // the request is the same
  CHECK(kept.state() == HAMELIN_CONTROL_RUNNING);
  kept.arm.request(HAMELIN_REQUEST_RESET);
  kept.run(1);
  CHECK(kept.state() == HAMELIN_CONTROL_RUNNING);
  CHECK(kept.keeper.counts().stops == 1);
}

TEST_CASE("a client that begins has its own sequence numbers and counts", "[serve]") {
  Kept kept(clutter(false));
  kept.run(100);
  CHECK(kept.keeper.miss());
  kept.keeper.begin_client();
  CHECK(kept.keeper.counts().lost == 0);
  hamelin_measurement frame = kept.arm.measure();
  frame.sequence = 7;
  CHECK(kept.take(with_checksum(frame)));
  CHECK(kept.keeper.setpoint().sequence == 7);
  CHECK(kept.keeper.counts().lost == 0);
}

TEST_CASE("a client whose clock is behind goes on in its own time", "[serve]") {
  Kept kept(clutter(false));
  kept.run(100);
  kept.keeper.begin_client();
  ExactArm behind(kept.scene.start_q);
  behind.follow(kept.keeper.setpoint());
  int first = 1;
  if (GENERATE(false, true)) {  // a time that cannot be used does not count as its clock
    hamelin_measurement frame = behind.measure();
    frame.time_s = test::not_a_number;
    REQUIRE(kept.keeper.take(with_checksum(frame)));
    first = 2;
  }
  for (int k = first; k <= 50; ++k) {
    REQUIRE(kept.keeper.take(behind.measure()));
    behind.follow(kept.keeper.setpoint());
    CHECK(kept.keeper.setpoint().time_s == Approx(0.001 * k));
    CHECK(kept.state() == HAMELIN_CONTROL_RUNNING);
  }
}

TEST_CASE("an arm with more joints than a frame has is refused", "[serve]") {
  const auto folder = test::TemporaryFolder();
  std::string urdf = "<robot name='long'><link name='l0'/>";
  for (int j = 1; j <= HAMELIN_LINK_JOINTS + 1; ++j)
    urdf += fmt::format(
        "<link name='l{0}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' "
        "ixz='0' iyz='0'/></inertial></link><joint name='j{0}' type='continuous'><parent "
        "link='l{1}'/><child link='l{0}'/><axis xyz='1 0 0'/></joint>",
        j, j - 1);
  folder.put("long.urdf", urdf + "</robot>");
  const auto file = folder.put(
      "long.json", R"({"schema": "hamelin.scene/1", "robot": {"file": "long.urdf", "tip": "l33"},
                       "start": {"q": [)" +
                       fmt::format("{}", fmt::join(std::vector<double>(33, 0.0), ", ")) +
                       R"(]}, "goals": [{"type": "position", "position_m": [0, 0, 0]}],
                       "planner": {"name": "hybrid"}, "actuation": {"type": "sampled"},
                       "step_s": 0.001, "duration_s": 1})");
  control::Controller controller(file, test::planners);
  CHECK_THAT(test::error_of([&] { const Keeper keeper(controller, 1); }),
             Contains("33 joints, expected at most 32"));
}

TEST_CASE("periods with and without a measurement do not allocate", "[serve]") {
  test::require_allocation_count();
  Kept kept(clutter(false));
  kept.run(100);
  const long made = test::allocations_in([&] {
    for (int k = 0; k < 50; ++k) {
      const hamelin_measurement frame = kept.arm.measure();
      (void)kept.keeper.take(frame);
      kept.arm.follow(kept.keeper.setpoint());
      (void)kept.keeper.take(frame);
      (void)kept.keeper.miss();
      kept.arm.skip(1);
      kept.arm.follow(kept.keeper.setpoint());
    }
  });
  CHECK(kept.keeper.counts().lost == 50);
  CHECK(made == 0);
}
