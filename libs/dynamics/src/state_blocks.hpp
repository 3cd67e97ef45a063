#pragma once
#include <array>
#include <cstddef>
#include <initializer_list>
#include <thread>
#include <vector>

#include "batch_links.hpp"
#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::dynamics {

/// The links of a chain for kernels with one state per lane.
[[nodiscard]] std::vector<BatchLink> batch_links(const Model& model);
[[nodiscard]] BatchPose batch_pose(const geometry::SE3& pose);

/// An argument of a class for many states: dof × states with the row stride of q.
/// @throws Error usage naming the class, the argument, what is given and what was expected
void check_states(const char* name, const char* argument, const ConstStatesRef& x,
                  const ConstStatesRef& q, Eigen::Index dof);
/// A result of q: rows × states with its row stride.
void check_result(const char* name, const char* argument, const StatesRef& x, Eigen::Index rows,
                  const ConstStatesRef& q);
/// A result must not share memory with an argument.
void check_apart(const char* name, const char* argument, const StatesRef& x, const char* other,
                 const ConstStatesRef& y);

/// How a call shares its states among threads, and how results get to memory. Small results are
/// written in place. Results that do not fit in the caches go to a block that does, and from there
/// in whole cache lines past the caches to memory: otherwise each line would be read before it is
/// written, and rows that are far apart would displace each other.
class StateBlocks {
 public:
  /// Rows of results: row r begins `stride` numbers after row r − 1; null: not wanted.
  struct Result {
    double* data = nullptr;
    std::size_t rows = 0;
  };
  static constexpr std::size_t most_results = 4;
  /// States of a call that one thread computes at once.
  struct Block {
    std::size_t first, states;
    void* memory;                                 ///< scratch memory of the thread
    std::array<double*, most_results> results{};  ///< of the first of these states
    std::size_t stride;                           ///< of the results
  };

  /// @param name of the class, for messages
  /// @param rows of all results together
  /// @param bytes of scratch memory per thread
  /// @throws Error usage for less than one thread
  StateBlocks(const char* name, int threads, std::size_t rows, std::size_t bytes);

  /// Calls f(Block) until all states are done. Blocks are computed independently of each other, and
  /// f must be, too.
  template <class F>
  void run(std::size_t states, std::size_t stride, std::initializer_list<Result> results,
           const F& f) {
    const Call call(states, stride, results, threads_);
    std::vector<std::jthread> others;
    for (std::size_t thread = 1; thread < threads_; ++thread)
      if (call.begin(thread) < call.begin(thread + 1))
        others.emplace_back([&, thread] { share(call, thread, f); });
    share(call, 0, f);
  }

 private:
  static constexpr std::size_t line = 64 / sizeof(double);

  struct Call {
    Call(std::size_t states, std::size_t stride, std::initializer_list<Result> results,
         std::size_t threads);
    std::size_t states, stride, threads;
    std::array<Result, most_results> results{};
    bool streams;
    std::size_t lead;  // states before the first whole cache line of the results
    // The first state of a thread's share.
    [[nodiscard]] std::size_t begin(std::size_t thread) const noexcept;
  };

  template <class F>
  void share(const Call& call, std::size_t thread, const F& f) {
    const std::size_t end = call.begin(thread + 1);
    for (std::size_t first = call.begin(thread); first < end;) {
      Block block = next(call, thread, first, end);
      f(block);
      if (call.streams) stream(call, block);
      first += block.states;
    }
    if (call.streams) end_stream();
  }
  Block next(const Call& call, std::size_t thread, std::size_t first, std::size_t end) noexcept;
  static void stream(const Call& call, const Block& block) noexcept;
  static void end_stream() noexcept;

  std::size_t threads_, bytes_;
  std::size_t block_states_;  // an odd number of cache lines, so that rows use all sets of a cache
  std::size_t block_bytes_;
  AlignedBuffer memory_;
};

}  // namespace hamelin::dynamics
