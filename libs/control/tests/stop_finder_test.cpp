// Stops within the bounds of what positions may do.
#include <algorithm>
#include <catch2/catch.hpp>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/rng.hpp"
#include "loop/stop_finder.hpp"

using namespace hamelin;
using Eigen::VectorXd;

TEST_CASE(
    "a stop of set points keeps the bounds of acceleration and jerk, also from an arm that "
    "accelerates",
    "[control][stop]") {
  const scene::Scene scene =
      scene::read_scene(std::string(HAMELIN_SOURCE_DIR "/data/scenes/clutter.json"));
  const model::Model arm = control::load_model(scene);
  constexpr double period_s = 0.001;
  const double most = 15.0, jerk_most = GENERATE(500.0, 5000.0);
  const auto all = [&](double x) { return VectorXd(VectorXd::Constant(7, x)); };
  control::StopFinder finder(scene, arm, period_s, {0.0, all(most), all(jerk_most)});
  Rng rng(7);
  control::FailSafe stop(7);
  VectorXd v(7), a(7), q(7), before(7), now(7), rate_before(7);
  const VectorXd none = VectorXd::Zero(7);
  double acceleration = 0.0, jerk = 0.0;
  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const double speed = rng.below(2) == 0 ? 0.05 : 1.5;
    for (double& x : v) x = rng.uniform(-speed, speed);
    for (double& x : a) x = rng.uniform(-most, most);
    if (!finder.find({scene.start_q, v, a, none, a}, control::BrakingRate::usual_utilisation, stop))
      continue;
    ++found;
    before = v;
    rate_before = a;
    for (double t = period_s; t < stop.duration_s() + 2.0 * period_s; t += period_s) {
      stop.at(t, q, now);
      const VectorXd rate = (now - before) / period_s;
      acceleration = std::max(acceleration, rate.lpNorm<Eigen::Infinity>());
      jerk = std::max(jerk, (rate - rate_before).lpNorm<Eigen::Infinity>() / period_s);
      before = now;
      rate_before = rate;
    }
    CHECK(now.isZero(1e-12));
  }
  CHECK(found > 1000);
  CHECK(acceleration <= most * (1.0 + 1e-6));
  CHECK(jerk <= jerk_most * (1.0 + 1e-6));
}
