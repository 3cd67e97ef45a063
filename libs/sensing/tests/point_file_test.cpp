#include "hamelin/sensing/point_file.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "hamelin/core/rng.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using sensing::PointFormat;
using sensing::points_from_bytes;

namespace {

// The points (0.25 i, −i, 2 + i), i from 0.
constexpr int count = 4;
float coordinate(int i, int axis) {
  return axis == 0   ? 0.25F * static_cast<float>(i)
         : axis == 1 ? -static_cast<float>(i)
                     : 2.0F + static_cast<float>(i);
}

template <class Number>
void append(std::string& bytes, Number number, bool swap = false) {
  char raw[sizeof number];
  std::memcpy(raw, &number, sizeof number);
  if (swap) std::reverse(raw, raw + sizeof number);
  bytes.append(raw, sizeof number);
}

std::string ascii_points() {
  std::string out;
  for (int i = 0; i < count; ++i)
    out += std::to_string(coordinate(i, 0)) + " " + std::to_string(coordinate(i, 1)) + " " +
           std::to_string(coordinate(i, 2)) + "\n";
  return out;
}

// Each with a field before and one behind the coordinates.
std::string binary_points(bool swap = false) {
  std::string out;
  for (int i = 0; i < count; ++i) {
    append(out, std::uint8_t{7});
    for (int axis = 0; axis < 3; ++axis) append(out, coordinate(i, axis), swap);
    append(out, 0.5, swap);
  }
  return out;
}

std::string npy(const std::string& dictionary, const std::string& body) {
  std::string out = "\x93NUMPY\x01";
  out.push_back('\0');
  append(out, static_cast<std::uint16_t>(dictionary.size()));
  return out + dictionary + body;
}

std::string npy_points(bool by_columns) {
  std::string body;
  for (int k = 0; k < 3 * count; ++k)
    append(body, static_cast<double>(by_columns ? coordinate(k % count, k / count)
                                                : coordinate(k / 3, k % 3)));
  return npy(std::string("{'descr': '<f8', 'fortran_order': ") + (by_columns ? "True" : "False") +
                 ", 'shape': (4, 3), }\n",
             body);
}

const std::string ply_fields =
    "element vertex 4\nproperty uchar quality\nproperty float x\nproperty float y\n"
    "property float z\nproperty double time\nelement face 0\n"
    "property list uchar int vertex_indices\nend_header\n";
const std::string pcd_header =
    "# .PCD v0.7\nVERSION 0.7\nFIELDS quality x y z time\nSIZE 1 4 4 4 8\nTYPE U F F F F\n"
    "COUNT 1 1 1 1 1\nWIDTH 4\nHEIGHT 1\nVIEWPOINT 0.5 0 1 1 0 0 0\nPOINTS 4\nDATA ";

}  // namespace

TEST_CASE("all formats give the same points", "[sensing][unit]") {
  const std::vector<std::pair<PointFormat, std::string>> files{
      {PointFormat::xyz, "# x y z\n\n" + ascii_points()},
      {PointFormat::ply,
       "ply\nformat ascii 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty float y\n"
       "property float z\nend_header\n" +
           ascii_points()},
      {PointFormat::ply,
       "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\n"
       "property double y\r\nproperty float z\r\nend_header\r\n" +
           ascii_points()},
      {PointFormat::ply, "ply\nformat binary_little_endian 1.0\n" + ply_fields + binary_points()},
      {PointFormat::ply, "ply\nformat binary_big_endian 1.0\n" + ply_fields + binary_points(true)},
      {PointFormat::pcd, pcd_header + "binary\n" + binary_points()},
      {PointFormat::pcd,
       "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 2\n"
       "POINTS 4\nDATA ascii\n" +
           ascii_points()},
      {PointFormat::npy, npy_points(false)},
      {PointFormat::npy, npy_points(true)}};
  for (const auto& [format, bytes] : files) {
    CAPTURE(bytes);
    const auto file = points_from_bytes(bytes, format, "f");
    REQUIRE(file.points.cols() == count);
    CHECK(file.not_finite == 0);
    for (int i = 0; i < count; ++i)
      for (int axis = 0; axis < 3; ++axis) CHECK(file.points(axis, i) == coordinate(i, axis));
  }
  const auto seen =
      points_from_bytes(pcd_header + "binary\n" + binary_points(), PointFormat::pcd, "f");
  REQUIRE(seen.viewpoint);
  CHECK(seen.viewpoint->p() == Eigen::Vector3d(0.5, 0.0, 1.0));
}

TEST_CASE("points that are not finite are left out and counted", "[sensing][unit]") {
  const auto file =
      points_from_bytes("0 0 1\nnan nan nan\n1 inf 1\n1e300 0 0\n2 0 1\n", PointFormat::xyz, "f");
  CHECK(file.points.cols() == 2);
  CHECK(file.not_finite == 3);
  CHECK(points_from_bytes("", PointFormat::xyz, "f").points.cols() == 0);
}

