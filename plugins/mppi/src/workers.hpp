#pragma once
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace hamelin::mppi {

/// Threads that work on the numbered units of one job at a time, in any order. One thread starts
/// jobs and waits for them.
class Workers {
 public:
  /// @param work called with the index of the thread and that of the unit; must not throw
  Workers(int threads, std::function<void(int, int)> work);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  void start(int units);
  /// Returns when all units of the job are done; at once if there is no job.
  void wait();

 private:
  void run(int thread);

  std::function<void(int, int)> work_;
  std::mutex mutex_;
  std::condition_variable started_, finished_;
  std::size_t job_ = 0;
  int units_ = 0, busy_ = 0;
  bool stop_ = false;
  std::atomic<int> next_{0};
  std::vector<std::thread> threads_;
};

}  // namespace hamelin::mppi
