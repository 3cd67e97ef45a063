#include "clerk.hpp"

#include <utility>

namespace hamelin::serve {

namespace {

constexpr std::size_t waiting_max = 64;

}  // namespace

bool Clerk::post(std::function<void()> errand) {
  {
    const std::lock_guard lock(mutex_);
    if (errands_.size() >= waiting_max) return false;
    errands_.push_back(std::move(errand));
  }
  news_.notify_all();
  return true;
}

void Clerk::drop_waiting() {
  const std::lock_guard lock(mutex_);
  errands_.clear();
}

void Clerk::finish() {
  std::unique_lock lock(mutex_);
  news_.wait(lock, [this] { return errands_.empty() && !busy_; });
}

void Clerk::work(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (news_.wait(lock, stop, [this] { return !errands_.empty(); })) {
    const std::function<void()> errand = std::move(errands_.front());
    errands_.pop_front();
    busy_ = true;
    lock.unlock();
    errand();
    lock.lock();
    busy_ = false;
    news_.notify_all();
  }
}

}  // namespace hamelin::serve
