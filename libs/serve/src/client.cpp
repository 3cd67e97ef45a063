#include "hamelin/serve/client.hpp"

#include <algorithm>
#include <cstring>

#include "hamelin/control/controller.hpp"

namespace hamelin::serve {

Client::Client(const std::filesystem::path& socket)
    : connection_(Connection::to(socket, memory_)) {}

void Client::send(hamelin_measurement measurement) {
  measurement.checksum = hamelin_measurement_checksum(&measurement);
  send_raw(measurement);
}

void Client::send_raw(const hamelin_measurement& measurement) {
  std::memcpy(&memory_->measurement, &measurement, sizeof measurement);
  if (!connection_.ring(measurement.sequence)) connection_.close();
}

bool Client::receive(std::uint64_t sequence, double timeout_s) {
  const double until_s = control::steady_clock_s() + timeout_s;
  while (connection_.is_open() && setpoint_.sequence < sequence) {
    const double left_s = until_s - control::steady_clock_s();
    std::uint64_t rung = 0;
    const News news = connection_.wait(std::max(0.0, left_s), rung, text_);
    if (news == News::frame) {
      hamelin_setpoint newest;
      std::memcpy(&newest, &memory_->setpoint, sizeof newest);
      if (newest.checksum == hamelin_setpoint_checksum(&newest))
        setpoint_ = newest;
      else
        ++damaged_;
    } else if (news == News::closed) {
      connection_.close();
    } else if (news == News::nothing && left_s <= 0.0) {
      return false;
    }
  }
  return setpoint_.sequence >= sequence;
}

}  // namespace hamelin::serve
