#pragma once

namespace hamelin {

/// How often this thread has taken memory from the heap: calls of malloc and related functions,
/// which operator new and Eigen use, also in shared libraries and plugins. Only programs that link
/// hamelin_allocation_count can ask.
[[nodiscard]] long allocation_count() noexcept;

/// Whether this build counts them. Builds with sanitizers, whose heap is their own, do not.
[[nodiscard]] bool counts_allocations() noexcept;

}  // namespace hamelin
