#include "kernels/cuda/scale_space_layout.h"

#include "kernels/common/flow_parameters.h"

namespace haustra::kernels::cuda {
namespace {

constexpr int kStrideAlignment = 64;
constexpr int kGreyPitchAlignment = 64;

int NumTiles(int size, int tile) { return (size + tile - 1) / tile; }
int AlignUp(int size, int alignment) { return NumTiles(size, alignment) * alignment; }

}  // namespace

ScaleSpaceLayout MakeLayout(int width_px, int height_px) {
  ScaleSpaceLayout layout;
  layout.width = width_px;
  layout.height = height_px;
  layout.grey_pitch = AlignUp(width_px, kGreyPitchAlignment);
  layout.num_octaves = CountOctaves(width_px, height_px);
  layout.num_cell_columns = NumTiles(width_px, kSelectionCellPx);
  layout.num_cells = layout.num_cell_columns * NumTiles(height_px, kSelectionCellPx);
  std::size_t first_value = 0;
  std::uint32_t first_pixel = 0;
  for (int slot = 0; slot < layout.num_octaves; ++slot) {
    OctaveLayout& octave = layout.octaves[slot];
    octave.octave = kFirstOctave + slot;
    octave.width = OctaveSize(width_px, octave.octave);
    octave.height = OctaveSize(height_px, octave.octave);
    octave.stride = AlignUp(octave.width, kStrideAlignment);
    octave.plane_size = static_cast<std::size_t>(octave.stride) * octave.height;
    octave.first_value = first_value;
    octave.first_tile = layout.num_tiles;
    octave.tile_columns = NumTiles(octave.width, kOctaveTilePx);
    octave.num_tiles = octave.tile_columns * NumTiles(octave.height, kOctaveTilePx);
    octave.first_pixel = first_pixel;
    first_value += kNumLevels * octave.plane_size;
    first_pixel += static_cast<std::uint32_t>(octave.width) * octave.height;
    layout.num_tiles += octave.num_tiles;
  }
  int width = width_px;
  int height = height_px;
  int first_word = 0;
  for (MaskLayout& mask : layout.masks) {
    mask.width = width;
    mask.height = height;
    mask.words = NumTiles(width, 32);
    mask.first_word = first_word;
    mask.num_words = mask.words * height;
    first_word += mask.num_words;
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
  return layout;
}

LayoutSizes SizesOf(const ScaleSpaceLayout& layout) {
  const OctaveLayout& last = layout.octaves[layout.num_octaves - 1];
  const MaskLayout& coarsest = layout.masks[kMaxOctaves - 1];
  LayoutSizes sizes;
  sizes.plane_values = last.first_value + kNumLevels * last.plane_size;
  sizes.mask_words = static_cast<std::size_t>(coarsest.first_word) + coarsest.num_words;
  sizes.max_extrema = static_cast<std::size_t>(layout.num_tiles) * kMaxExtremaPerTile;
  for (int slot = -kFirstOctave; slot < layout.num_octaves && slot < kFlowLevels - kFirstOctave; ++slot) {
    sizes.kept_values += layout.octaves[slot].plane_size;
  }
  return sizes;
}

}  // namespace haustra::kernels::cuda
