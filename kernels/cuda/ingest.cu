// Frame into device memory as grey, and the masks. The frame is read where it lies in host memory: once, in whole
// lines, which takes no longer than a copy and saves one (on Jetson, host memory is the device's). It comes in bands of
// rows, so that the fine octaves begin before all of it is there.
#include <algorithm>
#include <cstdint>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/mask_dilation.h"

namespace haustra::kernels::cuda {
namespace {

constexpr int kIngestThreads = 128;
constexpr int kPixelsPerLoad = 16;

// Integer luma (Rec. 601), rounded; the same as the CPU device's.
__device__ std::uint32_t Luma(std::uint32_t blue, std::uint32_t green, std::uint32_t red) {
  return (29 * blue + 150 * green + 77 * red + 128) >> 8;
}

__device__ uint4 LumaOfBgr(const uint4* in) {
  uint4 packed[3] = {in[0], in[1], in[2]};
  const std::uint8_t* bytes = reinterpret_cast<const std::uint8_t*>(packed);
  std::uint32_t words[4];
#pragma unroll
  for (int w = 0; w < 4; ++w) {
    words[w] = 0;
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      const int at = 3 * (4 * w + k);
      words[w] |= Luma(bytes[at], bytes[at + 1], bytes[at + 2]) << (8 * k);
    }
  }
  return {words[0], words[1], words[2], words[3]};
}

// Bytes 0 and 2 of each word, or 1 and 3.
__device__ uint4 LumaOfYuv(const uint4* in, std::uint32_t selector) {
  const uint4 left = in[0];
  const uint4 right = in[1];
  return {__byte_perm(left.x, left.y, selector), __byte_perm(left.z, left.w, selector),
          __byte_perm(right.x, right.y, selector), __byte_perm(right.z, right.w, selector)};
}

// 16 pixels of a row of the frame.
__device__ uint4 LoadLuma(const std::uint8_t* row, int chunk, PixelFormat format) {
  const uint4* in = reinterpret_cast<const uint4*>(row);
  switch (format) {
    case PixelFormat::kBgr8: return LumaOfBgr(in + 3 * chunk);
    case PixelFormat::kYuyv: return LumaOfYuv(in + 2 * chunk, 0x6420);
    case PixelFormat::kUyvy: return LumaOfYuv(in + 2 * chunk, 0x7531);
    case PixelFormat::kGrey8:
    case PixelFormat::kNv12: break;
  }
  return in[chunk];
}

// A thread to 16 pixels of the rows [first_row, last_row), so that all of them are under way at once. The bands do not
// wait for one another: each only begins when the one before has asked for its pixels.
__global__ void __launch_bounds__(kIngestThreads)
    IngestKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                 int num_ranks, const std::uint8_t* frame, int first_row, int last_row) {
  const int thread = blockIdx.x * blockDim.x + threadIdx.x;
  const int chunks = (layout.width + kPixelsPerLoad - 1) / kPixelsPerLoad;
  const int y = first_row + thread / chunks;
  const int chunk = thread % chunks;
  const bool is_inside = y < last_row;
  const uint4 grey = is_inside ? LoadLuma(frame + y * layout.pitch_bytes, chunk, layout.format) : uint4{};
  LetKernelAfterBegin();
  if (first_row == 0) {
    const int num_threads = gridDim.x * blockDim.x;
    const int num_counters = sizeof(FrameCounters) / sizeof(std::int32_t) + layout.num_cells;
    std::int32_t* counters = reinterpret_cast<std::int32_t*>(buffers.counters);
    for (int i = thread; i < num_counters; i += num_threads) counters[i] = 0;
    for (int i = thread; i < num_ranks; i += num_threads) buffers.angle_counts[i] = 0;
    if (thread == 0) *buffers.params = *buffers.host_params;
  }
  if (!is_inside) return;
  reinterpret_cast<uint4*>(buffers.grey + static_cast<std::size_t>(y) * layout.grey_pitch)[chunk] = grey;
}

constexpr int kColumnGroups = 8;
constexpr int kRowGroups = 32;
constexpr int kLineThreads = kColumnGroups * kRowGroups;
constexpr int kRowsPerBlock = kLineThreads / 32;
constexpr int kFinestMaskThreads = 256;

