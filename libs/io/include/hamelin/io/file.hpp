#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace hamelin {

/// The whole file as bytes. Directories and devices are refused.
/// @throws Error io with the file and the system's reason, also if reading fails midway
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

/// `path` relative to `base`, in the shortest form that names the same file. "a/../b" becomes "b"
/// only if `a` is a directory and not a symbolic link, because the system follows the link before
/// "..".
[[nodiscard]] std::filesystem::path resolve_path(const std::filesystem::path& base,
                                                 const std::filesystem::path& path);

/// Writes a temporary file in the same directory and renames it, so that readers see either the old
/// content or the new.
/// @throws Error io with the file's name; the temporary file is then removed
void write_file_atomically(const std::filesystem::path& file, std::string_view content);

/// SHA-256 of the bytes, as 64 hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);
/// The same of a file's content. @throws Error io as read_file()
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace hamelin
