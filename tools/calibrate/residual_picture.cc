#include "tools/calibrate/residual_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace haustra {
namespace {

constexpr int kColumns = 24;
constexpr int kMinInCell = 5;
constexpr double kFullRmsPx = 2.0;
constexpr double kEnlarged = 50.0;

using Colour = std::array<std::uint8_t, 3>;  // BGR
constexpr Colour kEmpty = {40, 40, 40};
constexpr Colour kArrow = {255, 255, 255};

struct Cell {
  int num = 0;
  double squares = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
};

Colour ColourOf(double rms_px) {
  const double t = std::clamp(rms_px / kFullRmsPx, 0.0, 1.0);
  const auto channel = [](double value) { return static_cast<std::uint8_t>(std::lround(200.0 * value)); };
  return {channel(1.0 - t), channel(1.0 - std::abs(2.0 * t - 1.0)), channel(t)};
}

void Put(Image* image, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= image->width() || y >= image->height()) return;
  std::copy(colour.begin(), colour.end(), image->row(y) + 3 * x);
}

void DrawLine(Image* image, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const double length = std::min(4096.0, (to - from).norm());
  const int steps = 1 + static_cast<int>(2.0 * length);
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector2d at = from + (to - from) * (static_cast<double>(i) / steps);
    Put(image, static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())), kArrow);
  }
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      Put(image, static_cast<int>(std::lround(from.x())) + dx, static_cast<int>(std::lround(from.y())) + dy, kArrow);
    }
  }
}

}  // namespace

Image DrawResiduals(std::span<const calibration::Residual> residuals, int width_px, int height_px) {
  Image image(width_px, height_px, PixelFormat::kBgr8);
  const int side = std::max(1, (width_px + kColumns - 1) / kColumns);
  const int columns = (width_px + side - 1) / side, rows = (height_px + side - 1) / side;
  std::vector<Cell> cells(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (const calibration::Residual& residual : residuals) {
    const int x = static_cast<int>(residual.pixel.x()) / side, y = static_cast<int>(residual.pixel.y()) / side;
    if (residual.pixel.x() < 0.0 || residual.pixel.y() < 0.0 || x >= columns || y >= rows) continue;
    Cell& cell = cells[static_cast<std::size_t>(y) * columns + x];
    ++cell.num;
    cell.squares += residual.error.squaredNorm();
    cell.sum += residual.error;
  }
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const Cell& cell = cells[static_cast<std::size_t>(y / side) * columns + x / side];
      Put(&image, x, y, cell.num < kMinInCell ? kEmpty : ColourOf(std::sqrt(cell.squares / cell.num)));
    }
  }
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const Cell& cell = cells[static_cast<std::size_t>(y) * columns + x];
      if (cell.num < kMinInCell) continue;
      const Eigen::Vector2d centre((x + 0.5) * side, (y + 0.5) * side);
      DrawLine(&image, centre, centre + kEnlarged * cell.sum / cell.num);
    }
  }
  return image;
}

}  // namespace haustra
