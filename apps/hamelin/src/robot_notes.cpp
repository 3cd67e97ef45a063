#include "robot_notes.hpp"

#include <fmt/format.h>

#include "terminal.hpp"

namespace hamelin::app {

void note_warnings(const model::Robot& robot, const std::filesystem::path& file) {
  for (const auto& warning : robot.warnings) note(fmt::format("{}: {}", file.string(), warning));
}

std::string notes_text(const std::vector<std::string>& notes,
                       const std::vector<std::string>& warnings) {
  std::string text;
  for (const auto& line : notes) text += fmt::format("note: {}\n", line);
  for (const auto& line : warnings) text += fmt::format("warning: {}\n", line);
  return text;
}

}  // namespace hamelin::app
