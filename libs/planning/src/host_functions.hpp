#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/planning/plugin_abi.h"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::planning {

/// The C functions by which one planner calls its host, and the reason why its last call failed. No
/// exception of the host may propagate through the plugin's frames: its message is kept and the
/// planner's call fails.
class HostFunctions {
 public:
  /// @param services must outlive this
  HostFunctions(HostServices& services, std::size_t dof);
  HostFunctions(const HostFunctions&) = delete;
  HostFunctions& operator=(const HostFunctions&) = delete;

  [[nodiscard]] const hamelin_host& raw() const noexcept { return raw_; }
  [[nodiscard]] const std::vector<Series>& series() const noexcept { return series_; }

  /// To be called before each call of the planner.
  void clear_error() noexcept {
    failed_ = false;
    error_[0] = '\0';
  }
  void fail(std::string_view text) noexcept {
    failed_ = true;
    const std::size_t size = std::min(text.size(), error_.size() - 1);
    std::copy_n(text.data(), size, error_.data());
    error_[size] = '\0';
  }
  /// Whether fail() was called since clear_error().
  [[nodiscard]] bool failed() const noexcept { return failed_; }
  /// One line, nul-terminated; planners write theirs to it.
  [[nodiscard]] std::array<char, 512>& error() noexcept { return error_; }

 private:
  void add_functions() noexcept;
  void add_contact_functions() noexcept;
  void add_obstacle_functions() noexcept;
  void add_query_handles() noexcept;
  void add_query_functions() noexcept;
  /// The index of a new series; -1 if the name is empty or in use.
  [[nodiscard]] std::int32_t declare_series(const std::string& name, const char* unit);

  static HostFunctions& of(void* context) noexcept { return *static_cast<HostFunctions*>(context); }
  template <class F>
  void guarded(const F& call) noexcept {
    try {
      call();
    } catch (const std::exception& e) {
      fail(e.what());
    } catch (...) {
      fail("a host service failed");
    }
  }
  /// The result of the call, or `otherwise` if it throws.
  template <class T, class F>
  [[nodiscard]] T guarded_or(T otherwise, const F& call) noexcept {
    guarded([&] { otherwise = call(); });
    return otherwise;
  }

  HostServices& services_;
  std::size_t dof_;
  hamelin_host raw_{};
  std::vector<Series> series_;
  bool failed_ = false;
  std::array<char, 512> error_{};
};

}  // namespace hamelin::planning
