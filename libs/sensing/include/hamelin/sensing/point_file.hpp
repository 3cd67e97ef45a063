#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::sensing {

enum class PointFormat : std::int32_t { ply, pcd, xyz, npy };

/// By the ending of a file's name: .ply, .pcd, .xyz, .txt, .csv or .npy; none for others.
[[nodiscard]] std::optional<PointFormat> point_format(const std::filesystem::path& file);

/// The points of a file.
struct PointFile {
  Eigen::Matrix3Xf points;     ///< finite [m]
  std::size_t not_finite = 0;  ///< points that were left out: what a sensor did not see
  /// Where they were seen from, in the frame of the points: the VIEWPOINT of a PCD.
  std::optional<geometry::SE3> viewpoint;
};

/// Reads points strictly: PLY (ascii and binary), PCD (ascii and binary, not compressed), NPY
/// (N × 3 or more columns of floats), or text with three or more numbers per line, separated by
/// blanks, commas or semicolons, where # begins a comment.
/// @param where the file's name, the prefix of each message
/// @throws Error parse, one line that names the header line, the line or the byte
[[nodiscard]] PointFile points_from_bytes(std::string_view bytes, PointFormat format,
                                          const std::string& where);
/// The points in a file. @throws Error io, parse, or usage for an unknown ending
[[nodiscard]] PointFile read_points(const std::filesystem::path& file);

/// Poses of a sensor, one per line: seven numbers, a position [m] and a quaternion w, x, y, z,
/// separated as in text with points.
/// @throws Error io or parse, one line that names the line
[[nodiscard]] std::vector<geometry::SE3> read_poses(const std::filesystem::path& file);
[[nodiscard]] std::vector<geometry::SE3> poses_from_text(std::string_view text,
                                                         const std::string& where);

}  // namespace hamelin::sensing