// Dark ends of the columns: four columns to a thread, the rows shared out among kRowGroups threads.
__device__ void FindColumnEnds(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int border_threshold,
                               int block) {
  __shared__ int first[4 * kColumnGroups];
  __shared__ int last[4 * kColumnGroups];
  const int group = threadIdx.x % kColumnGroups;
  const int row_group = threadIdx.x / kColumnGroups;
  if (threadIdx.x < 4 * kColumnGroups) {
    first[threadIdx.x] = layout.height;
    last[threadIdx.x] = -1;
  }
  __syncthreads();
  const int x = 4 * (block * kColumnGroups + group);
  int my_first[4];
  int my_last[4];
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    my_first[k] = layout.height;
    my_last[k] = -1;
  }
  if (x < layout.width) {
#pragma unroll 4
    for (int y = row_group; y < layout.height; y += kRowGroups) {
      const std::uint32_t word =
          *reinterpret_cast<const std::uint32_t*>(buffers.grey + static_cast<std::size_t>(y) * layout.grey_pitch + x);
#pragma unroll
      for (int k = 0; k < 4; ++k) {
        if (static_cast<int>((word >> (8 * k)) & 255) < border_threshold) continue;
        my_first[k] = min(my_first[k], y);
        my_last[k] = max(my_last[k], y);
      }
    }
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      atomicMin(&first[4 * group + k], my_first[k]);
      atomicMax(&last[4 * group + k], my_last[k]);
    }
  }
  __syncthreads();
  const int column = 4 * block * kColumnGroups + threadIdx.x;
  if (threadIdx.x < 4 * kColumnGroups && column < layout.width) {
    buffers.column_first[column] = first[threadIdx.x];
    buffers.column_last[column] = last[threadIdx.x];
  }
}

// Dark ends of a row, by a warp; four pixels to a lane at a time.
__device__ void FindRowEnds(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int border_threshold,
                            int y) {
  if (y >= layout.height) return;
  const std::uint8_t* row = buffers.grey + static_cast<std::size_t>(y) * layout.grey_pitch;
  int first = layout.width;
  int last = -1;
#pragma unroll 4
  for (int x = 4 * (threadIdx.x % 32); x < layout.width; x += 128) {
    const std::uint32_t word = *reinterpret_cast<const std::uint32_t*>(row + x);
#pragma unroll
    for (int k = 0; k < 4; ++k) {
      if (static_cast<int>((word >> (8 * k)) & 255) < border_threshold || x + k >= layout.width) continue;
      first = min(first, x + k);
      last = max(last, x + k);
    }
  }
  first = __reduce_min_sync(0xffffffffu, first);
  last = __reduce_max_sync(0xffffffffu, last);
  if (threadIdx.x % 32 == 0) {
    buffers.row_first[y] = first;
    buffers.row_last[y] = last;
  }
}

// The first blocks do columns, the others rows.
__global__ void __launch_bounds__(kLineThreads)
    LineEndsKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                   int border_threshold, int num_column_blocks) {
  const int block = blockIdx.x;
  if (block < num_column_blocks) {
    FindColumnEnds(layout, buffers, border_threshold, block);
  } else {
    FindRowEnds(layout, buffers, border_threshold,
                (block - num_column_blocks) * kRowsPerBlock + static_cast<int>(threadIdx.x) / 32);
  }
}

// The lowest `count` bits; count at most 32, or below 0 for none.
__device__ __forceinline__ std::uint32_t LowBits(int count) {
  return count >= 32 ? 0xffffffffu : (1u << max(count, 0)) - 1;
}

// A bit for each of 32 pixels of a row: whether it is at least `threshold`, in [0, 256]. Of pixels that are not there,
// anything.
__device__ __forceinline__ std::uint32_t AtLeast(const std::uint8_t* row, int x, int width, int threshold) {
  const std::uint32_t to_carry = static_cast<std::uint32_t>(256 - threshold) * 0x10001u;
  std::uint32_t bits = 0;
#pragma unroll
  for (int piece = 0; piece < 2; ++piece) {
    // Rows are written in pieces of 16 pixels.
    if (x + 16 * piece >= width) continue;
    const uint4 pixels = *reinterpret_cast<const uint4*>(row + x + 16 * piece);
    const std::uint32_t words[4] = {pixels.x, pixels.y, pixels.z, pixels.w};
#pragma unroll
    for (int w = 0; w < 4; ++w) {
      // Sums of 16 bits carry into bit 8: pixels 0 and 2, then 1 and 3.
      const std::uint32_t even = (words[w] & 0x00ff00ffu) + to_carry;
      const std::uint32_t odd = (words[w] >> 8 & 0x00ff00ffu) + to_carry;
      const std::uint32_t two = (even >> 8 & 0x00010001u) | (odd >> 7 & 0x00020002u);
      bits |= ((two | two >> 14) & 15u) << (16 * piece + 4 * w);
    }
  }
  return bits;
}

