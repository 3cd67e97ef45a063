#include "hamelin/sensing/point_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "point_text.hpp"

namespace hamelin::sensing {

using Eigen::Index;

namespace {

// One number of a record.
struct Field {
  std::string name;
  char kind = 'f';  // f float, i signed, u unsigned
  std::size_t size = 4, offset = 0;
};

double value_of(const Field& field, const char* record, bool swap) {
  std::array<char, 8> bytes{};
  std::memcpy(bytes.data(), record + field.offset, field.size);
  if (swap) std::reverse(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(field.size));
  const auto as = [&](auto number) {
    std::memcpy(&number, bytes.data(), sizeof number);
    return static_cast<double>(number);
  };
  if (field.kind == 'f') return field.size == 4 ? as(float{}) : as(double{});
  if (field.kind == 'i')
    return field.size == 1   ? as(std::int8_t{})
           : field.size == 2 ? as(std::int16_t{})
           : field.size == 4 ? as(std::int32_t{})
                             : as(std::int64_t{});
  return field.size == 1   ? as(std::uint8_t{})
         : field.size == 2 ? as(std::uint16_t{})
         : field.size == 4 ? as(std::uint32_t{})
                           : as(std::uint64_t{});
}

// Collects points, of which those that are not finite only count.
class Collector {
 public:
  explicit Collector(std::size_t expected) { values_.reserve(3 * expected); }
  void add(double x, double y, double z) {
    const std::array point{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    if (!std::all_of(point.begin(), point.end(), [](float c) { return std::isfinite(c); })) {
      ++not_finite_;
      return;
    }
    values_.insert(values_.end(), point.begin(), point.end());
  }
  [[nodiscard]] PointFile points() const {
    PointFile out;
    out.points = Eigen::Map<const Eigen::Matrix3Xf>(values_.data(), 3,
                                                    static_cast<Index>(values_.size() / 3));
    out.not_finite = not_finite_;
    return out;
  }

 private:
  std::vector<float> values_;
  std::size_t not_finite_ = 0;
};

// The layout of records, and which of their fields are the coordinates.
struct Records {
  std::vector<Field> fields;
  std::size_t size = 0, count = 0;
  bool ascii = false, swap = false;

