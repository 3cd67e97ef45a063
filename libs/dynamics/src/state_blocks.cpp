#include "state_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <variant>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

// Results of a call from this size on go past the caches [bytes]. Below, writing in place is faster
// where a core has as much cache; above, it is slower, the more so the more memory is written.
constexpr std::size_t streamed_bytes = std::size_t{8} << 20;
constexpr std::size_t line_bytes = 64;

// Blocks of results should stay in the second cache with what is computed from [bytes].
constexpr std::size_t most_block_bytes = std::size_t{192} << 10;

std::size_t whole_lines(std::size_t bytes) {
  return (bytes + line_bytes - 1) / line_bytes * line_bytes;
}

BatchLink batch_link(const model::SpatialLink& l) {
  return {l.cos_alpha, l.sin_alpha, 1.0, l.offset, l.p0, {0.0, -l.sin_alpha, l.cos_alpha},
          l.prismatic, false};
}

BatchLink batch_link(const model::PlanarLink& l) {
  return {1.0,
          0.0,
          l.direction,
          l.offset,
          {l.p0x, l.p0y, 0.0},
          {std::cos(l.offset), std::sin(l.offset), 0.0},
          l.prismatic,
          l.prismatic};
}

std::size_t numbers_to_line(const double* x) noexcept {
  const std::size_t past = reinterpret_cast<std::uintptr_t>(x) % line_bytes;
  return past == 0 ? 0 : (line_bytes - past) / sizeof(double);
}

// Whole cache lines go past the caches.
void stream_row(const double* from, std::size_t count, double* to) noexcept {
#if defined(__SSE2__)
  constexpr std::size_t line = line_bytes / sizeof(double);
  const std::size_t head = std::min(count, numbers_to_line(to));
  std::copy_n(from, head, to);
  from += head;
  to += head;
  for (count -= head; count >= line; count -= line, from += line, to += line)
    for (std::size_t i = 0; i < line; i += 2) _mm_stream_pd(to + i, _mm_loadu_pd(from + i));
#endif
  std::copy_n(from, count, to);
}

// Whether two blocks with one row stride have a number in common.
bool overlap(const StatesRef& a, const ConstStatesRef& b) {
  const auto address = [](const double* x) { return reinterpret_cast<std::intptr_t>(x); };
  const auto apart =
      (address(a.data()) - address(b.data())) / static_cast<std::intptr_t>(sizeof(double));
  const Eigen::Index stride = std::max<Eigen::Index>(1, b.outerStride());
  const Eigen::Index row = apart / stride - (apart % stride < 0 ? 1 : 0);
  for (const Eigen::Index k : {row, row + 1})
    if (std::abs(apart - k * stride) < b.cols() && k < b.rows() && -k < a.rows()) return true;
  return false;
}

std::size_t states_of_block(std::size_t rows) noexcept {
  for (const auto states : std::initializer_list<std::size_t>{56, 40, 24})
    if (rows * states * sizeof(double) <= most_block_bytes) return states;
  return 8;
}

std::size_t checked_threads(const char* name, int threads) {
  if (threads < 1)
    throw Error(ErrorCode::usage,
                formatted("{}: {} threads given, expected at least 1", name, threads));
  return static_cast<std::size_t>(threads);
}

}  // namespace

std::vector<BatchLink> batch_links(const Model& model) {
  std::vector<BatchLink> links;
  std::visit(
      [&](const auto& chain) {
        for (const auto& link : chain.links) links.push_back(batch_link(link));
      },
      model.chain());
  return links;
}

BatchPose batch_pose(const geometry::SE3& g) {
  return {vec3(g.R().col(0)), vec3(g.R().col(1)), vec3(g.R().col(2)), vec3(g.p())};
}

