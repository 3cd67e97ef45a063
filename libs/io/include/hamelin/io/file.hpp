#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace hamelin {

/// The whole file as bytes.
/// @throws Error io, naming the file and the system's reason
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// Writes beside the file and renames, so that readers see the old content or the new, never half of it.
/// @throws Error io, naming the file; nothing is left behind then
void write_file_aside(const std::filesystem::path& file, std::string_view content);

/// SHA-256 of the bytes, as 64 hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace hamelin
