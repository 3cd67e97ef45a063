// A server with clients of all kinds.
#include "hamelin/serve/server.hpp"

#include "hamelin/test/errors.hpp"
#include "serving.hpp"

using namespace hamelin;
using Catch::Contains;
using serve::Client;
using serve::Connection;
using serve::LinkMemory;
using serve::News;
using test::clutter;
using test::error_of;
using test::ExactArm;
using test::exchange;
using test::Serving;

namespace {

/// A connection that sends and reads what it likes.
struct RawClient {
  explicit RawClient(const std::filesystem::path& socket)
      : connection(Connection::to(socket, memory)) {}
  /// The next text of the server.
  std::string text() {
    std::string text;
    std::uint64_t sequence = 0;
    for (int i = 0; i < 1000; ++i) {
      const News news = connection.wait(10.0, sequence, text);
      if (news == News::text) return text;
      if (news != News::frame) break;
    }
    return "no answer";
  }
  std::string ask(const std::string& request) {
    REQUIRE(connection.send(request));
    return text();
  }
  void measure(ExactArm& arm) {
    memory->measurement = arm.measure();
    REQUIRE(connection.ring(memory->measurement.sequence));
    std::string text;
    std::uint64_t sequence = 0;
    while (sequence < memory->measurement.sequence)
      REQUIRE(connection.wait(10.0, sequence, text) == News::frame);
    arm.follow(memory->setpoint);
  }
  LinkMemory memory;
  Connection connection;
};

Eigen::VectorXd start() {
  return clutter().start_q;
}

}  // namespace

TEST_CASE("a client reaches its goal", "[serve]") {
  Serving serving;
  {
    Client client(serving.socket());
    CHECK(client.link().joints == 7);
    CHECK(client.link().position == 1);
    CHECK(client.link().period_s == 0.001);
    ExactArm arm(start());
    int periods = 0;
    while (exchange(client, arm).state == HAMELIN_CONTROL_RUNNING && ++periods < 5000) {
    }
    CHECK(client.setpoint().state == HAMELIN_CONTROL_REACHED);
    CHECK(client.damaged() == 0);
  }
  REQUIRE(serving.wait_for_gone(1));
  CHECK(serving.report().goals_reached == 1);
  CHECK(serving.report().counts.lost == 0);
  CHECK(serving.report().answer_us.count() == serving.report().counts.ticks);
}