// A warp to a word of 32 rows, a lane to each: what it needs of the columns is the same for all lanes.
__global__ void __launch_bounds__(kFinestMaskThreads)
    FinestMaskKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractSettings settings,
                     const __grid_constant__ ExtractBuffers buffers) {
  WaitForKernelBefore();
  const int warp = (blockIdx.x * kFinestMaskThreads + threadIdx.x) / 32;
  const int words = layout.masks[0].words;
  const int y = warp / words * 32 + threadIdx.x % 32;
  if (y >= layout.height) return;
  const int x = warp % words * 32;
  // All pixels between an excluded one and one of the four edges are dark.
  std::uint32_t excluded = LowBits(buffers.row_first[y] - x) | ~LowBits(buffers.row_last[y] + 1 - x);
#pragma unroll
  for (int k = 0; k < 32; ++k) {
    const int column = min(x + k, layout.width - 1);
    const bool is_dark = y < buffers.column_first[column] || y > buffers.column_last[column];
    excluded |= is_dark ? 1u << k : 0u;
  }
  const std::size_t row = static_cast<std::size_t>(y) * layout.grey_pitch;
  excluded |= AtLeast(buffers.grey + row, x, layout.width, settings.reflection_threshold);
  if (settings.has_static_mask) excluded |= ~AtLeast(buffers.static_mask + row, x, layout.width, 1);
  buffers.mask_bits[y * words + x / 32] = excluded & LowBits(layout.width - x);
}

// A warp to a word of the masks of octaves 1 and up: lane i makes pixel i from its square of the finest mask.
__global__ void __launch_bounds__(256)
    CoarseMasksKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                      int num_octaves) {
  WaitForKernelBefore();
  int word_index = (blockIdx.x * blockDim.x + threadIdx.x) / 32;
  int octave = 1;
  for (; octave < num_octaves; ++octave) {
    const int num_words = layout.masks[octave].num_words;
    if (word_index < num_words) break;
    word_index -= num_words;
  }
  if (octave >= num_octaves) return;
  const MaskLayout& mask = layout.masks[octave];
  const MaskLayout& finest = layout.masks[0];
  const int x = (word_index % mask.words * 32 + threadIdx.x % 32) << octave;
  const int y = word_index / mask.words << octave;
  std::uint32_t any = 0;
  if (x < finest.width) {
    const int side = 1 << octave;
    const int first_word = x / 32;
    const int last_word = min((x + side - 1) / 32, finest.words - 1);
    const std::uint32_t bits = side < 32 ? ((1u << side) - 1) << (x % 32) : 0xffffffffu;
    for (int word = first_word; word <= last_word; ++word) {
      const std::uint32_t* at = buffers.mask_bits + word;
      // Without a way out early, so that the loads do not wait for one another.
#pragma unroll 16
      for (int row = y; row < min(y + side, finest.height); ++row) {
        any |= __ldg(at + static_cast<std::ptrdiff_t>(row) * finest.words) & bits;
      }
    }
  }
  const std::uint32_t bits = __ballot_sync(0xffffffffu, any != 0);
  if (threadIdx.x % 32 == 0) buffers.mask_bits[mask.first_word + word_index] = bits;
}

