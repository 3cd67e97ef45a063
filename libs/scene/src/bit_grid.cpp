#include "bit_grid.hpp"

namespace hamelin::scene {

void extract_blocks(BitGrid& grid, const VoxelBox& used, const std::array<std::int32_t, 3>& origin,
                    std::vector<VoxelBox>& boxes) {
  for (std::int32_t z = used.lo[2]; z < used.hi[2]; ++z) {
    for (std::int32_t y = used.lo[1]; y < used.hi[1]; ++y) {
      for (std::int32_t x = grid.next(used.lo[0], y, z); x < tile; x = grid.next(x, y, z)) {
        std::int32_t x1 = x + 1, y1 = y + 1, z1 = z + 1;
        while (x1 < used.hi[0] && grid.row_is_full(x1, x1 + 1, y, z)) ++x1;
        while (y1 < used.hi[1] && grid.row_is_full(x, x1, y1, z)) ++y1;
        const auto slice_is_full = [&](std::int32_t slice) {
          for (std::int32_t row = y; row < y1; ++row)
            if (!grid.row_is_full(x, x1, row, slice)) return false;
          return true;
        };
        while (z1 < used.hi[2] && slice_is_full(z1)) ++z1;
        for (std::int32_t slice = z; slice < z1; ++slice)
          for (std::int32_t row = y; row < y1; ++row) grid.clear_row(x, x1, row, slice);
        boxes.push_back({{origin[0] + x, origin[1] + y, origin[2] + z},
                         {origin[0] + x1, origin[1] + y1, origin[2] + z1}});
      }
    }
  }
}

}  // namespace hamelin::scene