void check_states(const char* name, const char* argument, const ConstStatesRef& x,
                  const ConstStatesRef& q, Eigen::Index dof) {
  if (x.rows() == dof && x.cols() == q.cols() && x.outerStride() == q.outerStride()) return;
  detail::refuse_states(name, argument, x.rows(), x.cols(), x.outerStride(), dof, q.cols(),
                        q.outerStride());
}

void check_result(const char* name, const char* argument, const StatesRef& x, Eigen::Index rows,
                  const ConstStatesRef& q) {
  if (x.rows() != rows || x.cols() != q.cols() || x.outerStride() != q.outerStride())
    throw Error(ErrorCode::usage,
                formatted("{}: {}: {} x {} numbers with row stride {} given, expected {} x {} with "
                          "row stride {}, as q",
                          name, argument, x.rows(), x.cols(), x.outerStride(), rows, q.cols(),
                          q.outerStride()));
  check_apart(name, argument, x, "q", q);
}

void check_apart(const char* name, const char* argument, const StatesRef& x, const char* other,
                 const ConstStatesRef& y) {
  if (overlap(x, y))
    throw Error(ErrorCode::usage, formatted("{}: {}: shares memory with {}, expected other memory",
                                            name, argument, other));
}

StateBlocks::StateBlocks(const char* name, int threads, std::size_t rows, std::size_t bytes)
    : threads_(checked_threads(name, threads)),
      bytes_(whole_lines(bytes)),
      block_states_(states_of_block(rows)),
      block_bytes_(rows * block_states_ * sizeof(double)),
      memory_(threads_ * (bytes_ + block_bytes_)) {}

StateBlocks::Call::Call(std::size_t given_states, std::size_t given_stride,
                        std::initializer_list<Result> given, std::size_t given_threads)
    : states(given_states), stride(given_stride), threads(given_threads), lead(0) {
  std::copy(given.begin(), given.end(), results.begin());
  std::size_t rows = 0;
  bool aligned_alike = stride % line == 0;
  std::size_t to_line = line;
  for (const Result& result : results) {
    if (result.data == nullptr) continue;
    rows += result.rows;
    if (to_line == line) to_line = numbers_to_line(result.data);
    aligned_alike = aligned_alike && to_line == numbers_to_line(result.data);
  }
  streams = rows * states * sizeof(double) >= streamed_bytes;
  if (streams && aligned_alike) lead = to_line;
}

std::size_t StateBlocks::Call::begin(std::size_t thread) const noexcept {
  if (thread == 0) return 0;
  const std::size_t lines = (states + line - 1) / line;  // two threads should not share one
  return std::min(states, lines * thread / threads * line + lead);
}

StateBlocks::Block StateBlocks::next(const Call& call, std::size_t thread, std::size_t first,
                                     std::size_t end) noexcept {
  std::byte* const memory =
      static_cast<std::byte*>(memory_.get()) + thread * (bytes_ + block_bytes_);
  Block block{first, end - first, memory, {}, call.stride};
  double* at = reinterpret_cast<double*>(memory + bytes_);
  if (call.streams) {
    block.states = std::min(block.states, first == 0 && call.lead > 0 ? call.lead : block_states_);
    block.stride = block_states_;
  }
  for (std::size_t i = 0; i < most_results; ++i) {
    const Result& result = call.results[i];
    if (result.data == nullptr) continue;
    block.results[i] = call.streams ? at : result.data + first;
    at += result.rows * block_states_;
  }
  return block;
}

void StateBlocks::stream(const Call& call, const Block& block) noexcept {
  for (std::size_t i = 0; i < most_results; ++i) {
    const Result& result = call.results[i];
    if (result.data == nullptr) continue;
    for (std::size_t row = 0; row < result.rows; ++row)
      stream_row(block.results[i] + row * block.stride, block.states,
                 result.data + row * call.stride + block.first);
  }
}

void StateBlocks::end_stream() noexcept {
#if defined(__SSE2__)
  _mm_sfence();  // such writes are not ordered before those that tell that the thread has ended
#endif
}

}  // namespace hamelin::dynamics
