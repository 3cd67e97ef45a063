#include "hamelin/serve/server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "clerk.hpp"
#include "hamelin/core/error.hpp"
#include "requests.hpp"

namespace hamelin::serve {

namespace {

// So long a server waits at most before it looks whether it is to end [s].
constexpr double glance_s = 0.1;
// After so many periods other clients are turned away.
constexpr std::uint64_t glance_periods = 64;

double now_s() {
  return control::steady_clock_s();
}

}  // namespace

Server::Server(control::Controller& controller, const ServerOptions& options)
    : controller_(controller),
      options_(options),
      listener_(options.socket),
      keeper_(controller, options.gap_max),
      clerk_(std::make_unique<Clerk>()) {
  const int dof = controller.model().dof();
  if (dof > HAMELIN_LINK_JOINTS)
    throw Error(ErrorCode::invalid,
                fmt::format("robot '{}': has {} joints, expected at most {}",
                            controller.model().robot().name, dof, int{HAMELIN_LINK_JOINTS}));
  memory_ =
      LinkMemory::make(static_cast<std::uint32_t>(dof), options.position, controller.period_s());
}

void Server::run(const std::atomic<bool>& stop, const std::function<bool(const Report&)>& gone) {
  while (!stop) {
    std::optional<Connection> client = listener_.accept(glance_s);
    if (!client || !client->hand_over(memory_)) continue;
    const Keeper::Counts before = keeper_.counts();
    report_ = {};
    serve(std::move(*client), stop);
    if (keeper_.counts().ticks == before.ticks) continue;
    controller_.stop("the client has gone");
    report_.counts = keeper_.counts();
    report_.state = controller_.answer().state;
    report_.goals_reached = controller_.goals().index();
    report_.goals = controller_.goals().size();
    if (!gone(report_)) return;
  }
}

void Server::serve(Connection client, const std::atomic<bool>& stop) {
  keeper_.begin_client();
  const double period_s = controller_.period_s();
  double due_s = -1.0;  // of the next measurement; below 0: of the first one
  std::uint64_t sequence = 0;
  std::string text;
  while (!stop && client.is_open()) {
    double wait_s = glance_s;
    const bool limited = due_s >= 0.0 && options_.patience_s >= 0.0;
    if (limited) wait_s = std::clamp(due_s + options_.patience_s - now_s(), 0.0, glance_s);
    const News news = client.wait(wait_s, sequence, text);
    const double since_s = now_s();
    if (news == News::text) answer_text(client, std::move(text));
    if (news == News::frame) {
      hamelin_measurement measurement;
      std::memcpy(&measurement, &memory_->measurement, sizeof measurement);
      if (keeper_.take(measurement)) {
        answer(client);
        report_.answer_us.add(1e6 * (now_s() - since_s));
        due_s = since_s + period_s;
      }
    } else if (limited && since_s >= due_s + options_.patience_s) {
      if (keeper_.miss()) answer(client);
      due_s += period_s;
    }
    if (keeper_.wants_resume()) resume();
    if (news == News::nothing || keeper_.counts().ticks % glance_periods == 0) turn_away_others();
  }
  clerk_->finish();
}

Server::~Server() = default;

void Server::answer(const Connection& client) {
  std::memcpy(&memory_->setpoint, &keeper_.setpoint(), sizeof(hamelin_setpoint));
  (void)client.ring(keeper_.setpoint().sequence);
}

void Server::turn_away_others() {
  (void)listener_.accept(0.0);
}

void Server::answer_text(const Connection& client, std::string text) {
  clerk_->post([this, &client, text = std::move(text)] {
    (void)client.send(answer_request(controller_, text, options_.folder));
  });
}

// The arm remains stopped if the planner refuses to start.
void Server::resume() {
  clerk_->post([this] { (void)answer_request(controller_, R"({"resume": true})", {}); });
}

}  // namespace hamelin::serve
