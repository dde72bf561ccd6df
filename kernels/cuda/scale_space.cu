// Gaussian images of all octaves.
//
// The levels of an octave follow from one another as on the CPU. Its level 0, which there is every second pixel of
// level kScalesPerOctave of the octave before, is made from the level 0 of the octave before by the product of the
// kernels in between, so that no octave waits for the levels of another. The two agree up to rounding, except within
// a kernel's reach of the edges.
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kColumns = 128;  // columns of a tile with its margins; a thread for each, and half of the rows
constexpr int kRowsPerThread = 16;
constexpr int kTileRows = 2 * kRowsPerThread;
constexpr int kPitch = kColumns + 4;  // eight rows at one column hit all banks
constexpr int kSegment = 8;           // outputs of a thread in the second pass

// Columns of the output in a tile: as many as the margins leave, whole segments.
__host__ __device__ constexpr int TileWidth(int radius) { return (kColumns - 2 * radius) / kSegment * kSegment; }

__device__ __forceinline__ int Clamp(int v, int low, int high) { return min(max(v, low), high); }

// A level of an octave.
struct PlaneSource {
  const PlaneValue* values;
  int height;
  int stride;

  template <int kCount>
  __device__ __forceinline__ void LoadColumn(int x, int first_y, float (&column)[kCount]) const {
    const PlaneValue* at = values + x;
    if (first_y >= 0 && first_y + kCount <= height) {
      at += static_cast<std::ptrdiff_t>(first_y) * stride;
#pragma unroll
      for (int i = 0; i < kCount; ++i) column[i] = ToCounts(__ldg(at + static_cast<std::ptrdiff_t>(i) * stride));
    } else {
#pragma unroll
      for (int i = 0; i < kCount; ++i) {
        column[i] = ToCounts(__ldg(at + static_cast<std::ptrdiff_t>(Clamp(first_y + i, 0, height - 1)) * stride));
      }
    }
  }
};

// The grey image.
struct GreySource {
  const std::uint8_t* grey;
  int height;
  int pitch;

  template <int kCount>
  __device__ __forceinline__ void LoadColumn(int x, int first_y, float (&column)[kCount]) const {
#pragma unroll
    for (int i = 0; i < kCount; ++i) {
      column[i] = kCountsPerGrey *
                  static_cast<float>(grey[static_cast<std::ptrdiff_t>(Clamp(first_y + i, 0, height - 1)) * pitch + x]);
    }
  }
};

// The grey image at twice its size: out(2x, 2y) = in(x, y), linear in between. Columns start at even rows.
struct EnlargedSource {
  const std::uint8_t* grey;
  int width;  // of the grey image
  int height;
  int pitch;

  template <int kCount>
  __device__ __forceinline__ void LoadColumn(int x, int first_y, float (&column)[kCount]) const {
    static_assert(kCount % 2 == 0);
    const int left = x / 2;
    const int right = min(left + (x & 1), width - 1);
    const int first_row = first_y >> 1;  // first_y is even, perhaps negative
    float before = 0.0f;
#pragma unroll
    for (int i = 0; i <= kCount / 2; ++i) {
      const std::uint8_t* row = grey + static_cast<std::ptrdiff_t>(Clamp(first_row + i, 0, height - 1)) * pitch;
      const float here = 0.25f * kCountsPerGrey * static_cast<float>(row[left] + row[right]);
      if (i > 0) column[2 * i - 1] = before + here;
      if (i < kCount / 2) column[2 * i] = here + here;
      before = here;
    }
  }
};

