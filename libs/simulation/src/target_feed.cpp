#include "target_feed.hpp"

#include <fmt/format.h>
#include <utility>

#include "hamelin/core/error.hpp"
#include "loop/target_line.hpp"

namespace hamelin::simulation {

namespace {

double time_of(const control::TargetSample& sample) {
  return std::visit([](const auto& one) { return one.time_s; }, sample);
}

}  // namespace

TargetFeed::TargetFeed(std::istream& stream, std::string name, bool position_only)
    : stream_(stream), name_(std::move(name)), position_only_(position_only) {}

TargetFeed::TargetFeed(const std::filesystem::path& file, bool position_only)
    : file_(std::make_unique<std::ifstream>(file)),
      stream_(*file_),
      name_(file.string()),
      position_only_(position_only) {
  if (!*file_)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be opened, expected a stream of targets", name_));
}

void TargetFeed::read_next(const std::function<void(const std::string&)>& refused) {
  std::string text;
  while (!next_ && std::getline(stream_, text)) {
    ++line_;
    if (text.find_first_not_of(" \t\r") == std::string::npos) continue;
    try {
      next_ =
          control::read_target_line(text, fmt::format("{}: line {}", name_, line_), position_only_);
      next_line_ = line_;
    } catch (const Error& e) {
      refused(e.what());
    }
  }
  ended_ = !next_;
}

void TargetFeed::advance(double time_s, control::Controller& controller,
                         const std::function<void(const std::string&)>& refused) {
  constexpr double rounding_s = 1e-9;
  while (!ended_) {
    if (!next_) read_next(refused);
    if (!next_ || time_of(*next_) > time_s + rounding_s) return;
    const control::TargetSample sample = *std::exchange(next_, std::nullopt);
    try {
      std::visit([&](const auto& one) { controller.set_target(one); }, sample);
      last_s_ = time_of(sample);
    } catch (const Error& e) {
      refused(fmt::format("{}: line {}: {}", name_, next_line_, e.what()));
    }
  }
}

}  // namespace hamelin::simulation
