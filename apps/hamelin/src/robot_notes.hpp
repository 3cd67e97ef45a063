#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/model/robot.hpp"

/// What a robot's reader has to say.
namespace hamelin::app {

/// Each warning as a note on stderr.
void note_warnings(const model::Robot& robot, const std::filesystem::path& file);

/// All notes as lines of a report: "note: ..." and "warning: ...".
[[nodiscard]] std::string notes_text(const std::vector<std::string>& notes);

}  // namespace hamelin::app