  void append(Field field) {
    field.offset = size;
    size += field.size;
    fields.push_back(std::move(field));
  }
  [[nodiscard]] std::array<std::size_t, 3> coordinates(const Text& text) const {
    std::array<std::size_t, 3> out{};
    for (std::size_t i = 0; i < 3; ++i) {
      const char* const name = i == 0 ? "x" : i == 1 ? "y" : "z";
      const auto found = std::find_if(fields.begin(), fields.end(),
                                      [&](const Field& f) { return f.name == name; });
      if (found == fields.end())
        text.fail(fmt::format("the points have no field '{}', expected x, y and z", name));
      out[i] = static_cast<std::size_t>(found - fields.begin());
    }
    return out;
  }
};

PointFile read_binary(const Records& records, Text& text) {
  const auto xyz = records.coordinates(text);
  const std::string_view body = text.rest();
  if (records.size == 0 || body.size() / records.size < records.count)
    text.fail(fmt::format("ends after {} bytes of points, expected {} × {}", body.size(),
                          records.count, records.size));
  Collector out(records.count);
  for (std::size_t i = 0; i < records.count; ++i) {
    const char* const record = body.data() + i * records.size;
    const auto at = [&](std::size_t k) {
      return value_of(records.fields[xyz[k]], record, records.swap);
    };
    out.add(at(0), at(1), at(2));
  }
  return out.points();
}

PointFile read_ascii(const Records& records, Text& text) {
  const auto xyz = records.coordinates(text);
  const std::size_t last = std::max({xyz[0], xyz[1], xyz[2]});
  Collector out(std::min(records.count, text.rest().size() / 6));
  std::vector<double> numbers;
  for (std::size_t i = 0; i < records.count; ++i) {
    if (!text.next()) text.fail(fmt::format("has {} points, expected {}", i, records.count));
    text.numbers(numbers);
    if (numbers.size() <= last)
      text.fail(fmt::format("has {} numbers, expected {}", numbers.size(), records.fields.size()));
    out.add(numbers[xyz[0]], numbers[xyz[1]], numbers[xyz[2]]);
  }
  return out.points();
}

PointFile read(const Records& records, Text& text) {
  return records.ascii ? read_ascii(records, text) : read_binary(records, text);
}

// ---- PLY: elements with properties, of which `vertex` has the points and must come first

Field ply_property(Text& text) {
  const std::string_view type = text.word(1);
  static constexpr std::array<std::pair<std::string_view, const char*>, 16> types{
      {{"char", "i1"},
       {"int8", "i1"},
       {"uchar", "u1"},
       {"uint8", "u1"},
       {"short", "i2"},
       {"int16", "i2"},
       {"ushort", "u2"},
       {"uint16", "u2"},
       {"int", "i4"},
       {"int32", "i4"},
       {"uint", "u4"},
       {"uint32", "u4"},
       {"float", "f4"},
       {"float32", "f4"},
       {"double", "f8"},
       {"float64", "f8"}}};
  const auto* const found = std::find_if(types.begin(), types.end(),
                                         [&](const auto& entry) { return entry.first == type; });
  if (found == types.end())
    text.fail(fmt::format("a property of type '{}' of the points, expected a number", type));
  return {std::string(text.word(2)), found->second[0],
          static_cast<std::size_t>(found->second[1] - '0')};
}

PointFile read_ply(Text& text) {
  if (!text.next() || text.line() != "ply") text.fail("expected the line 'ply'");
  Records records;
  bool in_points = false, has_points = false, has_format = false;
  for (;;) {
    if (!text.next()) text.fail("ends within the header, expected 'end_header'");
    const std::string_view key = text.word(0);
    if (key == "end_header") break;
    if (key == "format") {
      const std::string_view format = text.word(1);
      has_format = true;
      records.ascii = format == "ascii";
      const bool big = format == "binary_big_endian";
      if (!records.ascii && !big && format != "binary_little_endian")
        text.fail(
            fmt::format("format '{}', expected ascii, binary_little_endian or "
                        "binary_big_endian",
                        format));
      records.swap = big != (std::endian::native == std::endian::big);
    } else if (key == "element") {
      in_points = text.word(1) == "vertex";
      if (in_points && !has_points) records.count = text.count(2);
      if (!in_points && !has_points)
        text.fail(
            fmt::format("element '{}' before the points, expected 'vertex' first", text.word(1)));
      has_points = true;
    } else if (key == "property" && in_points) {
      records.append(ply_property(text));
    }
  }
  if (!has_format || !has_points) text.fail("the header has no format or no element vertex");
  return read(records, text);
}

// ---- PCD 0.7

PointFile read_pcd(Text& text) {
  Records records;
  std::vector<std::string> names;
  std::vector<std::size_t> sizes, counts;
  std::vector<char> types;
  std::optional<geometry::SE3> viewpoint;
  for (bool header = true; header;) {
    if (!text.next()) text.fail("ends within the header, expected 'DATA'");
    const std::string_view key = text.word(0);
    if (key.empty() || key.front() == '#') continue;
    const std::size_t words = text.words();
    if (key == "FIELDS") {
      for (std::size_t i = 1; i < words; ++i) names.emplace_back(text.word(i));
    } else if (key == "SIZE") {
      for (std::size_t i = 1; i < words; ++i) sizes.push_back(text.count(i));
    } else if (key == "COUNT") {
      for (std::size_t i = 1; i < words; ++i) counts.push_back(text.count(i));
    } else if (key == "TYPE") {
      for (std::size_t i = 1; i < words; ++i) types.push_back(text.word(i).front());
    } else if (key == "POINTS") {
      records.count = text.count(1);
    } else if (key == "VIEWPOINT") {
      viewpoint = text.pose(1);
    } else if (key == "DATA") {
      const std::string_view data = text.word(1);
      records.ascii = data == "ascii";
      if (!records.ascii && data != "binary")
        text.fail(fmt::format("DATA '{}', expected ascii or binary", data));
      header = false;
    } else if (key != "VERSION" && key != "WIDTH" && key != "HEIGHT") {
      text.fail(fmt::format("'{}', expected a line of a PCD's header", key));
    }
  }
  if (counts.empty()) counts.assign(names.size(), 1);
  if (sizes.size() != names.size() || types.size() != names.size() || counts.size() != names.size())
    text.fail("FIELDS, SIZE, TYPE and COUNT have different lengths");
  for (std::size_t i = 0; i < names.size(); ++i) {
    const char type = types[i] == 'F' ? 'f' : types[i] == 'I' ? 'i' : types[i] == 'U' ? 'u' : '?';
    const bool size = type == 'f'
                          ? sizes[i] == 4 || sizes[i] == 8
                          : sizes[i] == 1 || sizes[i] == 2 || sizes[i] == 4 || sizes[i] == 8;
    if (type == '?' || !size || counts[i] > 4096)
      text.fail(fmt::format("field '{}' of type {} and size {}, expected a number of F, I or U",
                            names[i], types[i], sizes[i]));
    for (std::size_t k = 0; k < counts[i]; ++k)
      records.append({k == 0 ? names[i] : "", type, sizes[i]});
  }
  records.swap = std::endian::native == std::endian::big;
  PointFile out = read(records, text);
  out.viewpoint = viewpoint;
  return out;
}

// ---- text

PointFile read_xyz(Text& text) {
  Collector out(text.rest().size() / 24);
  std::vector<double> numbers;
  while (text.next()) {
    if (text.is_comment()) continue;
    text.numbers(numbers);
    if (numbers.size() < 3)
      text.fail(fmt::format("has {} numbers, expected three or more", numbers.size()));
    out.add(numbers[0], numbers[1], numbers[2]);
  }
  return out.points();
}

// ---- NPY 1.0 to 3.0

// The text behind a key of the header, a Python dictionary.
std::string_view behind(std::string_view header, std::string_view key, const Text& text) {
  const std::size_t at = header.find(fmt::format("'{}':", key));
  if (at == std::string_view::npos) text.fail(fmt::format("the header has no '{}'", key));
  std::string_view rest = header.substr(at + key.size() + 3);
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  return rest;
}

PointFile read_npy(std::string_view bytes, Text& text) {
  constexpr std::string_view magic = "\x93NUMPY";
  if (bytes.size() < 12 || !bytes.starts_with(magic))
    text.fail("expected the bytes of an NPY file");
  const auto byte = [&](std::size_t i) {
    return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i]));
  };
  const bool wide = byte(6) > 1;
  const std::size_t begin = wide ? 12 : 10, length = byte(8) | byte(9) << 8U |
                                                     (wide ? byte(10) << 16U | byte(11) << 24U : 0);
  if (bytes.size() - begin < length) text.fail("ends within the header");
  const std::string_view header = bytes.substr(begin, length);
  const std::string_view type = behind(header, "descr", text),
                         order = behind(header, "fortran_order", text);
  std::string_view shape = behind(header, "shape", text);
  Records records;
  if (!type.starts_with("'<f4'") && !type.starts_with("'<f8'"))
    text.fail(
        fmt::format("numbers of type {}, expected '<f4' or '<f8'", type.substr(0, type.find(','))));
  const std::size_t size = type[3] == '4' ? 4 : 8;
  std::size_t rows = 0, columns = 0;
  shape.remove_prefix(std::min<std::size_t>(1, shape.size()));
  auto parsed = std::from_chars(shape.data(), shape.data() + shape.size(), rows);
  const char* const comma = parsed.ptr;
  if (parsed.ec == std::errc() && comma + 2 < shape.data() + shape.size() && comma[0] == ',' &&
      comma[1] == ' ')
    parsed = std::from_chars(comma + 2, shape.data() + shape.size(), columns);
  if (columns < 3 || parsed.ptr == shape.data() + shape.size() || *parsed.ptr != ')')
    text.fail(fmt::format("an array of shape ({}, expected (N, 3) or more columns",
                          shape.substr(0, shape.find(')') + 1)));
  const std::string_view body = bytes.substr(begin + length);
  if (columns > body.size() || rows > body.size() / (columns * size))
    text.fail(fmt::format("ends after {} bytes of numbers, expected {} × {} × {}", body.size(),
                          rows, columns, size));
  const bool by_columns = order.starts_with("True");
  const Field number{"", 'f', size, 0};
  Collector out(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto at = [&](std::size_t k) {
      return value_of(number, body.data() + size * (by_columns ? k * rows + i : i * columns + k),
                      std::endian::native == std::endian::big);
    };
    out.add(at(0), at(1), at(2));
  }
  return out.points();
}

}  // namespace