TEST_CASE("the next client sees an arm that stops until it requests to resume", "[serve]") {
  Serving serving(-1.0, clutter(false));
  ExactArm arm(start());
  unsigned ticks = 0;
  {
    Client client(serving.socket());
    // A motion is sought meanwhile.
    for (; ticks < 100 || (std::abs(arm.speed()) <= 1e-3 && ticks < 10000); ++ticks) {
      (void)exchange(client, arm);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    CHECK(client.setpoint().state == HAMELIN_CONTROL_RUNNING);
    CHECK(std::abs(arm.speed()) > 1e-3);
  }  // in mid-motion
  REQUIRE(serving.wait_for_gone(1));
  CHECK(serving.report().counts.ticks == ticks);
  Client client(serving.socket());
  for (int k = 0; k < 1000; ++k) {
    CHECK(exchange(client, arm).state == HAMELIN_CONTROL_STOPPING);
    CHECK(client.setpoint().reason == HAMELIN_STOP_REQUEST);
  }
  CHECK_THAT(client.setpoint().cause, Contains("gone"));
  CHECK(std::abs(arm.speed()) < 1e-6);
  arm.request(HAMELIN_REQUEST_RESUME);
  int periods = 0;
  while (exchange(client, arm).state == HAMELIN_CONTROL_STOPPING && ++periods < 10000)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  CHECK(client.setpoint().state == HAMELIN_CONTROL_RUNNING);
}

TEST_CASE("a client whose clock starts again can resume", "[serve]") {
  Serving serving(-1.0, clutter(false));
  Eigen::VectorXd q = start();
  {
    Client client(serving.socket());
    ExactArm arm(q);
    for (int k = 0; k < 100; ++k) (void)exchange(client, arm);
    q = Eigen::Map<const Eigen::VectorXd>(client.setpoint().q, 7);
  }
  REQUIRE(serving.wait_for_gone(1));
  Client client(serving.socket());
  ExactArm arm(q);
  for (int k = 0; k < 50; ++k) (void)exchange(client, arm);
  CHECK(client.setpoint().state == HAMELIN_CONTROL_STOPPING);
  arm.request(HAMELIN_REQUEST_RESUME);
  int periods = 0;
  while (exchange(client, arm).state == HAMELIN_CONTROL_STOPPING && ++periods < 5000)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  CHECK(client.setpoint().state == HAMELIN_CONTROL_RUNNING);
}

TEST_CASE("a client that overwrites the memory harms only itself", "[serve]") {
  Serving serving;
  {
    Client bad(serving.socket());
    ExactArm arm(start());
    (void)exchange(bad, arm);
    auto& link = const_cast<hamelin_link&>(bad.link());
    std::memset(&link, 0xa5, sizeof link);
    (void)exchange(bad, arm);
    CHECK(bad.setpoint().sequence == 2);
    hamelin_measurement garbage;
    std::memset(&garbage, 0x5a, sizeof garbage);
    bad.send_raw(garbage);
    (void)exchange(bad, arm);
  }
  REQUIRE(serving.wait_for_gone(1));
  // where the server was slow, it has found the last frame twice instead of the garbage
  CHECK(serving.report().counts.damaged + serving.report().counts.late == 1);
  CHECK(serving.report().counts.ticks == 3);
  Client good(serving.socket());
  CHECK(good.link().joints == 7);
}

TEST_CASE("a client that has gone cannot write into the memory of the next one", "[serve]") {
  Serving serving;
  ExactArm arm(start());
  auto gone = std::make_unique<RawClient>(serving.socket());
  gone->measure(arm);
  gone->connection.close();  // its memory remains mapped
  REQUIRE(serving.wait_for_gone(1));
  Client client(serving.socket());
  (void)exchange(client, arm);
  std::memset(&gone->memory->setpoint, 0, sizeof(hamelin_setpoint));
  CHECK(client.link().setpoint.sequence == 2);
}

TEST_CASE("numbers that are rung do not matter, only the frame in the memory does", "[serve]") {
  Serving serving;
  {
    RawClient client(serving.socket());
    ExactArm arm(start());
    client.measure(arm);
    for (const std::uint64_t wrong : {std::uint64_t{0}, std::uint64_t{1}, ~std::uint64_t{0}})
      REQUIRE(client.connection.ring(wrong));
    client.measure(arm);
    CHECK(client.memory->setpoint.sequence == 2);
  }
  REQUIRE(serving.wait_for_gone(1));
  CHECK(serving.report().counts.ticks == 2);
  CHECK(serving.report().counts.late == 3);
  CHECK(serving.report().counts.lost == 0);
}

TEST_CASE("texts that are no request are answered by an error", "[serve]") {
  Serving serving;
  RawClient client(serving.socket());
  CHECK_THAT(client.ask(R"({"move": 1})"), Contains("expected an object with one of goals"));
  CHECK_THAT(client.ask("no JSON"), Contains("error"));
  CHECK_THAT(client.ask(""), Contains("error"));
  CHECK_THAT(client.ask("[1, 2, 3, 4]"), Contains("error"));
  CHECK_THAT(client.ask(std::string("\xff\xfe\0\x01 bytes", 10)), Contains("error"));
  CHECK_THAT(client.ask(std::string(100'000, '[')), Contains("error"));
  CHECK_THAT(client.ask("{\"stop\": \"" + std::string(150'000, 'x')), Contains("error"));
  CHECK(client.ask("{\"stop\": \"" + std::string(150'000, 'x') + "\"}") == R"({"stop":true})");
  ExactArm arm(start());
  client.measure(arm);
  CHECK(client.memory->setpoint.state == HAMELIN_CONTROL_STOPPING);
}

TEST_CASE("a client that asks and never reads does not keep the server from ending", "[serve]") {
  Serving serving;
  RawClient client(serving.socket());
  ExactArm arm(start());
  client.measure(arm);
  const std::string request = R"({"planner_params": {"no_such": 1}})";
  for (int i = 0; i < 2000; ++i) (void)client.connection.send(request);
  const double since_s = control::steady_clock_s();
  serving.stop();
  CHECK(control::steady_clock_s() - since_s < 30.0);
  CHECK(serving.report().refused_requests > 0);
}

TEST_CASE("a client that connects while another is served is turned away", "[serve]") {
  const double patience_s = GENERATE(-1.0, 0.5);
  Serving serving(patience_s);
  Client first(serving.socket());
  ExactArm arm(start());
  (void)exchange(first, arm);
  CHECK_THAT(error_of([&] { const Client second(serving.socket()); }), Contains("other client"));
  (void)exchange(first, arm);
  CHECK(first.setpoint().sequence >= 2);
}

TEST_CASE("periods without a measurement are answered in time, and stop the arm", "[serve]") {
  Serving serving(0.005, clutter(false));
  Client client(serving.socket());
  ExactArm arm(start());
  (void)exchange(client, arm);
  REQUIRE(client.receive(100, 10.0));
  CHECK(client.setpoint().lost >= 99);
  CHECK((client.setpoint().flags & HAMELIN_SETPOINT_UNSEEN) != 0);
  CHECK(client.setpoint().state == HAMELIN_CONTROL_STOPPING);
}

TEST_CASE("a flood of damaged frames does not keep set points back", "[serve]") {
  Serving serving(0.001, clutter(false));
  Client client(serving.socket());
  ExactArm arm(start());
  (void)exchange(client, arm);
  hamelin_measurement damaged = arm.measure();
  damaged.checksum ^= 1U;
  std::atomic<bool> ended{false};
  std::thread flood([&] {
    while (!ended) client.send_raw(damaged);
  });
  const double since_s = control::steady_clock_s();
  while (client.link().setpoint.sequence < 50 && control::steady_clock_s() - since_s < 10.0)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ended = true;
  flood.join();
  CHECK(client.link().setpoint.sequence >= 50);
}

TEST_CASE("requests that do not begin are told, and the next good measurement begins", "[serve]") {
  Serving serving;
  Client client(serving.socket());
  ExactArm arm(start());
  hamelin_measurement frame = arm.measure();
  frame.q[0] = test::not_a_number;
  client.send(frame);
  REQUIRE(client.receive(1, 10.0));
  CHECK((client.setpoint().flags & HAMELIN_SETPOINT_NOT_BEGUN) != 0);
  (void)exchange(client, arm);
  CHECK(client.setpoint().flags == 0);
  CHECK(client.setpoint().state == HAMELIN_CONTROL_RUNNING);
}
