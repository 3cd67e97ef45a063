#include "hamelin/serve/server.hpp"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "clerk.hpp"
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
      clerk_(std::make_unique<Clerk>()) {}

void Server::run(const std::atomic<bool>& stop, const std::function<bool(const Report&)>& gone) {
  while (!stop) {
    const std::optional<Connection> client = listener_.accept(glance_s);
    if (!client || !hand_over_memory(*client)) continue;
    report_ = {};
    serve(*client, stop);
    report_.counts = keeper_.counts();
    if (report_.counts.ticks == 0) continue;
    controller_.stop("the client has gone");
    report_.state = controller_.answer().state;
    report_.goals_reached = controller_.goals().index();
    report_.goals = controller_.goals().size();
    if (!gone(report_)) return;
  }
}

bool Server::hand_over_memory(const Connection& client) {
  const auto dof = static_cast<std::uint32_t>(controller_.model().dof());
  memory_ = LinkMemory::make(dof, options_.position, controller_.period_s());
  return client.hand_over(memory_);
}

void Server::serve(const Connection& client, const std::atomic<bool>& stop) {
  keeper_.begin_client();
  const double period_s = controller_.period_s();
  double due_s = -1.0;  // of the next measurement; below 0: of the first one
  std::uint64_t sequence = 0;
  std::string text;
  News news = News::nothing;
  bool resumes = false;
  while (!stop && news != News::closed) {
    double wait_s = glance_s;
    const bool limited = due_s >= 0.0 && options_.patience_s >= 0.0;
    if (limited) wait_s = std::clamp(due_s + options_.patience_s - now_s(), 0.0, glance_s);
    news = client.wait(wait_s, sequence, text);
    const double since_s = now_s();
    if (news == News::text) answer_text(client, std::move(text));
    if (news == News::frame && take_measurement(client, since_s)) {
      due_s = since_s + period_s;
    } else if (limited && since_s >= due_s + options_.patience_s) {
      if (keeper_.miss()) answer(client);
      due_s += period_s;
    }
    resumes = keeper_.wants_resume() || resumes;
    if (resumes) resumes = !resume();
    if (news == News::nothing || keeper_.counts().ticks % glance_periods == 0) turn_away_others();
  }
  if (stop) clerk_->drop_waiting();
  clerk_->finish();
}

bool Server::take_measurement(const Connection& client, double since_s) {
  hamelin_measurement measurement;
  std::memcpy(&measurement, &memory_->measurement, sizeof measurement);
  if (!keeper_.take(measurement)) return false;
  answer(client);
  report_.answer_us.add(1e6 * (now_s() - since_s));
  return true;
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
  const bool posted = clerk_->post([this, &client, text = std::move(text)] {
    (void)client.send(answer_request(controller_, text, options_.folder));
  });
  if (!posted) ++report_.refused_requests;
}

// The arm remains stopped if the planner refuses to start.
bool Server::resume() {
  return clerk_->post([this] { (void)answer_request(controller_, R"({"resume": true})", {}); });
}

}  // namespace hamelin::serve