// One tile: columns into registers, blurred downwards into shared memory, then along the rows.
template <int kRadius, typename Source>
__device__ __forceinline__ void BlurTile(const Source& source, const BlurWeights& weights, int tile_x, int tile_y,
                                         int width, int height, int stride, PlaneValue* __restrict__ out) {
  constexpr int kWidth = TileWidth(kRadius);
  __shared__ __align__(16) float tmp[kTileRows][kPitch];
  const int column = threadIdx.x % kColumns;
  const int half = threadIdx.x / kColumns;
  if (column < kWidth + 2 * kRadius) {
    float v[kRowsPerThread + 2 * kRadius];
    source.LoadColumn(Clamp(tile_x * kWidth - kRadius + column, 0, width - 1),
                      tile_y * kTileRows + half * kRowsPerThread - kRadius, v);
#pragma unroll
    for (int r = 0; r < kRowsPerThread; ++r) {
      float sum = weights.w[0] * v[r + kRadius];
#pragma unroll
      for (int j = 1; j <= kRadius; ++j) sum = fmaf(weights.w[j], v[r + kRadius - j] + v[r + kRadius + j], sum);
      tmp[half * kRowsPerThread + r][column] = sum;
    }
  }
  __syncthreads();
  // Eight lanes take eight rows (see kPitch), four groups of lanes neighbouring segments (whole sectors are written).
#pragma unroll
  for (int item = threadIdx.x; item < kTileRows * 16; item += 2 * kColumns) {
    const int row = item % 8 + item / 32 % 4 * 8;
    const int segment = item / 8 % 4 + item / 128 * 4;
    const int x = tile_x * kWidth + segment * kSegment;
    const int y = tile_y * kTileRows + row;
    if (segment * kSegment >= kWidth || x >= width || y >= height) continue;
    constexpr int kLoads = (kSegment + 2 * kRadius + 3) / 4;
    float v[4 * kLoads];
#pragma unroll
    for (int i = 0; i < kLoads; ++i) {
      const float4 four = *reinterpret_cast<const float4*>(&tmp[row][segment * kSegment + 4 * i]);
      v[4 * i] = four.x;
      v[4 * i + 1] = four.y;
      v[4 * i + 2] = four.z;
      v[4 * i + 3] = four.w;
    }
    float sums[kSegment];
#pragma unroll
    for (int c = 0; c < kSegment; ++c) {
      sums[c] = weights.w[0] * v[c + kRadius];
#pragma unroll
      for (int j = 1; j <= kRadius; ++j) {
        sums[c] = fmaf(weights.w[j], v[c + kRadius - j] + v[c + kRadius + j], sums[c]);
      }
    }
    // Rows have room for whole segments.
    *reinterpret_cast<uint4*>(out + static_cast<std::size_t>(y) * stride + x) =
        make_uint4(ToPlaneValues(sums[0], sums[1]), ToPlaneValues(sums[2], sums[3]), ToPlaneValues(sums[4], sums[5]),
                   ToPlaneValues(sums[6], sums[7]));
  }
}

__host__ __device__ constexpr int NumTiles(int size, int tile) { return (size + tile - 1) / tile; }

// Which octave and tile a block works on, when the tiles of several octaves lie one after the other.
struct TileOfBlock {
  int slot;
  int x;
  int y;
};

template <int kRadius>
__host__ __device__ int NumTilesOf(const OctaveLayout& octave) {
  return NumTiles(octave.width, TileWidth(kRadius)) * NumTiles(octave.height, kTileRows);
}

template <int kRadius>
__device__ __forceinline__ TileOfBlock FindTile(const ScaleSpaceLayout& layout, int first_slot, int last_slot) {
  int tile = blockIdx.x;
  int slot = first_slot;
  for (; slot < last_slot - 1; ++slot) {
    const int num_tiles = NumTilesOf<kRadius>(layout.octaves[slot]);
    if (tile < num_tiles) break;
    tile -= num_tiles;
  }
  const int columns = NumTiles(layout.octaves[slot].width, TileWidth(kRadius));
  return {slot, tile % columns, tile / columns};
}

template <int kRadius>
__global__ void __launch_bounds__(2 * kColumns)
    LevelKernel(const __grid_constant__ ScaleSpaceLayout layout, PlaneValue* __restrict__ planes, int level,
                int first_slot, int last_slot, const __grid_constant__ BlurWeights weights) {
  const TileOfBlock tile = FindTile<kRadius>(layout, first_slot, last_slot);
  const OctaveLayout& octave = layout.octaves[tile.slot];
  PlaneValue* out = planes + octave.first_value + level * octave.plane_size;
  BlurTile<kRadius>(PlaneSource{out - octave.plane_size, octave.height, octave.stride}, weights, tile.x, tile.y,
                    octave.width, octave.height, octave.stride, out);
}

