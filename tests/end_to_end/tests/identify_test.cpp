#include "../program.hpp"

namespace {

using hamelin::Json;
using hamelin::test::Output;
using hamelin::test::run_json;
using hamelin::test::Sandbox;

// A run of a simulated arm with friction that its robot file does not know.
const char* const identified_scene = R"({
  "schema": "hamelin.scene/1",
  "robot": {"file": "data/robots/arm7.urdf"},
  "start": {"q": [0, 0, 0, -1.2, 0, 1.6, 0]},
  "goals": [{"type": "joint", "q": [1.2, 0.8, -0.9, -0.4, 1.3, 0.6, 1.1]},
            {"type": "joint", "q": [-0.9, -0.7, 1.0, -1.9, -1.2, 2.6, -1.2]}],
  "model": {"joint_damping": 2.0, "friction": 1.0, "torque_limits": false},
  "actuation": {"type": "sampled"},
  "safety": {"type": "none"},
  "planner": {"name": "hybrid"},
  "duration_s": 8
})";

}  // namespace

TEST_CASE("robot identify finds friction and masses of a logged run", "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("scene.json", identified_scene);
  const Output run = sandbox.run({"run", "scene.json", "--log", "run.jsonl.zst"});
  CAPTURE(run.err);
  REQUIRE((run.exit_code == 0 || run.exit_code == 1));

  const Json found =
      run_json(sandbox, {"robot", "identify", "run.jsonl.zst", "-o", "identified.json"});
  CHECK(found["torque_error"]["before"]["all"]["share"].get<double>() > 0.03);
  CHECK(found["torque_error"]["identified"]["all"]["share"].get<double>() <= 0.01);
  CHECK(found["torque_error"]["held_out"]["all"]["share"].get<double>() <= 0.02);
  CHECK(found["torque_error"]["test"].is_null());
  CHECK(found["links"].size() == 7);
  for (const Json& joint : found["joints"]) {
    CAPTURE(joint["name"]);
    CHECK(joint["damping"].get<double>() == Approx(2.0).epsilon(0.05));
    CHECK(joint["friction"].get<double>() == Approx(1.0).epsilon(0.05));
  }

  // the robot file is one for scenes, with friction that a scene may switch on
  const Json robot = sandbox.json("identified.json");
  CHECK(robot["links"][3]["joint"]["friction"].get<double>() == Approx(1.0).epsilon(0.05));
  Json again = Json::parse(identified_scene);
  again["robot"] = {{"file", "identified.json"}};
  again["model"]["joint_damping"] = again["model"]["friction"] = "robot";
  sandbox.put("again.json", again.dump());
  const Output other = sandbox.run({"run", "again.json", "--log", "again.jsonl", "--every", "4"});
  CAPTURE(other.err);
  REQUIRE((other.exit_code == 0 || other.exit_code == 1));

  // a table of the same motion, and the test on another log
  REQUIRE(sandbox.run({"export", "run.jsonl.zst", "-o", "run.csv"}).exit_code == 0);
  const Json table = run_json(sandbox, {"robot", "identify", "run.csv", "--robot",
                                        "data/robots/arm7.urdf", "--test", "again.jsonl"});
  CHECK(table["torque_timing"] == "held");
  CHECK(table["torque_error"]["test"]["all"]["share"].get<double>() <= 0.02);
  CHECK(table["joints"][0]["friction"].get<double>() == Approx(1.0).epsilon(0.05));

  const Output text = sandbox.run({"robot", "identify", "run.jsonl.zst", "--every", "2"});
  CHECK(text.exit_code == 0);
  CHECK(text.out.find("held out") != std::string::npos);
}

TEST_CASE("robot identify refuses bad input with one line", "[end_to_end]") {
  Sandbox sandbox;
  const auto refused = [&](std::vector<std::string> arguments, const std::string& message) {
    arguments.insert(arguments.begin(), {"robot", "identify"});
    const Output output = sandbox.run(arguments);
    CAPTURE(output.err, output.out);
    CHECK(output.exit_code == 2);
    CHECK(output.err.find(message) != std::string::npos);
    CHECK(hamelin::test::lines_of(output.err).size() == 1);
    CHECK(output.out.empty());
  };
  const std::string planar = "data/robots/planar3.json";
  std::string table = "time_s,q_j1,q_j2,q_j3,tau_j1,tau_j2,tau_j3\n", at_rest = table;
  for (int k = 0; k < 2000; ++k) at_rest += std::to_string(0.002 * k) + ",0.1,0.2,0.3,1,2,3\n";
  sandbox.put("short.csv", table + "0,0,0,0,0,0,0\n");
  sandbox.put("rest.csv", at_rest);
  refused({"short.csv"}, "--robot: is missing, expected the robot of short.csv");
  refused({"short.csv", "--robot", planar}, "short.csv: number of ticks: 1, expected at least 2");
  refused({"short.csv", "--robot", "data/robots/arm7.urdf"}, "short.csv: line 1: has no column");
  refused({"rest.csv", "--robot", planar, "-o", "out.json"}, "do not move, expected a motion");
  refused({"rest.csv", "--robot", planar, "-o", "rest.csv"}, "rest.csv");
  refused({"rest.csv", "--robot", planar, "--window", "0.001"}, "expected at least 0.024 s");
  refused({"missing.jsonl"}, "missing.jsonl");
  REQUIRE(
      sandbox.run({"integrate", planar, "--step", "0.01", "--duration", "1", "--log", "free.jsonl"})
          .exit_code == 0);
  refused({"free.jsonl"}, "free.jsonl: its ticks have no torques");
  refused({"free.jsonl", "--torque", "held"}, "--torque: is for tables");
  CHECK_FALSE(sandbox.has("out.json"));
}
