#include "tools/surface/coverage_picture.h"

namespace haustra::surface {

std::array<std::uint8_t, 3> ColourOf(WallView view) {
  switch (view) {
    case WallView::kWell: return {0x56, 0xb4, 0xe9};
    case WallView::kPoorly: return {0xd5, 0x5e, 0x00};
    case WallView::kNever: break;
  }
  return {0, 0, 0};
}

Image UnrolledPicture(const WallGrid& wall) {
  const int columns = wall.end_claimed_row() - wall.first_claimed_row();
  if (columns <= 0) return {};
  Image picture(columns * kCellPx, WallGrid::kAngles * kCellPx, PixelFormat::kBgr8);
  for (int y = 0; y < picture.height(); ++y) {
    std::uint8_t* row = picture.row(y);
    for (int x = 0; x < picture.width(); ++x) {
      const WallCell& cell = wall.cell(wall.first_claimed_row() + x / kCellPx, y / kCellPx);
      const std::array<std::uint8_t, 3> rgb = ColourOf(cell.view);
      for (int c = 0; c < 3; ++c) row[3 * x + c] = rgb[2 - c];
    }
  }
  return picture;
}

}  // namespace haustra::surface
