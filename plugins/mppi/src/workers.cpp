#include "workers.hpp"

#include <utility>

namespace hamelin::mppi {

Workers::Workers(int threads, std::function<void(int, int)> work) : work_(std::move(work)) {
  threads_.reserve(static_cast<std::size_t>(threads));
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this, i] { run(i); });
}

Workers::~Workers() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  started_.notify_all();
  for (auto& thread : threads_) thread.join();
}

void Workers::start(int units) {
  {
    const std::lock_guard lock(mutex_);
    next_ = 0;
    units_ = units;
    busy_ = static_cast<int>(threads_.size());
    ++job_;
  }
  started_.notify_all();
}

void Workers::wait() {
  std::unique_lock lock(mutex_);
  finished_.wait(lock, [this] { return busy_ == 0; });
}

void Workers::run(int thread) {
  for (std::size_t done = 0;;) {
    int units = 0;
    {
      std::unique_lock lock(mutex_);
      started_.wait(lock, [&] { return stop_ || job_ != done; });
      if (stop_) return;
      done = job_;
      units = units_;
    }
    for (int unit = next_++; unit < units; unit = next_++) work_(thread, unit);
    const std::lock_guard lock(mutex_);
    if (--busy_ == 0) finished_.notify_one();
  }
}

}  // namespace hamelin::mppi
