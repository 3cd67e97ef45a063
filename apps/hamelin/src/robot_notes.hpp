#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/model/robot.hpp"

/// Notes and warnings of a robot's reader.
namespace hamelin::app {

/// Prints each warning as a note on stderr.
void note_warnings(const model::Robot& robot, const std::filesystem::path& file);

/// All of them as lines of a report: "note: ..." and "warning: ...".
[[nodiscard]] std::string notes_text(const std::vector<std::string>& notes,
                                     const std::vector<std::string>& warnings);

}  // namespace hamelin::app