// The first tiles are those of the enlarged input.
template <int kEnlargedRadius, int kRadius>
__global__ void __launch_bounds__(2 * kColumns)
    FirstLevelsKernel(const __grid_constant__ ScaleSpaceLayout layout, const std::uint8_t* __restrict__ grey,
                      PlaneValue* __restrict__ planes, const __grid_constant__ BlurWeights enlarged_weights,
                      const __grid_constant__ BlurWeights weights) {
  const int num_enlarged = NumTilesOf<kEnlargedRadius>(layout.octaves[0]);
  const int tile = blockIdx.x;
  if (tile < num_enlarged) {
    const OctaveLayout& octave = layout.octaves[0];
    const int columns = NumTiles(octave.width, TileWidth(kEnlargedRadius));
    BlurTile<kEnlargedRadius>(EnlargedSource{grey, layout.width, layout.height, layout.grey_pitch}, enlarged_weights,
                              tile % columns, tile / columns, octave.width, octave.height, octave.stride,
                              planes + octave.first_value);
  } else {
    const OctaveLayout& octave = layout.octaves[1];
    const int columns = NumTiles(octave.width, TileWidth(kRadius));
    BlurTile<kRadius>(GreySource{grey, layout.height, layout.grey_pitch}, weights, (tile - num_enlarged) % columns,
                      (tile - num_enlarged) / columns, octave.width, octave.height, octave.stride,
                      planes + octave.first_value);
  }
}

constexpr int kHalvedRadius = 15;
constexpr int kHalvedColumns = 32;
constexpr int kHalvedRows = 8;

// Level 0 of the next octave: blur and every second pixel.
__global__ void __launch_bounds__(256)
    NextOctaveKernel(const __grid_constant__ ScaleSpaceLayout layout, PlaneValue* __restrict__ planes, int slot,
                     const __grid_constant__ BlurWeights weights) {
  constexpr int kWidth = 2 * kHalvedColumns + 2 * kHalvedRadius;
  constexpr int kHeight = 2 * kHalvedRows + 2 * kHalvedRadius;
  __shared__ float in_tile[kHeight][kWidth];
  __shared__ float tmp[kHalvedRows][kWidth];
  const OctaveLayout& from = layout.octaves[slot - 1];
  const OctaveLayout& to = layout.octaves[slot];
  const PlaneValue* in = planes + from.first_value;
  const int first_x = 2 * kHalvedColumns * blockIdx.x - kHalvedRadius;
  const int first_y = 2 * kHalvedRows * blockIdx.y - kHalvedRadius;
  for (int i = threadIdx.x; i < kWidth * kHeight; i += 256) {
    const int x = Clamp(first_x + i % kWidth, 0, from.width - 1);
    const int y = Clamp(first_y + i / kWidth, 0, from.height - 1);
    in_tile[i / kWidth][i % kWidth] = ToCounts(in[static_cast<std::size_t>(y) * from.stride + x]);
  }
  __syncthreads();
  for (int i = threadIdx.x; i < kWidth * kHalvedRows; i += 256) {
    const int x = i % kWidth;
    const int y = 2 * (i / kWidth) + kHalvedRadius;
    float sum = weights.w[0] * in_tile[y][x];
#pragma unroll
    for (int j = 1; j <= kHalvedRadius; ++j) sum = fmaf(weights.w[j], in_tile[y - j][x] + in_tile[y + j][x], sum);
    tmp[i / kWidth][x] = sum;
  }
  __syncthreads();
  const int column = threadIdx.x % kHalvedColumns;
  const int row = threadIdx.x / kHalvedColumns;
  const float* line = tmp[row] + 2 * column + kHalvedRadius;
  float sum = weights.w[0] * line[0];
#pragma unroll
  for (int j = 1; j <= kHalvedRadius; ++j) sum = fmaf(weights.w[j], line[-j] + line[j], sum);
  const int x = kHalvedColumns * blockIdx.x + column;
  const int y = kHalvedRows * blockIdx.y + row;
  if (x < to.width && y < to.height) {
    planes[to.first_value + static_cast<std::size_t>(y) * to.stride + x] = ToPlaneValue(sum);
  }
}

BlurWeights WeightsOf(const GaussianKernel& kernel) {
  BlurWeights weights;
  for (int j = 0; j <= kernel.radius; ++j) weights.w[j] = kernel.weights[j];
  return weights;
}

// A symmetric kernel of any radius, for products.
struct WideKernel {
  int radius = 0;
  double w[64] = {};

  double at(int j) const { return j < 0 ? at(-j) : (j <= radius ? w[j] : 0.0); }
};

