// Where the extractor's data lies on the device, as plain structures that are passed to kernels by value.
#pragma once

#include <cstddef>
#include <cstdint>

#include <vector_types.h>

#include "hal/vision_device.h"
#include "kernels/common/gaussian_kernel.h"
#include "kernels/common/selection_parameters.h"
#include "kernels/common/sift_parameters.h"
#include "kernels/cuda/band_weights.h"
#include "kernels/cuda/completion.h"

namespace haustra::kernels::cuda {

inline constexpr int kNumOctaveSlots = kMaxOctaves - kFirstOctave;
// Octaves are made in square tiles, octave pixels; each finds at most kMaxExtremaPerTile.
inline constexpr int kOctaveTilePx = 60;
inline constexpr int kMaxExtremaPerTile = 512;
// Slots of octaves from here on are made from their own level 0, finer ones from the grey image.
inline constexpr int kFirstCoarseSlot = 2;
// Selection: how many points of a square are kept at most.
inline constexpr int kMaxPointsPerCell = 1536;
// Priorities are positive floats below 1: bins of their exponent and first four bits of mantissa.
inline constexpr int kPriorityBins = 4096;
inline constexpr int kPriorityBinShift = 19;

// Ranks that the descriptor kernel looks at in one go.
inline constexpr int kRanksPerChunk = 2048;

struct OctaveLayout {
  int octave = 0;  // -1: twice the input
  int width = 0;
  int height = 0;
  int stride = 0;               // values, a multiple of 64
  std::size_t first_value = 0;  // of level 0, in the planes
  std::size_t plane_size = 0;   // values of one level
  int first_tile = 0;
  int num_tiles = 0;
  int tile_columns = 0;
  std::uint32_t first_pixel = 0;  // pixels of all octaves are numbered, to break ties
};

struct MaskLayout {
  int width = 0;
  int height = 0;
  int words = 0;  // a row of 32 pixels each
  int num_words = 0;
  int first_word = 0;  // in the mask's bits
};

struct ScaleSpaceLayout {
  int width = 0;  // input
  int height = 0;
  int grey_pitch = 0;
  int num_octaves = 0;
  int num_tiles = 0;
  int num_cell_columns = 0;
  int num_cells = 0;
  // How the frame comes; pitch and address are multiples of 16 bytes.
  PixelFormat format = PixelFormat::kGrey8;
  std::int64_t pitch_bytes = 0;
  OctaveLayout octaves[kNumOctaveSlots];
  MaskLayout masks[kMaxOctaves];  // of octaves 0 and up; octave -1 uses that of octave 0
};

// What changes from frame to frame; in mapped host memory, and copied to the device by the first kernel.
struct FrameParams {
  std::uint32_t set_index = 0;
  std::int32_t num_wanted = 0;     // features, at most ExtractSettings::num_features
  float halvings_per_rank = 0.0f;  // of the priority of a point, for each stronger one of its cell
  std::uint32_t number = 0;        // of the frame, for its completion
};

// Rows [begin, end) of the input.
struct RowRange {
  int begin = 0;
  int end = 0;
};

// Set to zero at the start of every frame, in one piece.
struct FrameCounters {
  std::int32_t num_extrema;
  std::int32_t num_points;
  std::int32_t num_survivors;
  std::int32_t num_further;
  std::int32_t num_described;  // blocks
  std::int32_t num_detected;   // features
  std::int32_t num_followed;   // blocks
  std::int32_t spare;
  std::int32_t bins[kPriorityBins];
  std::int32_t num_placed[kPriorityBins];  // survivors of each bin
  // Followed by the number of points of each cell.
};

// A refined point, octave pixels.
struct ScaleSpacePoint {
  float x, y, scale, response;
};
struct PointKey {
  std::uint32_t tie;     // number of the extremum's pixel and level; unique
  std::uint8_t octave;   // slot in the layout
  std::uint8_t level;    // of the Gaussian image nearest in scale
  std::uint8_t is_twin;  // another extremum of lower tie settled at the very same point
  std::uint8_t is_upright;
};

struct CellPoint {
  float response;
  std::uint32_t tie;
  std::int32_t point;
  std::int32_t spare;
};

// A point that may be selected; `first` to `end` are the places of those of its bin, in any order, behind all of higher
// bins.
struct alignas(16) Survivor {
  std::int32_t point;
  std::int32_t first;
  std::int32_t end;
  std::int32_t spare;
};

// By rank.
struct SelectedPoint {
  std::int32_t point;
  float angles[kMaxOrientations];
};
// Of each rank: number of angles, and whether the point is a twin that takes its share of the limit and is dropped.
inline constexpr std::uint8_t kCountMask = 3;
inline constexpr std::uint8_t kTwinFlag = 0x80;
static_assert(kMaxOrientations <= kCountMask);
inline constexpr int kFurtherShift = 2;

// A feature that was to be followed, input pixels.
struct FollowedFeature {
  float x_px, y_px;
  std::int32_t is_new;  // found, and not by detection
};

struct ExtractBuffers {
  const FrameParams* host_params = nullptr;
  FrameParams* params = nullptr;
  FrameCounters* counters = nullptr;
  std::int32_t* cell_counts = nullptr;  // right behind the counters
  std::uint8_t* grey = nullptr;
  // Dark surround: first and last pixel of each row and column that is not dark.
  std::int32_t* row_first = nullptr;
  std::int32_t* row_last = nullptr;
  std::int32_t* column_first = nullptr;
  std::int32_t* column_last = nullptr;
  std::uint8_t* static_mask = nullptr;  // pitch as grey; read when has_static_mask
  std::uint32_t* mask_bits = nullptr;
  // Dilated: that of octave -1, then those of octaves 0 and up, laid out as in mask_bits.
  std::uint32_t* dilated_bits = nullptr;
  const BandWeights* band_weights = nullptr;  // by BandSource
  std::uint16_t* planes = nullptr;
  uint2* extrema = nullptr;  // x | y << 16, level | octave slot << 8
  ScaleSpacePoint* points = nullptr;
  PointKey* keys = nullptr;
  std::uint64_t* priorities = nullptr;  // of each point: bits of the float, then the complement of tie
  CellPoint* cell_points = nullptr;     // kMaxPointsPerCell a cell
  // The points that may be selected: those whose priority is in the bin of the last one that is, or in a higher one.
  std::uint64_t* survivor_priorities = nullptr;
  Survivor* survivors = nullptr;
  // By rank, num_features rounded up to kRanksPerChunk; counts beyond the selected points are 0.
  SelectedPoint* selected = nullptr;
  std::uint8_t* angle_counts = nullptr;
  std::uint64_t* places = nullptr;       // octave, y, x (cut short): almost the order of the output
  std::uint16_t* kept_levels = nullptr;  // of the last picture: level 0 of the octaves from 0 on, kFlowLevels at most
  FollowedFeature* followed = nullptr;
  // Angles after the first of a point, in any order: rank << kFurtherShift | number of the angle.
  std::uint32_t* further = nullptr;
};

// Settings that stay.
struct ExtractSettings {
  float contrast_threshold = 0.0f;
  float edge_threshold = 0.0f;
  int reflection_threshold = 256;
  int border_threshold = 0;
  int mask_dilation_px = 0;
  int has_static_mask = 0;
  int num_features = 0;
  int root_sift = 0;
  int upright_dark = 0;
  int can_launch_early = 0;  // kernel_launch.cuh
};

// Feature sets on the device: all in one piece, max_features to a set.
struct SetBuffers {
  Keypoint* keypoints = nullptr;
  std::uint8_t* descriptors = nullptr;
  float* inverse_norms = nullptr;
  int max_features = 0;
};

// Results in mapped host memory.
struct FrameOutput {
  Keypoint* keypoints = nullptr;
  std::int32_t* num_features = nullptr;
  std::int32_t* num_detected = nullptr;  // of these, the first ones
  DoneWord* done = nullptr;
};

}  // namespace haustra::kernels::cuda
