#pragma once
#include <string>
#include <string_view>

#include "hamelin/io/json.hpp"

namespace hamelin::sweep {

/// Whether an outcome is a success: the goal was reached, or the target was followed to the end.
[[nodiscard]] bool is_success(std::string_view outcome) noexcept;

/// A cause without what differs from run to run, so that equal failures have equal texts: numbers
/// with their signs become N, quoted names become '*', a sphere or capsule becomes the link that it
/// belongs to, and remarks that follow (the exit direction, advice) are left out.
/// "capsule 0 of link 'hand' is 1.2 mm inside the map; the exit direction is (0, -1, 0)" gives
/// "link '*' is N mm inside the map".
[[nodiscard]] std::string normalised_cause(const std::string& cause);

/// The class of a record that did not reach its goal, "outcome: normalised cause". Contact that
/// only the judge saw is a class of its own. Signals and exit codes of crashes are kept.
/// @return empty for a record that is null, or whose run was a success
[[nodiscard]] std::string failure_class(const Json& record);

/// What the judge saw touch, with its time and depth; empty without contact.
[[nodiscard]] std::string judged_contact(const Json& record);

/// The time of the first of these contacts [s]; 0 without contact.
[[nodiscard]] double judged_contact_time(const Json& record);

}  // namespace hamelin::sweep
