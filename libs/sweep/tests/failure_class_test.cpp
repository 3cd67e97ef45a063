#include "hamelin/sweep/failure_class.hpp"

#include <catch2/catch.hpp>
#include <string>
#include <vector>

using namespace hamelin;
using namespace hamelin::sweep;

TEST_CASE("causes of planners and runs that differ in names, numbers and signs have one class",
          "[sweep][unit]") {
  const std::vector<std::pair<std::vector<std::string>, std::string>> classes{
      {{"sphere 3 of link 'hand' is 1.2 mm inside obstacle 'can' at 1.25 s; the exit direction is "
        "(0.12, -0.99, 0)",
        "capsule 0 of link 'link4' is 0.31 mm inside obstacle 'the shelf's board' at 0.004 s; the "
        "exit direction is (0.12, 0.99, 0)",
        "sphere 12 of part 'finger' is 1.2e+02 mm inside obstacle 'pole_2' at 3e-05 s; the exit "
        "direction is (-1, 0, 0)"},
       "link '*' is N mm inside obstacle '*' at N s"},
      {{"sphere 0 of link 'a' is 1 mm inside the map at 2 s; the exit direction is (0, 0, 1)"},
       "link '*' is N mm inside the map at N s"},
      {{"the arm touches itself: 'hand' and 'base' are 0.5 mm inside each other at 2.5 s",
        "the arm touches itself: 'l7' and 'l2' are 12 mm inside each other at 0 s; if they always "
        "touch, `hamelin robot check a.urdf --write b.srdf` disables the pair; then name that file "
        "as /robot/srdf",
        "the arm touches itself: 'l7' and 'l2' are 12 mm inside each other at 0 s; start "
        "elsewhere; or, if they always touch, `hamelin robot check a.urdf --write b.srdf` disables "
        "the pair; then name that file as /robot/srdf"},
       "the arm touches itself: '*' and '*' are N mm inside each other at N s"},
      {{"force balance: the obstacle next to link 'hand' balances the attraction to the goal",
        "force balance: the obstacle next to link 'l1' balances the attraction to the goal"},
       "force balance: the obstacle next to link '*' balances the attraction to the goal"},
      {{"joint limit: joint 'elbow' is at its limit", "joint limit: joint 'j3' is at its limit"},
       "joint limit: joint '*' is at its limit"},
      {{"torque limit of joint 'a'", "torque limit of joint 'b-c d'"}, "torque limit of joint '*'"},
      {{"at rest for 1 s away from the goal", "at rest for 0.5 s away from the goal"},
       "at rest for N s away from the goal"},
      {{"goal not reached within 10 s", "goal not reached within 0.25 s",
        "goal not reached within 2 s; it is within the tolerances, but its fastest joint moves at "
        "1.2 rad/s or m/s, expected less than 0.05 (speed_max)"},
       "goal not reached within N s"},
      {{"contact between the nodes 12 and 13", "contact between the nodes 0 and 1"},
       "contact between the nodes N and N"},
      {{"planner 'gyro' at step 0: its recovery took out -1.5e-09 J, expected none",
        "planner '/a/b.so' at step 12: its recovery took out 3 J, expected none"},
       "planner '*' at step N: its recovery took out N J, expected none"},
      {{"the exit is +joint 3", "the exit is -joint 3", "the exit is joint3",
        "the exit is -joint_12"},
       "the exit is joint N"},
      {{"step 3 of 0.001 s does not converge: residual nan",
        "step 17 of 0.004 s does not converge: residual -inf"},
       "step N of N s does not converge: residual N"}};
  for (const auto& [causes, expected] : classes)
    for (const auto& cause : causes) CHECK(normalised_cause(cause) == expected);
}

TEST_CASE("causes that differ in more than names and numbers keep their own classes",
          "[sweep][unit]") {
  const std::vector<std::string> kept{
      "unreachable goal: no obstacle is in the way, but the distance from the goal does not "
      "decrease",
      "no way: the guide found no path on which the arm made progress",
      "the arm's load isn't known",
      "hamel-variational does not converge",
      "non-finite state",
      ""};
  for (const auto& cause : kept) CHECK(normalised_cause(cause) == cause);
  CHECK(normalised_cause("link 'a' is 1 mm inside the map") !=
        normalised_cause("link 'a' is 1 mm inside unknown space"));
}

TEST_CASE("the class of a record has its outcome, and tells what only the judge saw",
          "[sweep][unit]") {
  const auto closest = [](double clearance_m, const char* other) {
    return Json{
        {"clearance_m", clearance_m}, {"time_s", 1.5}, {"sphere", "hand/3"}, {"other", other}};
  };
  Json record{{"outcome", "collision"},
              {"cause", nullptr},
              {"result", {{"outcome", "reached"}}},
              {"judge",
               {{"contact", true},
                {"obstacles", closest(-0.0012, "can")},
                {"self", closest(0.01, "base/1")}}}};
  CHECK(failure_class(record) ==
        "collision: only the judge saw the arm touch an obstacle; the run ended as reached");
  CHECK(judged_contact(record) == "the judge saw hand/3 touch can at 1.500 s, 1.2 mm deep");
  CHECK(judged_contact_time(record) == 1.5);
  record["judge"]["obstacles"] = closest(-0.001, "map");
  CHECK(failure_class(record) ==
        "collision: only the judge saw the arm touch the map; the run ended as reached");
  record["judge"]["obstacles"] = nullptr;
  record["judge"]["self"] = closest(0.0, "base/1");
  CHECK(failure_class(record) ==
        "collision: only the judge saw the arm touch itself; the run ended as reached");
  record["result"]["outcome"] = "collision";
  record["cause"] = "contact between the nodes 3 and 4";
  CHECK(failure_class(record) == "collision: contact between the nodes N and N");

  const Json reached{{"outcome", "reached"}, {"cause", nullptr}, {"judge", nullptr}};
  CHECK(failure_class(reached).empty());
  CHECK(failure_class(nullptr).empty());
  CHECK(judged_contact(nullptr).empty());
  const auto crashed = [](const char* cause) {
    return failure_class({{"outcome", "crashed"}, {"cause", cause}});
  };
  CHECK(crashed("signal 11 (Segmentation fault): free(): 0x12 invalid") ==
        "crashed: signal 11 (Segmentation fault)");
  CHECK(crashed("killed after 600 s") == "crashed: killed after 600 s");
  CHECK(crashed("exit code 3: step 12: the energy is off by 3 J") ==
        "crashed: exit code 3: step N: the energy is off by N J");
}
