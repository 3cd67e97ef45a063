#include "hamelin/sweep/run_facts.hpp"

#include <catch2/catch.hpp>
#include <map>
#include <string>

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

Json record() {
  return {{"outcome", "collision"},
          {"cause", "contact"},
          {"result",
           {{"outcome", "reached"},
            {"time_s", 2.5},
            {"certified_share", 0.75},
            {"recovery_work_J", 1.5},
            {"filter_work_J", -0.5},
            {"torque_change", {{"mean", 0.25}, {"max", 3.0}}},
            {"plant", {{"type", "mujoco"}, {"contacts", 2}}},
            {"escape", {{"count", 2}, {"strategy", "tree"}}},
            {"mover_contact", {{"obstacle", "ball"}, {"arm_speed_m_s", 0.5}}},
            {"timing", {{"cpu_s", 0.1}, {"tick_us", {{"p50", 4.0}, {"p99", 9.0}}}}}}},
          {"judge",
           {{"contact", true},
            {"obstacles",
             {{"clearance_m", -0.001}, {"time_s", 1.5}, {"sphere", "hand"}, {"other", "map"}}},
            {"self", nullptr},
            {"configurations", 9}}}};
}

}  // namespace

TEST_CASE("the facts of a record have the members that are shown", "[sweep][unit]") {
  const RunFacts facts = facts_of(record());
  CHECK(facts.recorded);
  CHECK(facts.outcome == "collision");
  CHECK(facts.own_outcome == "reached");
  CHECK(facts.cause == "contact");
  CHECK_FALSE(facts.success);
  CHECK(facts.failure ==
        "collision: only the judge saw the arm touch the map; the run ended as reached");
  CHECK(facts.contact == "the judge saw hand touch map at 1.500 s, 1 mm deep");
  CHECK(facts.contact_time_s == 1.5);
  CHECK(facts.judge_saw_contact);
  CHECK(facts.judged);
  CHECK(facts.contact_arm_speed_m_s == 0.5);
  CHECK(facts.time_s == 2.5);
  CHECK(facts.certified_share == 0.75);
  CHECK(facts.clearance_m == -0.001);
  CHECK_FALSE(facts.self_clearance_m);
  CHECK(facts.recovery_work_J == 1.5);
  CHECK(facts.filter_work_J == -0.5);
  CHECK(facts.torque_change_mean == 0.25);
  CHECK(facts.plant_contacts == 2.0);
  CHECK(facts.tick_us_p50 == 4.0);
  CHECK(facts.tick_us_p99 == 9.0);
  CHECK(facts.escape == std::map<std::string, double>{{"count", 2.0}});
}

TEST_CASE("facts without timing leave out what depends on the machine", "[sweep][unit]") {
  const RunFacts facts = facts_of(record(), false);
  CHECK(facts.time_s == 2.5);
  CHECK_FALSE(facts.tick_us_p50);
  CHECK_FALSE(facts.tick_us_p99);
}

TEST_CASE("a missing record, a crash and members that are null have no facts", "[sweep][unit]") {
  CHECK_FALSE(facts_of(nullptr).recorded);
  const RunFacts crashed = facts_of(
      {{"outcome", "crashed"}, {"cause", "signal 11"}, {"result", nullptr}, {"judge", nullptr}});
  CHECK(crashed.recorded);
  CHECK(crashed.own_outcome.empty());
  CHECK(crashed.failure == "crashed: signal 11");
  CHECK_FALSE(crashed.judged);
  CHECK_FALSE(crashed.time_s);
  Json ideal = record();
  for (const char* name : {"plant", "torque_change", "escape", "timing"})
    ideal["result"][name] = nullptr;
  const RunFacts facts = facts_of(ideal);
  CHECK_FALSE(facts.plant_contacts);
  CHECK_FALSE(facts.torque_change_mean);
  CHECK(facts.escape.empty());
}
