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
  /// @return false if too many wait already
  [[nodiscard]] bool post(std::function<void()> errand);
  /// Forgets what has not begun.
  void drop_waiting();
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