std::optional<PointFormat> point_format(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".ply") return PointFormat::ply;
  if (ending == ".pcd") return PointFormat::pcd;
  if (ending == ".npy") return PointFormat::npy;
  if (ending == ".xyz" || ending == ".txt" || ending == ".csv") return PointFormat::xyz;
  return std::nullopt;
}

PointFile points_from_bytes(std::string_view bytes, PointFormat format, const std::string& where) {
  Text text(bytes, where);
  switch (format) {
    case PointFormat::ply:
      return read_ply(text);
    case PointFormat::pcd:
      return read_pcd(text);
    case PointFormat::npy:
      return read_npy(bytes, text);
    case PointFormat::xyz:
      break;
  }
  return read_xyz(text);
}

PointFile read_points(const std::filesystem::path& file) {
  const auto format = point_format(file);
  if (!format)
    throw Error(ErrorCode::usage, fmt::format("{}: ends in '{}', expected .ply, .pcd, .npy, .xyz, "
                                              ".txt or .csv",
                                              file.string(), file.extension().string()));
  return points_from_bytes(read_file(file), *format, file.string());
}

std::vector<geometry::SE3> poses_from_text(std::string_view bytes, const std::string& where) {
  Text text(bytes, where);
  std::vector<geometry::SE3> out;
  while (text.next())
    if (!text.is_comment()) out.push_back(text.pose(0));
  return out;
}

std::vector<geometry::SE3> read_poses(const std::filesystem::path& file) {
  return poses_from_text(read_file(file), file.string());
}

}  // namespace hamelin::sensing
