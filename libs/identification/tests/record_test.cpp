#include "hamelin/identification/record.hpp"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cstddef>
#include <filesystem>
#include <string>

#include "hamelin/identification/samples.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::identification;

namespace {

model::Robot two_links() {
  return model::make_chain({2});
}

Json sampled_config() {
  return {{"step_s", 0.001},
          {"actuation", {{"type", "sampled"}, {"control_period_s", 0.002}}},
          {"model", {{"friction_speed", 0.02}, {"payload", nullptr}}}};
}

/// Writes a log with the fields that the reader uses.
class LogWriter {
 public:
  explicit LogWriter(const Json& config, long every = 1, const Json& joints = {"j1", "j2"})
      : log_(folder_.path() / "run.jsonl"), every_(every) {
    Json header{{"program", "run"}, {"scene", "scene.json"},   {"every", every},
                {"config", config}, {"joints", Json::array()}, {"provenance", Json::object()}};
    for (const Json& name : joints)
      header["joints"].push_back({{"name", name}, {"type", "revolute"}});
    log_.write("header", header);
  }
  /// Adds ticks; `more` adds fields to a tick.
  void ticks(int count, const Json& more = Json::object()) {
    for (int i = 0; i < count; ++i, k_ += every_) {
      const double x = 0.001 * static_cast<double>(k_);
      Json fields{{"k", k_},
                  {"time_s", x},
                  {"q", {x, 2.0 * x}},
                  {"v", {1.0, 2.0}},
                  {"tau", {3.0 + x, 4.0}},
                  {"solver", {{"updates", 1}, {"residual", 0.0}, {"halvings", 0}}}};
      for (const char* name : {"kinetic_J", "potential_J", "control_J", "gyroscopic_work_J",
                               "filter_work_J", "recovery_work_J", "dissipated_J", "held_work_J"})
        fields["energy"][name] = 0.0;
      fields.update(more);
      log_.write("tick", fields);
    }
  }
  void event(const char* key, const char* name) {
    log_.write("event", {{"time_s", 0.0}, {"text", "load"}, {key, name}});
  }
  Record read(long every = 1) {
    log_.flush();
    return read_log(log_.file(), two_links(), every);
  }
  std::string error() {
    const std::string text = test::error_of([&] { (void)read(); });
    const std::string folder = folder_.path().string() + "/";
    return text.starts_with(folder) ? text.substr(folder.size()) : text;
  }
  [[nodiscard]] const std::filesystem::path& file() const { return log_.file(); }

 private:
  test::TemporaryFolder folder_;
  log::RunLog log_;
  long every_, k_ = 0;
};

std::string csv_error(const std::string& text) {
  const test::TemporaryFolder folder;
  const auto file = folder.put("m.csv", text);
  const std::string error =
      test::error_of([&] { (void)read_csv(file, two_links(), TorqueTiming::held); });
  return error.substr(error.find("m.csv"));
}

std::size_t usable(const Record& record) {
  std::size_t count = 0;
  for (const char flag : record.usable) count += flag != 0 ? 1U : 0U;
  return count;
}

}  // namespace

TEST_CASE("a log of sampled actuation holds its torques", "[identification][unit]") {
  LogWriter log(sampled_config());
  log.ticks(10);
  const Record record = log.read();
  CHECK(record.ticks() == 10);
  CHECK(usable(record) == 10);
  CHECK(record.friction_speed == 0.02);
  CHECK(record.held(0, 4) == 3.004);
  CHECK(record.sampled.isZero(0.0));
  CHECK(record.impulses.size() == 0);
  const Record half = log.read(2);
  CHECK(half.ticks() == 5);
  CHECK(half.held(0, 1) == Approx(3.0025));
  CHECK(half.q(1, 1) == 0.004);

  LogWriter sparse(sampled_config(), 10);
  sparse.ticks(5);
  const Record rare = sparse.read();
  CHECK(rare.held.isZero(0.0));
  CHECK(rare.sampled(0, 1) == 3.01);
  CHECK(rare.sampled_shift_s == Approx(0.001));
}

TEST_CASE("channels of ideal actuation act each in its own way", "[identification][unit]") {
  Json config = sampled_config();
  config["actuation"] = {{"type", "ideal"}, {"control_period_s", 0.001}};
  const Json channels{{"channels",
                       {{"held", {1.0, 2.0}},
                        {"damping", {0.5, 0.5}},
                        {"gyroscopic", {0.25, 0.0}},
                        {"potential", {0.25, 0.0}},
                        {"node", {100.0, 0.0}}}}};
  LogWriter log(config);
  log.ticks(3, channels);
  const Record record = log.read();
  CHECK(record.held(1, 1) == 2.0);
  CHECK(record.sampled(0, 1) == 1.0);
  CHECK(record.sampled_shift_s == 0.0);
  CHECK(record.impulses(0, 1) == Approx(0.1));
  LogWriter sparse(config, 10);
  sparse.ticks(3, channels);
  CHECK(sparse.error() ==
        "run.jsonl: line 1: /every: 10, expected 1, since the planner sets node velocities, whose "
        "impulses are needed at every step");
}

