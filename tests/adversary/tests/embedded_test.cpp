// The adversary through the embedded controller, a small number of the runs that
// hamelin_adversary_runs makes.
#include <catch2/catch.hpp>
#include <cmath>

#include "../embedded/embedded_run.hpp"
#include "hamelin/control/preparation.hpp"

using namespace hamelin;
using test::EmbeddedReport;
using test::EmbeddedRun;
using test::Events;
using test::Fault;

TEST_CASE("whatever is done to an embedded controller, what it sends keeps the arm safe",
          "[adversary]") {
  EmbeddedRun run;
  run.position = GENERATE(false, true);
  Events events;
  double path = 0.0;
  for (run.seed = 1; run.seed <= 40; ++run.seed) {
    const EmbeddedReport report = test::run_embedded(run);
    for (const std::string& finding : report.findings) UNSCOPED_INFO(finding);
    CHECK(report.findings.empty());
    events += report.events;
    path += report.path;
  }
  // something was done
  for (const long count : {events.measurements, events.late, events.stops, events.resumptions,
                           events.resets, events.loads, events.refused_loads, events.worlds,
                           events.goals, events.params, events.refused})
    CHECK(count > 0);
  CHECK(path > 10.0);
}

TEST_CASE("without a shield, the same runs touch and pass limits", "[adversary]") {
  EmbeddedRun run;
  run.shielded = false;
  long contacts = 0, self_contacts = 0, positions = 0, speeds = 0;
  for (run.seed = 1; run.seed <= 20; ++run.seed) {
    const EmbeddedReport report = test::run_embedded(run);
    const auto has = [&](Fault fault) {
      return report.counts[static_cast<std::size_t>(fault)] > 0 ? 1 : 0;
    };
    contacts += has(Fault::contact);
    self_contacts += has(Fault::self_contact);
    positions += has(Fault::position);
    speeds += has(Fault::speed);
  }
  CHECK(contacts > 0);
  CHECK(self_contacts > 0);
  CHECK(positions > 0);
  CHECK(speeds > 0);
}

TEST_CASE("a seed reproduces a run", "[adversary]") {
  EmbeddedRun run;
  run.position = GENERATE(false, true);
  run.seed = 7;
  const EmbeddedReport first = test::run_embedded(run), again = test::run_embedded(run);
  CHECK(first.path == again.path);
  CHECK(first.least_clearance_m == again.least_clearance_m);
  CHECK(first.stopping == again.stopping);
}

TEST_CASE("a judge of outputs notices each kind of fault", "[adversary]") {
  test::Bounds bounds;
  bounds.limits.q_lower = Eigen::VectorXd::Constant(7, -2.0);
  bounds.limits.q_upper = Eigen::VectorXd::Constant(7, 2.0);
  bounds.limits.velocity_max = Eigen::VectorXd::Constant(7, 2.0);
  bounds.limits.effort_max = Eigen::VectorXd::Constant(7, 50.0);
  bounds.torque_rate_Nm_s = 1000.0;
  bounds.position = true;
  bounds.acceleration = 15.0;
  bounds.jerk = 5000.0;
  const scene::Scene scene =
      scene::read_scene(std::string(HAMELIN_SOURCE_DIR "/data/scenes/pillar.json"));
  const model::Model arm = control::load_model(scene);
  control::Answer answer;
  answer.torque = answer.v_next = Eigen::VectorXd::Zero(7);
  answer.q_next = scene.start_q;
  const auto faults_after = [&](auto change) {
    test::Judge judge(bounds, arm, false);
    judge.expect_start(scene.start_q);
    judge.check_output(answer, "");
    CHECK(judge.findings().empty());
    control::Answer other = answer;
    change(other);
    judge.check_output(other, "");
    return judge;
  };
  CHECK(faults_after([](auto& x) { x.torque[1] = 51.0; }).count(Fault::torque) == 1);
  CHECK(faults_after([](auto& x) { x.torque[1] = 1.1; }).count(Fault::torque_rate) == 1);
  CHECK(faults_after([](auto& x) { x.torque[1] = 0.9; }).findings().empty());
  CHECK(faults_after([](auto& x) { x.torque[6] = std::nan(""); }).count(Fault::not_finite) == 1);
  CHECK(faults_after([](auto& x) { x.q_next[0] = INFINITY; }).count(Fault::not_finite) == 1);
  CHECK(faults_after([](auto& x) { x.q_next[0] += 0.003; }).count(Fault::jump) == 1);
  CHECK(faults_after([](auto& x) { x.v_next[0] = 0.016; }).count(Fault::acceleration) == 1);
  CHECK(faults_after([](auto& x) { x.v_next[0] = 0.006; }).count(Fault::jerk) == 1);
  CHECK(faults_after([](auto& x) { x.v_next[0] = 0.004; }).findings().empty());
  CHECK(faults_after([](auto& x) { x.v_next[3] = -2.1; }).count(Fault::speed) == 1);
  CHECK(faults_after([](auto& x) { x.q_next[5] = 2.5; }).count(Fault::position) == 1);
}
