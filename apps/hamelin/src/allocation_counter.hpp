#pragma once

namespace hamelin::app {

/// How often this thread has taken memory from the heap: calls of malloc and related functions,
/// also those of plugins.
[[nodiscard]] long allocations() noexcept;

/// Whether this build counts them. Builds with sanitizers, whose heap is their own, do not.
[[nodiscard]] bool counts_allocations() noexcept;

}  // namespace hamelin::app