TEST_CASE("ticks on which more than motors and gravity acts are left out",
          "[identification][unit]") {
  Json config = sampled_config();
  config["wrenches"] = {{{"from_s", 0.0955}, {"to_s", 0.1015}}};
  LogWriter log(config);
  log.ticks(10);
  log.event("attached", "box");
  log.ticks(10);
  log.event("detached", "box");
  log.ticks(10);
  log.ticks(5, {{"clearance_m", 0.0}});
  log.ticks(5, {{"clearance_m", 0.1}});
  log.ticks(1, {{"q", {nullptr, 0.0}}});
  log.ticks(59);
  log.ticks(10);
  const Record record = log.read();
  CHECK(record.ticks() == 110);
  CHECK(usable(record) == 110 - 11 - 5 - 1 - 8);
  CHECK(record.usable[9] == 0);
  CHECK(record.usable[10] == 0);
  CHECK(record.usable[20] == 1);
  CHECK(record.usable[40] == 0);
  CHECK(record.usable[98] == 0);
  CHECK(record.notes.size() == 3);
}

TEST_CASE("logs that cannot be used are refused with one line", "[identification][unit]") {
  CHECK(LogWriter(sampled_config()).error() == "run.jsonl: has no ticks, expected a motion");
  LogWriter other(sampled_config(), 1, {"j1", "wrist"});
  other.ticks(3);
  CHECK(other.error() ==
        "run.jsonl: line 1: /joints: j1, wrist, expected those of robot "
        "'chain2': j1, j2");
  LogWriter free(sampled_config());
  free.ticks(3, {{"tau", Json::array()}});
  CHECK(free.error() ==
        "run.jsonl: its ticks have no torques, expected a run with a planner or a "
        "table with the torques of the motors");
  Json loaded = sampled_config();
  loaded["model"]["payload"] = {{"name", "gripper"}};
  LogWriter carrying(loaded);
  carrying.ticks(3);
  CHECK(carrying.error() ==
        "run.jsonl: line 1: /config/model/payload: the arm carries 'gripper', "
        "expected an arm without payload");
}

TEST_CASE("an exported table is read like its log", "[identification][unit]") {
  LogWriter log(sampled_config());
  log.ticks(20);
  const Record from_log = log.read();
  const test::TemporaryFolder folder;
  const auto file = folder.put("m.csv", log::to_csv(log::read_trajectory(log.file())));
  const Record from_table = read_csv(file, two_links(), TorqueTiming::held);
  CHECK(from_table.q == from_log.q);
  CHECK(from_table.held == from_log.held);
  CHECK(from_table.time_s == from_log.time_s);
  CHECK(read_csv(file, two_links(), TorqueTiming::sampled).sampled == from_log.held);

  const auto by_hand = folder.put("hand.csv",
                                  "tau_j2,\"note, quoted\",q_j1,time_s,q_j2,tau_j1\r\n"
                                  "4,\"a \"\"b\"\"\",1,0,2,3\r\n\r\n+4.5,,1.5, 0.5 ,,3.5\r\n");
  const Record record = read_csv(by_hand, two_links(), TorqueTiming::held);
  CHECK(record.ticks() == 2);
  CHECK(record.held(1, 1) == 4.5);
  CHECK(record.held(0, 0) == 3.0);
  CHECK(record.usable[0] == 1);
  CHECK(record.usable[1] == 0);
}

TEST_CASE("tables that cannot be used are refused with one line", "[identification][unit]") {
  const std::string head = "time_s,q_j1,q_j2,tau_j1,tau_j2\n";
  CHECK(csv_error("") == "m.csv: is empty, expected a table of comma-separated values");
  CHECK(csv_error("time_s,q_j1,q_j2,tau_j1\n") ==
        "m.csv: line 1: has no column 'tau_j2', expected time_s, and q_ and tau_ of each joint "
        "of robot 'chain2'; did you mean 'tau_j1'?");
  CHECK(csv_error(head + "0,1,2,3,4\n0.1,1,2,3\n") == "m.csv: line 3: 4 fields, expected 5");
  CHECK(csv_error(head + "0,1,2,3,4\n0.1,1,2,3,x4\n") ==
        "m.csv: line 3: column 'tau_j2': 'x4', expected a number");
  CHECK(csv_error(head + "0.1,1,2,3,4\n0.1,1,2,3,4\n") ==
        "m.csv: line 3: column 'time_s': 0.1, expected increasing times");
  CHECK(csv_error(head + "inf,1,2,3,4\n") ==
        "m.csv: line 2: column 'time_s': inf, expected increasing times");
  Record record;
  record.where = "m.csv";
  CHECK(test::error_of([&] { (void)thinned(record, 0); }) == "every 0: expected at least 1 tick");
}
