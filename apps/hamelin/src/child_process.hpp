#pragma once
#include <functional>
#include <string>

namespace hamelin::app {

/// Runs an action in a child process, so that a crash or an endless loop ends only the child.
/// What the action prints goes to standard error.
/// @param action returns one line that says what went wrong; empty: nothing. What it throws is such
///        a line, too.
/// @return that line, or how the child ended without one
[[nodiscard]] std::string run_in_child(const std::function<std::string()>& action,
                                       double timeout_s);

}  // namespace hamelin::app
