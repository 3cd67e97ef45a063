// A planner that damps the joints, and breaks the rule of the plugin interface that the environment
// variable HAMELIN_TEST_BREAKS names. It is compiled twice: UNRULY_PROPERTIES is what it declares.
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "hamelin/planning/plugin.hpp"

namespace {

using namespace hamelin::planning;

bool breaks(std::string_view rule) {
  const char* const name = std::getenv("HAMELIN_TEST_BREAKS");
  return name != nullptr && rule == name;
}

const char* schema() {
  if (breaks("description"))
    return R"({"type": "object", "properties": {"gain": {"type": "number", "default": 1}}})";
  if (breaks("type"))
    return R"({"type": "object", "properties": {"gain": {"description": "any", "default": 1}}})";
  if (breaks("default"))
    return R"({"type": "object", "properties": {"gain": {"type": "number", "minimum": 2,
      "description": "gain", "default": 1}}})";
  return R"({"type": "object", "properties": {"gain": {"type": "number", "minimum": 0, "default": 1,
    "description": "gain"}}})";
}

// Lives as long as the process, unlike a planner.
std::atomic<int> planners_made{0};

class Unruly : public Planner {
 public:
  static constexpr std::uint32_t properties = UNRULY_PROPERTIES;

  Unruly(const Host& host, const Setup& setup, const hamelin::Json& params)
      : gain_(params.at("gain").get<double>()), number_(planners_made++) {
    if (breaks("range") && gain_ == 0.0) throw std::runtime_error("");
    if (breaks("scenes") && setup.dof() != 2) throw std::runtime_error("the arm needs 2 joints");
    if (breaks("queries")) query_ = new Query(host);
    if (breaks("threads")) thread_ = std::thread([this] { wait(); });
    if (breaks("end of threads")) std::thread([] { wait_forever(); }).detach();
  }
  ~Unruly() override {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

  void tick(const Tick& tick, Command& command) override {
    command.damping().setConstant(breaks("range of answers") ? 1.0 / gain_ : 10.0);
    double& torque = command.held_torque()[0];
    if (breaks("valid answers")) torque = std::nan("");
    if (breaks("repetition")) torque = number_;
    if (breaks("reset")) torque = ++ticks_;
    if (breaks("memory")) memory_ = std::make_unique<std::vector<double>>(10);
    if (breaks("no crash")) std::abort();
    if (breaks("no exit")) std::_Exit(0);
    if (breaks("an end")) wait_forever();
    if (breaks("interruption")) {
      std::ofstream("hangs." + std::to_string(::getpid()));
      wait_forever();
    }
    // One tick in 40 is more than one in 100.
    if (breaks("deadline") && tick.k() % 40 == 0)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  void reset(ConstVectorMap /*q*/, ConstVectorMap /*v*/) {}

 private:
  [[noreturn]] static void wait_forever() {
    for (;;) std::this_thread::sleep_for(std::chrono::seconds(1));
  }
  void wait() const {
    while (!stop_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  double gain_;
  int number_, ticks_ = 0;
  Query* query_ = nullptr;
  std::unique_ptr<std::vector<double>> memory_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Unruly, "unruly", "0.0.1", "breaks a rule of the plugin interface",
                       schema());
