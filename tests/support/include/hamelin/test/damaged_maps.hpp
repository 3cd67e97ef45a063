#pragma once
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "hamelin/io/file.hpp"

/// Map files that are damaged or unusual, made from the bytes of a valid one.
namespace hamelin::test {

struct MapCase {
  std::string name;  ///< of the file
  std::string bytes;
  std::string message;  ///< part of the refusal, or of the warning if the map is accepted
  bool accepted = false;
};

inline std::string map_text(const std::string& first_line, const std::string& id, int nodes,
                            const std::string& res, const std::string& body) {
  return first_line + "\nid " + id + "\nsize " + std::to_string(nodes) + "\nres " + res +
         "\ndata\n" + body;
}
inline std::string bt_text(int nodes, const std::string& res, const std::string& body) {
  return map_text("# Octomap OcTree binary file", "OcTree", nodes, res, body);
}
inline std::string ot_text(int nodes, const std::string& body) {
  return map_text("# Octomap OcTree file", "OcTree", nodes, "0.05", body);
}

/// A node of a .ot file: log-odds and the bits of its children.
inline std::string ot_node(float log_odds, unsigned char children) {
  std::string bytes(sizeof log_odds, '\0');
  std::memcpy(bytes.data(), &log_odds, sizeof log_odds);
  return bytes + static_cast<char>(children);
}

inline std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

/// The root is an occupied leaf: a cube of 3.3 km.
inline std::string occupied_root() {
  return ot_text(1, ot_node(3.5F, 0));
}
/// One child of the root is an occupied leaf, the others are unknown.
inline std::string occupied_octant() {
  return bt_text(2, "0.05", std::string("\x02\x00", 2));
}
/// A valid map with voxels of 0.05 m.
inline std::string valid_map() {
  return read_file(HAMELIN_SOURCE_DIR "/tests/fuzz/corpus/maps/clutter1.bt");
}
/// The same map with a resolution in millimetres.
inline std::string millimetre_map() {
  std::string text = valid_map();
  const std::string metres = "res 0.05";
  return text.replace(text.find(metres), metres.size(), "res 50");
}

inline std::string legacy_header(double resolution) {
  std::string bytes("\3\0\0\0", 4);
  bytes.append(sizeof resolution, '\0');
  std::memcpy(bytes.data() + 4, &resolution, sizeof resolution);
  return bytes + std::string("\2\0\0\0", 4);
}

inline std::vector<MapCase> map_cases() {
  const std::string bt = valid_map();
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = bt;
    const auto at = text.find(from);
    if (at == std::string::npos) throw std::logic_error("not in the map: " + from);
    return text.replace(at, from.size(), to);
  };
  const std::size_t body = bt.find("data\n") + 5;
  // a root with two leaves
  const std::string ot = ot_text(3, ot_node(0.5F, 3) + ot_node(0.5F, 0) + ot_node(-0.5F, 0));
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              infinity = std::numeric_limits<float>::infinity();
  const std::string level = std::string("\x03\x00", 2);  // an inner node with one inner child
  std::string crlf;
  for (const char c : ot) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
  return {
      {"whole.bt", bt, "", true},
      {"whole.ot", ot, "wider than", true},
      {"root_occupied.ot", occupied_root(), "wider than", true},
      {"octant_occupied.bt", occupied_octant(), "wider than", true},
      {"cut_to_header.bt", bt.substr(0, body), "byte "},
      {"cut_by_one.bt", bt.substr(0, bt.size() - 1), "byte "},
      {"cut.ot", ot.substr(0, ot.size() - 4), "byte "},
      {"trailing.bt", bt + "0123456789", "byte "},
      {"res_0.bt", with("res 0.05", "res 0"), "header"},
      {"res_negative.bt", with("res 0.05", "res -0.05"), "header"},
      {"res_nan.bt", with("res 0.05", "res nan"), "header"},
      {"res_tiny.bt", with("res 0.05", "res 1e-300"), "header"},
      {"res_comma.bt", with("res 0.05", "res 0,05"), "header"},
      {"res_twice.bt", with("res 0.05", "res 0.05\nres 7"), "header"},
      {"millimetres.bt", millimetre_map(), "scale"},
      {"size_0.bt", with("size 118", "size 0"), ""},
      {"size_1.bt", with("size 118", "size 1"), ""},
      {"size_large.bt", with("size 118", "size 4294967296"), ""},
      {"size_missing.bt", with("size 118\n", ""), "header"},
      {"id_none.bt", with("id OcTree", "id "), "header"},
      {"id_unknown.bt", with("id OcTree", "id Nonsense"), "header"},
      {"id_coloured.ot",
       map_text("# Octomap OcTree file", "ColorOcTree", 3, "0.05",
                ot.substr(ot.find("data\n") + 5)),
       ""},
      {"other_format.bt", with("# Octomap OcTree binary file", "# Octomap OcTree file"), ""},
      {"text_mode.ot", crlf, "header"},
      {"all_ones.ot", ot_text(3, std::string(50, '\xff')), "byte "},
      {"chain.bt", bt_text(18, "0.05", repeated(level, 17)), "byte "},
      {"long_chain.bt", bt_text(100001, "0.05", repeated(level, 100000)), "byte "},
      {"long_chain.ot", ot_text(100001, repeated(ot_node(0.5F, 1), 100000)), "byte "},
      {"all_inner.bt", bt_text(9, "0.05", std::string(400000, '\xff')), "byte "},
      {"inner_then_end.bt", bt_text(9, "0.05", "\xff\xff"), "byte "},
      {"inner_then_end.ot", ot_text(9, ot_node(0.5F, 0xff)), "byte "},
      {"inner_without_children.bt", bt_text(2, "0.05", std::string("\x03\x00\x00\x00", 4)),
       "byte "},
      {"nan.ot", ot_text(1, ot_node(nan, 0)), "byte "},
      {"infinite.ot", ot_text(1, ot_node(infinity, 0)), "byte "},
      {"legacy.bt", legacy_header(0.1) + std::string(20, '\0'), "convert_octree"},
      {"legacy_nan.bt", legacy_header(std::numeric_limits<double>::quiet_NaN()) + "\2", "legacy"},
      {"legacy_cut.bt", legacy_header(0.1).substr(0, 7), "legacy"},
      {"empty.bt", "", "empty"},
      {"gzip.bt", std::string("\x1f\x8b\x08\x00", 4), "gunzip"},
      {"pointer.bt", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 2\n",
       "git lfs pull"}};
}

}  // namespace hamelin::test
