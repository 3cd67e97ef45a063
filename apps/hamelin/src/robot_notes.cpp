#include "robot_notes.hpp"

#include <fmt/format.h>

#include "terminal.hpp"

namespace hamelin::app {

void note_warnings(const model::Robot& robot, const std::filesystem::path& file) {
  for (const auto& warning : model::warnings(robot))
    note(fmt::format("{}: {}", file.string(), warning));
}

std::string notes_text(const std::vector<std::string>& notes) {
  std::string text;
  for (const auto& line : notes)
    text += fmt::format("{}{}\n", line.starts_with("warning: ") ? "" : "note: ", line);
  return text;
}

}  // namespace hamelin::app
