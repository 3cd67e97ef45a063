#pragma once

namespace hamelin::log {

/// What the configure step knows about this build; an empty text means unknown.
struct BuildInfo {
  const char *compiler, *flags, *type, *sanitizers, *git_commit, *octomap_version;
};

[[nodiscard]] const BuildInfo& build_info() noexcept;

}  // namespace hamelin::log
