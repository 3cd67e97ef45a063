#pragma once
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

namespace hamelin::serve {

/// Does on a thread of its own, one after another, what takes longer than a period.
class Clerk {
 public:
  Clerk() : thread_([this](const std::stop_token& stop) { work(stop); }) {}
  void post(std::function<void()> errand);
  /// Waits until nothing is left to do.
  void finish();

 private:
  void work(const std::stop_token& stop);
  std::mutex mutex_;
  std::condition_variable_any news_;
  std::deque<std::function<void()>> errands_;
  bool busy_ = false;
  std::jthread thread_;  ///< ends before what it uses
};

}  // namespace hamelin::serve
