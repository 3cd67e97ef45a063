#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace hamelin {

/// The whole file as bytes. Directories and devices are refused.
/// @throws Error io, naming the file and the system's reason, also if reading fails midway
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// `path` as seen from `base`, in its shortest form that names the same file: "a/../b" becomes "b" only where `a` is a
/// directory and no link, because the system follows a link before it goes up.
[[nodiscard]] std::filesystem::path resolve_path(const std::filesystem::path& base, const std::filesystem::path& path);

/// Writes beside the file and renames, so that readers see the old content or the new, never half of it.
/// @throws Error io, naming the file; nothing is left behind then
void write_file_aside(const std::filesystem::path& file, std::string_view content);

/// SHA-256 of the bytes, as 64 hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace hamelin