// A thread to a word of a dilated mask: by slots of octaves, num_slots of them.
__global__ void __launch_bounds__(256)
    DilateMasksKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                      int dilation_px, int num_slots) {
  WaitForKernelBefore();
  const int index = blockIdx.x * blockDim.x + threadIdx.x;
  int word_index = index;
  int slot = 0;
  for (; slot < num_slots; ++slot) {
    const int num_words = layout.masks[max(slot - 1, 0)].num_words;
    if (word_index < num_words) break;
    word_index -= num_words;
  }
  if (slot >= num_slots) return;
  const MaskLayout& mask = layout.masks[max(slot - 1, 0)];
  const int reach = slot == 0 ? (dilation_px + 1) / 2 : dilation_px;
  const int word = word_index % mask.words;
  const int y = word_index / mask.words;
  const int first_row = max(y - reach, 0);
  const int last_row = min(y + reach, mask.height - 1);
  const auto word_at = [&](int k) {
    std::uint32_t any = 0;
    if (word + k < 0 || word + k >= mask.words) return any;
    const std::uint32_t* column = buffers.mask_bits + mask.first_word + word + k;
#pragma unroll 4
    for (int row = first_row; row <= last_row; ++row) any |= column[row * mask.words];
    return any;
  };
  buffers.dilated_bits[index] = DilatedWord(reach, word_at);
}

int Blocks(int count, int per_block) { return (count + per_block - 1) / per_block; }

}  // namespace

cudaError_t CanLaunchEarly(bool* can) {
  cudaFuncAttributes attributes{};
  const cudaError_t error = cudaFuncGetAttributes(&attributes, IngestKernel);
  *can = error == cudaSuccess && attributes.ptxVersion >= 90;
  return error;
}

cudaError_t LaunchIngest(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                         const std::uint8_t* frame, const RowRange& rows, cudaStream_t stream) {
  // At least one block: the first band has more to do than its rows, of which a flat picture may have none.
  const int num_chunks = std::max(Blocks(layout.width, kPixelsPerLoad) * (rows.end - rows.begin), 1);
  return LaunchAfter(settings.can_launch_early && rows.begin > 0, IngestKernel, Blocks(num_chunks, kIngestThreads),
                     kIngestThreads, 0, stream, layout, buffers, settings.num_features, frame, rows.begin, rows.end);
}

cudaError_t SetFrameOfIngest(cudaGraphExec_t graph, cudaGraphNode_t node, const std::uint8_t* frame) {
  cudaKernelNodeParams params{};
  if (const cudaError_t error = cudaGraphKernelNodeGetParams(node, &params); error != cudaSuccess) return error;
  void* arguments[] = {params.kernelParams[0], params.kernelParams[1], params.kernelParams[2], &frame,
                       params.kernelParams[4], params.kernelParams[5]};
  params.kernelParams = arguments;
  return cudaGraphExecKernelNodeSetParams(graph, node, &params);
}

cudaError_t LaunchMasks(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                        cudaStream_t stream) {
  const int num_column_blocks = Blocks(layout.width, 4 * kColumnGroups);
  // Each kernel waits for the one before as a whole, so the last one may read what the first one wrote.
  LineEndsKernel<<<num_column_blocks + Blocks(layout.height, kRowsPerBlock), kLineThreads, 0, stream>>>(
      layout, buffers, settings.border_threshold, num_column_blocks);
  cudaError_t error = cudaGetLastError();
  const bool early = settings.can_launch_early != 0;
  const int num_finest_words = layout.masks[0].num_words;
  if (error == cudaSuccess) {
    const int num_warps = layout.masks[0].words * Blocks(layout.height, 32);
    error = LaunchAfter(early, FinestMaskKernel, Blocks(32 * num_warps, kFinestMaskThreads), kFinestMaskThreads, 0,
                        stream, layout, settings, buffers);
  }
  // Masks for the octaves that there are.
  const int num_octaves = layout.num_octaves + kFirstOctave;
  int num_coarse_words = 0;
  for (int octave = 1; octave < num_octaves; ++octave) num_coarse_words += layout.masks[octave].num_words;
  if (error == cudaSuccess && num_coarse_words > 0) {
    error = LaunchAfter(early, CoarseMasksKernel, Blocks(num_coarse_words, 8), 256, 0, stream, layout, buffers,
                        num_octaves);
  }
  if (error != cudaSuccess) return error;
  return LaunchAfter(early, DilateMasksKernel, Blocks(2 * num_finest_words + num_coarse_words, 256), 256, 0, stream,
                     layout, buffers, settings.mask_dilation_px, layout.num_octaves);
}

}  // namespace haustra::kernels::cuda
