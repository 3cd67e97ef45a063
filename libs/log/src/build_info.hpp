#pragma once

namespace hamelin::log {

/// What the configure step knows of this build; an empty text is not known.
struct BuildInfo {
  const char *compiler, *flags, *type, *sanitizers, *git_commit, *octomap_version;
};

[[nodiscard]] const BuildInfo& build_info() noexcept;

}  // namespace hamelin::log
