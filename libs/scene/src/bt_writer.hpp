#pragma once
#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

/// The state of a cell; the values are the codes of a `.bt`. `parts`: its eight parts differ.
enum class BtNode : unsigned { unknown = 0, free = 1, occupied = 2, parts = 3 };

/// Writes the body of a `.bt`, pruned as by OctoMap, from the answers of a function for each cell.
/// There is never a tree in memory.
class BtWriter {
 public:
  static constexpr std::int32_t half = 1 << 15;  ///< voxels from the centre to the faces

  /// @param state_of `BtNode state_of(const Cell&, const Context& above, Context& here)`, called
  ///        from the widest cell down to cells for which it does not return `parts`. The value that
  ///        it stores in `here` is passed as `above` for the eight parts of the cell.
  template <typename Context, typename StateOf>
  explicit BtWriter(const Context& top, const StateOf& state_of) {
    const BtNode root = add({{-half, -half, -half}, 2 * half}, top, state_of);
    // A .bt cannot express a root that is a leaf; eight leaves are equivalent.
    if (root == BtNode::free || root == BtNode::occupied) {
      body_.assign(2, root == BtNode::free ? '\x55' : '\xaa');
      nodes_ = 8;
    }
    if (root != BtNode::unknown) ++nodes_;
  }

  [[nodiscard]] std::size_t nodes() const noexcept { return nodes_; }
  [[nodiscard]] std::size_t occupied_voxels() const noexcept { return voxels_[2]; }
  [[nodiscard]] std::size_t free_voxels() const noexcept { return voxels_[1]; }

  /// The whole file. @param comment one line
  [[nodiscard]] std::string file(double resolution, std::string_view comment) const {
    return fmt::format("# Octomap OcTree binary file\n# {}\n#\nid OcTree\nsize {}\nres {}\ndata\n",
                       comment, nodes_, resolution) +
           body_;
  }

 private:
  template <typename Context, typename StateOf>
  BtNode add(const Cell& cell, const Context& above, const StateOf& state_of) {
    Context here{};
    const BtNode node = state_of(cell, above, here);
    if (node != BtNode::parts) {
      const auto edge = static_cast<std::size_t>(cell.size);
      voxels_[static_cast<std::size_t>(node)] += edge * edge * edge;
      return node;
    }
    const std::size_t at = body_.size(), nodes = nodes_;
    body_.append(2, '\0');
    unsigned code = 0;
    for (unsigned part = 0; part < 8; ++part) {
      Cell inner{cell.lo, cell.size / 2};
      for (unsigned axis = 0; axis < 3; ++axis)
        inner.lo[axis] += (part >> axis) & 1U ? inner.size : 0;
      const BtNode child = add(inner, here, state_of);
      code |= static_cast<unsigned>(child) << (2U * part);
      nodes_ += child != BtNode::unknown ? 1 : 0;
    }
    const unsigned first = code & 3U;
    if (first != 3 && code == first * 0x5555U) {
      body_.resize(at);
      nodes_ = nodes;
      return static_cast<BtNode>(first);
    }
    body_[at] = static_cast<char>(code & 0xffU);
    body_[at + 1] = static_cast<char>(code >> 8U);
    return BtNode::parts;
  }

  std::string body_;
  std::size_t nodes_ = 0;
  std::size_t voxels_[4] = {};
};

}  // namespace hamelin::scene