WideKernel Product(const WideKernel& a, const GaussianKernel& b) {
  WideKernel product;
  product.radius = a.radius + b.radius;
  for (int i = 0; i <= product.radius; ++i) {
    for (int j = -b.radius; j <= b.radius; ++j) product.w[i] += a.at(i - j) * b.weights[j < 0 ? -j : j];
  }
  return product;
}

// From level 0 of an octave to level kScalesPerOctave, the base of the next.
WideKernel KernelToNextOctave() {
  WideKernel kernel;
  kernel.w[0] = 1.0;
  for (int level = 1; level <= kScalesPerOctave; ++level) kernel = Product(kernel, KernelOfLevel(level));
  return kernel;
}

BlurWeights NextOctaveWeights() {
  const WideKernel kernel = KernelToNextOctave();
  BlurWeights weights;
  for (int j = 0; j <= kHalvedRadius; ++j) weights.w[j] = static_cast<float>(kernel.at(j));
  return weights;
}

constexpr int kEnlargedRadius = 4;
constexpr int kOctaveZeroRadius = 10;

// Level 0 of octave 0 straight from the grey image: enlarge, level 0 of octave -1, on to its level kScalesPerOctave,
// every second pixel. Odd pixels of the enlarged image are means of their neighbours.
BlurWeights OctaveZeroWeights() {
  const WideKernel kernel = Product(KernelToNextOctave(), KernelOfLevel(0));
  BlurWeights weights;
  for (int j = 0; j <= kOctaveZeroRadius; ++j) {
    weights.w[j] = static_cast<float>(kernel.at(2 * j) + 0.5 * (kernel.at(2 * j - 1) + kernel.at(2 * j + 1)));
  }
  return weights;
}

template <int kRadius>
cudaError_t LaunchLevelWithRadius(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int level,
                                  int first_slot, int last_slot, const BlurWeights& weights, cudaStream_t stream) {
  int num_tiles = 0;
  for (int slot = first_slot; slot < last_slot; ++slot) num_tiles += NumTilesOf<kRadius>(layout.octaves[slot]);
  LevelKernel<kRadius>
      <<<num_tiles, 2 * kColumns, 0, stream>>>(layout, buffers.planes, level, first_slot, last_slot, weights);
  return cudaGetLastError();
}

}  // namespace

cudaError_t LaunchFirstLevels(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, cudaStream_t stream) {
  static_assert(kFirstOctave == -1);
  const int num_tiles = NumTilesOf<kEnlargedRadius>(layout.octaves[0]) +
                        (layout.num_octaves > 1 ? NumTilesOf<kOctaveZeroRadius>(layout.octaves[1]) : 0);
  FirstLevelsKernel<kEnlargedRadius, kOctaveZeroRadius><<<num_tiles, 2 * kColumns, 0, stream>>>(
      layout, buffers.grey, buffers.planes, WeightsOf(KernelOfLevel(0)), OctaveZeroWeights());
  return cudaGetLastError();
}

cudaError_t LaunchNextOctave(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int slot,
                             cudaStream_t stream) {
  const OctaveLayout& octave = layout.octaves[slot];
  const dim3 grid(NumTiles(octave.width, kHalvedColumns), NumTiles(octave.height, kHalvedRows));
  NextOctaveKernel<<<grid, 256, 0, stream>>>(layout, buffers.planes, slot, NextOctaveWeights());
  return cudaGetLastError();
}

cudaError_t LaunchLevel(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int level, int first_slot,
                        int last_slot, cudaStream_t stream) {
  const GaussianKernel kernel = KernelOfLevel(level);
  const BlurWeights weights = WeightsOf(kernel);
  // The next radius that is compiled; weights beyond the kernel's own are zero.
  if (kernel.radius <= 4)
    return LaunchLevelWithRadius<4>(layout, buffers, level, first_slot, last_slot, weights, stream);
  if (kernel.radius <= 5)
    return LaunchLevelWithRadius<5>(layout, buffers, level, first_slot, last_slot, weights, stream);
  if (kernel.radius <= 6)
    return LaunchLevelWithRadius<6>(layout, buffers, level, first_slot, last_slot, weights, stream);
  if (kernel.radius <= 8)
    return LaunchLevelWithRadius<8>(layout, buffers, level, first_slot, last_slot, weights, stream);
  return LaunchLevelWithRadius<10>(layout, buffers, level, first_slot, last_slot, weights, stream);
}

}  // namespace haustra::kernels::cuda