TEST_CASE("files that are damaged are refused in one line", "[sensing][unit]") {
  const auto message = [](PointFormat format, const std::string& bytes) {
    return test::error_of([&] { (void)points_from_bytes(bytes, format, "f"); });
  };
  const std::string binary = pcd_header + "binary\n" + binary_points();
  CHECK_THAT(message(PointFormat::xyz, "0 0 1\n0 0\n"), Contains("f: line 2: has 2 numbers"));
  CHECK_THAT(message(PointFormat::xyz, "0 0 1x\n"), Contains("f: line 1: '1x', expected a number"));
  CHECK_THAT(message(PointFormat::ply, "plx\n"), Contains("expected the line 'ply'"));
  CHECK_THAT(message(PointFormat::ply, "ply\nformat ascii 1.0\n"),
             Contains("ends within the header"));
  CHECK_THAT(message(PointFormat::ply, "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n"),
             Contains("line 3: '-1', expected a number from 0"));
  CHECK_THAT(message(PointFormat::ply,
                     "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
             Contains("no field 'y'"));
  CHECK_THAT(message(PointFormat::ply,
                     "ply\nformat binary_little_endian 1.0\nelement vertex 99999999999999\n"
                     "property float x\nproperty float y\nproperty float z\nend_header\n1"),
             Contains("ends after 1 bytes of points"));
  CHECK_THAT(message(PointFormat::pcd, binary.substr(0, binary.size() - 1)),
             Contains("ends after 83 bytes"));
  CHECK_THAT(message(PointFormat::pcd, pcd_header + "binary_compressed\n"),
             Contains("expected ascii or binary"));
  CHECK_THAT(message(PointFormat::pcd, "FIELDS x y\nSIZE 4\nTYPE F F\nPOINTS 1\nDATA ascii\n"),
             Contains("different lengths"));
  CHECK_THAT(message(PointFormat::npy, "\x93NUMPY"), Contains("expected the bytes of an NPY file"));
  CHECK_THAT(message(PointFormat::npy,
                     npy("{'descr': '<i4', 'fortran_order': False, 'shape': (4, 3), }\n", "")),
             Contains("numbers of type '<i4'"));
  CHECK_THAT(message(PointFormat::npy,
                     npy("{'descr': '<f4', 'fortran_order': False, 'shape': (12,), }\n", "")),
             Contains("shape (12,), expected (N, 3)"));
  CHECK_THAT(test::error_of([] { (void)sensing::read_points("a.las"); }),
             Contains("a.las: ends in '.las'"));
}

TEST_CASE("poses of a sensor are read line by line", "[sensing][unit]") {
  const auto poses =
      sensing::poses_from_text("# x y z qw qx qy qz\n0 0 1 1 0 0 0\n\n1,2,3,0,0,0,1\n", "p");
  REQUIRE(poses.size() == 2);
  CHECK(poses[0].p() == Eigen::Vector3d(0.0, 0.0, 1.0));
  CHECK((poses[1] * Eigen::Vector3d(1.0, 0.0, 0.0) - Eigen::Vector3d(0.0, 2.0, 3.0)).norm() <
        1e-12);
  const auto message = [](const std::string& text) {
    return test::error_of([&] { (void)sensing::poses_from_text(text, "p"); });
  };
  CHECK_THAT(message("0 0 1 1 0 0 0\n0 0 1\n"),
             Contains("p: line 2: expected seven finite numbers"));
  CHECK_THAT(message("0 0 1 2 0 0 0\n"), Contains("a quaternion of length 2, expected 1"));
  CHECK_THAT(message("0 0 nan 1 0 0 0\n"), Contains("seven finite numbers"));
}

TEST_CASE("no damage to a file makes anything but an error or points", "[sensing][fuzz]") {
  Rng rng(4);
  const std::vector<std::pair<PointFormat, std::string>> files{
      {PointFormat::ply, "ply\nformat binary_little_endian 1.0\n" + ply_fields + binary_points()},
      {PointFormat::pcd, pcd_header + "binary\n" + binary_points()},
      {PointFormat::npy, npy_points(false)},
      {PointFormat::xyz, ascii_points()}};
  int refused = 0, read = 0;
  for (int k = 0; k < 20000; ++k) {
    const auto& [format, whole] = files[static_cast<std::size_t>(k) % files.size()];
    std::string bytes = whole;
    const auto any = [&] {
      return static_cast<std::size_t>(rng.uniform(0.0, static_cast<double>(bytes.size())));
    };
    for (int i = 0; i <= k % 3; ++i) bytes[any()] = static_cast<char>(rng.uniform(0.0, 256.0));
    if (k % 5 == 0) bytes.resize(any());
    if (k % 7 == 0) bytes.insert(any(), std::to_string(any()));
    const std::string error = test::error_of([&] {
      const auto file = points_from_bytes(bytes, format, "f");
      if (!file.points.allFinite()) FAIL("a point is not finite");
    });
    (error == "no error" ? read : refused) += 1;
  }
  CHECK(refused > 2000);
  CHECK(read > 2000);
}
