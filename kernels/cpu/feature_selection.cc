#include "kernels/cpu/feature_selection.h"

#include <algorithm>
#include <cmath>

#include "kernels/common/selection_parameters.h"
#include "kernels/common/sift_parameters.h"

namespace haustra::kernels {
namespace {

int NumCells(int size_px) { return (size_px + kSelectionCellPx - 1) / kSelectionCellPx; }

}  // namespace

FeatureSelection::FeatureSelection(int max_width_px, int max_height_px, int max_points)
    : ranked_(max_points),
      cell_starts_(static_cast<std::size_t>(NumCells(max_width_px)) * NumCells(max_height_px) + 1),
      order_(max_points) {}

std::size_t FeatureSelection::BytesFor(int max_width_px, int max_height_px, int max_points) {
  return AlignedBuffer<Ranked>::BytesFor(max_points) + AlignedBuffer<std::int32_t>::BytesFor(max_points) +
         AlignedBuffer<std::int32_t>::BytesFor(
             static_cast<std::size_t>(NumCells(max_width_px)) * NumCells(max_height_px) + 1);
}

void FeatureSelection::Prefault() {
  ranked_.SetZero();
  cell_starts_.SetZero();
  order_.SetZero();
}

std::span<const std::int32_t> FeatureSelection::Select(std::span<const ScaleSpacePoint> points, int width_px,
                                                       int height_px, int wanted) {
  const int num_columns = NumCells(width_px);
  const int num_rows = NumCells(height_px);
  const int num_cells = num_columns * num_rows;
  const int num_points = static_cast<int>(points.size());
  const auto cell_of = [&](const ScaleSpacePoint& point) {
    const float to_input = std::ldexp(1.0f, point.octave);
    const int column = std::clamp(static_cast<int>(point.x * to_input) / kSelectionCellPx, 0, num_columns - 1);
    const int row = std::clamp(static_cast<int>(point.y * to_input) / kSelectionCellPx, 0, num_rows - 1);
    return row * num_columns + column;
  };
  std::int32_t* starts = cell_starts_.data();
  std::fill_n(starts, num_cells + 1, 0);
  for (const ScaleSpacePoint& point : points) ++starts[cell_of(point)];
  for (int c = 0, sum = 0; c <= num_cells; ++c) {
    const int count = c < num_cells ? starts[c] : 0;
    sum += count;
    starts[c] = sum;
  }
  Ranked* ranked = ranked_.data();
  for (int i = num_points - 1; i >= 0; --i) {
    const float priority = points[i].octave < 0 ? kFinestOctavePriority * points[i].response : points[i].response;
    ranked[--starts[cell_of(points[i])]] = {priority, i};
  }

  const auto is_before = [](const Ranked& a, const Ranked& b) {
    return a.priority != b.priority ? a.priority > b.priority : a.index < b.index;
  };
  const float points_per_halving = kSharesPerHalving * static_cast<float>(wanted) / static_cast<float>(num_cells);
  for (int c = 0; c < num_cells; ++c) {
    const int first = starts[c];
    const int last = c + 1 < num_cells ? starts[c + 1] : num_points;
    std::sort(ranked + first, ranked + last, is_before);
    for (int i = first; i < last; ++i) {
      ranked[i].priority *= std::exp2(-static_cast<float>(i - first) / points_per_halving);
    }
  }
  const int num_selected = std::min(wanted, num_points);
  if (num_selected < num_points) std::nth_element(ranked, ranked + num_selected, ranked + num_points, is_before);
  std::sort(ranked, ranked + num_selected, is_before);
  for (int i = 0; i < num_selected; ++i) order_[i] = ranked[i].index;
  return {order_.data(), static_cast<std::size_t>(num_selected)};
}

}  // namespace haustra::kernels
