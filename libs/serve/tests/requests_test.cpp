// Each request once, with what is wrong in it.
#include "../src/requests.hpp"
#include "hamelin/io/json.hpp"
#include "serving.hpp"

using namespace hamelin;
using Catch::Contains;
using test::clutter;

namespace {

struct Asked {
  Json ask(const std::string& text) {
    return Json::parse(serve::answer_request(controller, text, test::data / "scenes"));
  }
  std::string error(const std::string& text) {
    const Json answer = ask(text);
    CAPTURE(answer.dump());
    REQUIRE(answer.contains("error"));
    const std::string line = answer["error"].get<std::string>();
    CHECK(line.find('\n') == std::string::npos);
    return line;
  }
  scene::Scene scene = clutter();
  control::Controller controller{scene, test::planners, test::for_positions()};
};

const std::string q = R"("q": [0, -0.785, 0, -2.356, 0, 1.571, 0.785])";

}  // namespace

TEST_CASE("goals are replaced by a request", "[serve]") {
  Asked asked;
  CHECK(asked.ask(R"({"goals": [{"type": "joint", "q": [0.2, -0.7, 0, -2.3, 0, 1.5, 0.7]}]})") ==
        Json{{"goals", 1}});
  CHECK(asked.ask(R"({"goals": [{"type": "position", "position_m": [0.5, 0, 0.5]}]})") ==
        Json{{"goals", 2}});
  CHECK_THAT(asked.error(R"({"goals": [{"type": "joint", "q": [1, 2]}]})"), Contains("expected 7"));
  CHECK_THAT(asked.error(R"({"goals": [{"type": "jiont", "q": [1, 2]}]})"), Contains("jiont"));
  CHECK_THAT(asked.error(R"({"goals": 7})"), Contains("/goals"));
  CHECK_FALSE(asked.error(R"({"goals": []})").empty());
}

TEST_CASE("parameters of the planner are changed by a request", "[serve]") {
  Asked asked;
  CHECK(asked.ask(R"({"planner_params": {"cruise_speed": 0.4}})") ==
        Json{{"planner_params", true}});
  CHECK(asked.controller.planner_params()["cruise_speed"] == 0.4);
  CHECK_THAT(asked.error(R"({"planner_params": {"cruise_speed": -1}})"), Contains("-1"));
  CHECK_THAT(asked.error(R"({"planner_params": {"cruise_sped": 1}})"), Contains("cruise_sped"));
  CHECK_FALSE(asked.error(R"({"planner_params": [1]})").empty());
}

TEST_CASE("obstacles come and go by requests", "[serve]") {
  Asked asked;
  const std::string ball =
      R"({"obstacle": {"name": "ball", "type": "sphere", "radius_m": 0.05,
                       "position_m": [0.6, 0.3, 0.9]}})";
  CHECK(asked.ask(ball).contains("obstacle"));
  CHECK(asked.ask(R"({"remove_obstacle": "ball"})").contains("remove_obstacle"));
  CHECK_THAT(asked.error(R"({"remove_obstacle": "ball"})"), Contains("'ball'"));
  CHECK_THAT(asked.error(R"({"remove_obstacle": 3})"), Contains("expected a string"));
  CHECK_THAT(asked.error(R"({"obstacle": {"name": "ball", "type": "sphere"}})"),
             Contains("request"));
}

TEST_CASE("maps are replaced and changed by requests", "[serve]") {
  Asked asked;
  CHECK(asked.ask(R"({"map": {"file": "../maps/shelf.bt"}})").contains("map"));
  CHECK(asked.ask(R"({"map_change": {"file": "../maps/shelf.bt"}})").contains("map_change"));
  CHECK_THAT(asked.error(R"({"map": {"file": "no_such.bt"}})"), Contains("no_such.bt"));
  CHECK_THAT(asked.error(R"({"map_change": {"file": "no_such.bt"}})"), Contains("no_such.bt"));
  CHECK_FALSE(asked.error(R"({"map": 1})").empty());
}

TEST_CASE("payloads are attached and detached by requests", "[serve]") {
  Asked asked;
  const std::string can =
      R"({"attach": {"name": "can", "mass_kg": 0.3, "position_m": [0, 0, 0.05],
                     "inertia_kg_m2": [0.001, 0.001, 0.001, 0, 0, 0]}, )" +
      q + "}";
  CHECK(asked.ask(can).contains("attach"));
  CHECK(asked.controller.attached() == std::vector<std::string>{"can"});
  CHECK_THAT(asked.error(can), Contains("can"));
  CHECK_THAT(asked.error(R"({"detach": "can"})"), Contains("/q"));
  CHECK_THAT(asked.error(R"({"detach": "can", "q": ["a"]})"), Contains("/q"));
  CHECK_THAT(asked.error(R"({"detach": "can", "q": [1, 2]})"), Contains("7"));
  CHECK(asked.ask(R"({"detach": "can", )" + q + "}").contains("detach"));
  CHECK(asked.controller.attached().empty());
}

TEST_CASE("the arm is stopped and goes on by requests", "[serve]") {
  Asked asked;
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(7);
  CHECK(asked.ask(R"({"stop": "lunch"})") == Json{{"stop", true}});
  const auto& answer = asked.controller.tick(0.0, asked.scene.start_q, rest);
  CHECK(answer.state == control::ControlState::stopping);
  CHECK_THAT(std::string(answer.cause), Contains("lunch"));
  CHECK(asked.ask(R"({"resume": true})") == Json{{"resume", true}});
  (void)asked.controller.tick(0.001, asked.scene.start_q, rest);
  CHECK(asked.controller.answer().state == control::ControlState::running);
  CHECK_THAT(asked.error(R"({"stop": true})"), Contains("expected a string"));
}
