// Gaussian images of all octaves, and the extrema of their differences.
//
// All levels of an octave are made at once, tile by tile, each from the same source: octaves -1 and 0 from the grey
// image, the others from their level 0. Blur is two products with band matrices (band_weights.h) on tensor cores, first
// down the columns, then along the rows; the results of the first are operands of the second without leaving their
// registers. The differences of a tile are searched for extrema while it is in shared memory.
//
// A byte b is a half-precision operand as it is: 0x00bb is b * 2^-24. Values of 16 bits are two operands, high and low
// byte, and sums are taken in float, so nothing is lost but a rounding to 16 bits after each of the two products.
#include <climits>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/plane_value.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kTileThreads = 256;
// A tile as it is computed: 64 x 64 pixels, two to a word; the outer two on each side belong to the neighbours.
constexpr int kSide = 64;
constexpr int kBorder = (kSide - kOctaveTilePx) / 2;
constexpr int kWords = kSide / 2;
constexpr int kLevelWords = kSide * kWords;
static_assert(kBorder == 2);

// What a sum of products is to be multiplied by: bytes are times 2^-24, weights for high bytes, which count as 2^8,
// times kBandScale.
constexpr float kUnitsPerSum = 16777216.0f * 256.0f / kBandScale;

__device__ __forceinline__ int Clamp(int v, int low, int high) { return min(max(v, low), high); }

template <BandSource kSource>
struct SourceTile {
  static constexpr bool kIsGrey = kSource != BandSource::kPlane;  // bytes, else 16-bit counts
  static constexpr int kMargin = BandMargin(kSource);
  static constexpr int kSteps = BandSteps(kSource);
  static constexpr int kPixelsPer16 = kSource == BandSource::kEnlargedGrey ? 8 : 16;  // source pixels for 16 of a level
  static constexpr int kSize = kSide / 16 * kPixelsPer16 + 2 * kMargin;
  // Rows of 16-byte pieces, an odd number of them: eight rows meet in no bank.
  static constexpr int kPitch = (kSize / 8 | 1) * 8;
};

// Fetches a word of each kRowGroups-th row from first_y + group on, kRows in all, many at once, and hands it over with
// the number of its row; rows outside are as the first or the last one.
template <int kRows, int kRowGroups, typename Word, typename Pixel, typename Put>
__device__ __forceinline__ void FetchRows(const Pixel* __restrict__ pixels, int height, int pitch, int first_y,
                                          int group, int word, const Put& put) {
  constexpr int kCount = (kRows + kRowGroups - 1) / kRowGroups;
  constexpr int kAtOnce = kCount <= 12 ? kCount : (kCount + 1) / 2;
#pragma unroll
  for (int first = 0; first < kCount; first += kAtOnce) {
    Word words[kAtOnce];
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      const int y = Clamp(first_y + group + (first + k) * kRowGroups, 0, height - 1);
      words[k] = __ldg(reinterpret_cast<const Word*>(pixels + static_cast<std::ptrdiff_t>(y) * pitch) + word);
    }
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) put(group + (first + k) * kRowGroups, words[k]);
  }
}

// Four bits for each of kCount pixels from x on: which one it is of those from first_pixel on, where pixels outside are
// as the edge.
template <int kCount>
__device__ __forceinline__ std::uint32_t SelectPixels(int x, int width, int first_pixel) {
  std::uint32_t selector = 0;
#pragma unroll
  for (int i = 0; i < kCount; ++i) selector |= (Clamp(x + i, 0, width - 1) - first_pixel & 7) << 4 * i;
  return selector;
}

// The source of a tile, a pixel to half a word, from pixel (first_x, first_y) on. Grey images are read in words of four
// pixels, and a lane makes four pixels out of two of those.
template <BandSource kSource>
__device__ __forceinline__ void LoadSource(const std::uint8_t* source, int width, int height, int pitch, int first_x,
                                           int first_y, std::uint32_t* tile) {
  using Tile = SourceTile<kSource>;
  constexpr int kLanes = Tile::kSize / 4 < 16 ? 16 : 32;  // of a row
  static_assert(Tile::kSize % 4 == 0 && Tile::kSize / 4 < kLanes);
  const int lane = threadIdx.x % kLanes;
  const int x = first_x + 4 * lane;
  const int word = Clamp(x >> 2, 0, (width - 1) >> 2);
  const std::uint32_t selector = SelectPixels<4>(x, width, 4 * word);
  FetchRows<Tile::kSize, kTileThreads / kLanes, std::uint32_t>(
      source, height, pitch, first_y, threadIdx.x / kLanes, word, [&](int row, std::uint32_t mine) {
        const std::uint32_t four = __byte_perm(mine, __shfl_down_sync(0xffffffffu, mine, 1, kLanes), selector);
        if (lane >= Tile::kSize / 4 || row >= Tile::kSize) return;
        *reinterpret_cast<uint2*>(tile + row * (Tile::kPitch / 2) + 2 * lane) =
            make_uint2(__byte_perm(four, 0, 0x4140), __byte_perm(four, 0, 0x4342));
      });
}

// Planes are read in words of two pixels; first_x is even.
template <BandSource kSource>
__device__ __forceinline__ void LoadSource(const PlaneValue* source, int width, int height, int pitch, int first_x,
                                           int first_y, std::uint32_t* tile) {
  using Tile = SourceTile<kSource>;
  constexpr int kPairs = Tile::kSize / 2;
  constexpr int kRowGroups = kTileThreads / kPairs;
  const int pair = threadIdx.x % kPairs;
  const int group = threadIdx.x / kPairs;
  if (group >= kRowGroups) return;
  const int x = first_x + 2 * pair;
  const int word = Clamp(x >> 1, 0, (width - 1) >> 1);
  const std::uint32_t which = SelectPixels<2>(x, width, 2 * word);
  const std::uint32_t selector = (which & 1) * 0x22u + (which >> 4) * 0x2200u + 0x1010u;  // of bytes
  FetchRows<Tile::kSize, kRowGroups, std::uint32_t>(
      source, height, pitch, first_y, group, word, [&](int row, std::uint32_t two) {
        if (row < Tile::kSize) tile[row * (Tile::kPitch / 2) + pair] = __byte_perm(two, 0, selector);
      });
}

__device__ __forceinline__ void LoadMatrices(std::uint32_t (&r)[4], std::uint32_t address) {
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(r[0]), "=r"(r[1]), "=r"(r[2]), "=r"(r[3])
               : "r"(address));
}

__device__ __forceinline__ void MultiplyAdd(float (&sum)[4], const std::uint32_t (&a)[4], std::uint32_t b0,
                                            std::uint32_t b1) {
  asm volatile(
      "mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, "
      "{%0, %1, %2, %3};"
      : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
}

// Weights for low bytes: those for high bytes by 256, exactly.
__device__ __forceinline__ std::uint32_t By256(std::uint32_t two) {
  constexpr std::uint32_t kTwoFractions = 0x1c001c00u;  // 1 / 256 as a half-precision float
  std::uint32_t result;
  asm("mul.f16x2 %0, %1, %2;" : "=r"(result) : "r"(two), "r"(kTwoFractions));
  return result;
}

// Fragments of the weights of a level, for high bytes. `weights`: the level's first one of the lane; those of its
// columns and of the next level lie at a fixed distance.
constexpr int kNextLevel = kMaxBandSteps * 32;
constexpr int kColumnsBehindRows = kNumLevels * kNextLevel;
static_assert(offsetof(BandWeights, columns) == kColumnsBehindRows * sizeof(BandFragment));
template <int kSteps>
__device__ __forceinline__ void LoadFragments(const BandFragment* weights, std::uint32_t (&fragments)[kSteps][4]) {
#pragma unroll
  for (int step = 0; step < kSteps; ++step) {
    const uint4 words = __ldg(reinterpret_cast<const uint4*>(weights + 32 * step));
    fragments[step][0] = words.x;
    fragments[step][1] = words.y;
    fragments[step][2] = words.z;
    fragments[step][3] = words.w;
  }
}

// Operands of the second product from eight columns of results of the first.
struct Piece {
  std::uint32_t high[2];
  std::uint32_t low[2];
};

// The word of a level that holds columns 2 * word and 2 * word + 1 of a row. Words 1 and 2 lie side by side, as do 3
// and 4, up to 31 and 0: the search takes two at once, and those inside the border lie so in the planes. Pairs change
// places with the row, so that neither the eight rows of a fragment nor the words of a row meet in a bank.
__device__ __forceinline__ int WordAt(int row, int word) {
  return row * kWords + ((word + kWords - 1) % kWords ^ (row & 7) << 2);
}

// Two counts below 2^16 of a level, rounded, as its word. The bits of the later one's float are those of a count less
// what the other's exponent adds to it. (A byte permutation would do, but that pipe has more to do than the others.)
__device__ __forceinline__ std::uint32_t ToWord(float sum, float later_sum, float factor) {
  constexpr float kLaterBase = kIntegerBase + 65536.0f - (kIntegerBaseBits >> 16);
  std::uint32_t word;
  asm("mad.lo.u32 %0, %1, 65536, %2;"
      : "=r"(word)
      : "r"(__float_as_uint(fmaf(later_sum, factor, kLaterBase))),
        "r"(__float_as_uint(fmaf(sum, factor, kIntegerBase))));
  return word;
}

// Whether the last level takes the place of the source, for which there would be too little room beside it.
template <BandSource kSource>
constexpr bool kIsSourceReplaced = SourceTile<kSource>::kSteps == kMaxBandSteps;

// All levels of a tile, from its source in `tile`, into `shared`. A warp makes 16 rows and kBlocks times 16 columns.
// weights: the first ones of the lane; rows: those of level 0, loaded.
template <BandSource kSource>
__device__ __forceinline__ void MakeLevels(const BandFragment* weights,
                                           std::uint32_t (&rows)[SourceTile<kSource>::kSteps][4],
                                           const std::uint32_t* tile, std::uint32_t* shared) {
  using Tile = SourceTile<kSource>;
  constexpr int kSteps = Tile::kSteps;
  constexpr int kPiecesPer16 = Tile::kPixelsPer16 / 8;
  constexpr int kBlocks = 16 * 32 / kTileThreads;
  constexpr int kWarpsPerStrip = 4 / kBlocks;
  // An operand is two pieces in registers next to each other: no piece is the first of one and the second of another.
  constexpr int kBlockStride = kPiecesPer16 == 1 ? 2 : 1;
  constexpr int kPieceStride = kBlockStride * kPiecesPer16;
  constexpr int kNumPieces = 2 * kSteps + (kBlocks - 1) * kPieceStride;
  static_assert(kPieceStride == 2 && kBlocks == 2);
  const int lane = threadIdx.x % 32;
  const int strip = threadIdx.x / 32 / kWarpsPerStrip;
  const int first_block = threadIdx.x / 32 % kWarpsPerStrip * (kBlockStride == 2 ? 1 : kBlocks);

  const std::uint32_t first = static_cast<std::uint32_t>(__cvta_generic_to_shared(tile)) +
                              2 * (strip * Tile::kPixelsPer16 * Tile::kPitch + first_block * Tile::kPixelsPer16);
  int places[kBlocks][2];
#pragma unroll
  for (int i = 0; i < 2 * kBlocks; ++i) {
    places[i / 2][i % 2] =
        WordAt(16 * strip + lane / 4, 8 * (first_block + i / 2 * kBlockStride) + 4 * (i % 2) + lane % 4);
  }
#pragma unroll 1
  for (int level = 0; level < kNumLevels; ++level) {
    std::uint32_t columns[kSteps][4];
    LoadFragments(weights + kColumnsBehindRows, columns);
    Piece pieces[kNumPieces];
    std::uint32_t rest[4];  // of two pieces
#pragma unroll
    for (int p = 0; p < kNumPieces; ++p) {
      std::uint32_t source[2 * kMaxBandSteps];
      std::uint32_t r[4];
      LoadMatrices(r, first + 2 * (lane * Tile::kPitch + 8 * p));
#pragma unroll
      for (int i = 0; i < 4; ++i) source[i] = r[i];
      if constexpr (kSteps == 3) {
        static_assert(kNumPieces % 2 == 0);
        if (p % 2 == 0) LoadMatrices(rest, first + 2 * ((32 + lane % 16) * Tile::kPitch + 8 * (p + lane / 16)));
        source[4] = rest[p % 2 * 2];
        source[5] = rest[p % 2 * 2 + 1];
      }
      float sum[4] = {};
#pragma unroll
      for (int step = 0; step < kSteps; ++step) {
        const std::uint32_t b0 = source[2 * step];
        const std::uint32_t b1 = source[2 * step + 1];
        if constexpr (Tile::kIsGrey) {
          MultiplyAdd(sum, rows[step], b0, b1);
        } else {
          MultiplyAdd(sum, rows[step], __byte_perm(b0, 0, 0x4341), __byte_perm(b1, 0, 0x4341));
          std::uint32_t low[4];
#pragma unroll
          for (int i = 0; i < 4; ++i) low[i] = By256(rows[step][i]);
          MultiplyAdd(sum, low, __byte_perm(b0, 0, 0x4240), __byte_perm(b1, 0, 0x4240));
        }
      }
      // Of grey images in units of 1/256 grey level: below 2^16, so that byte 2 of the float's bits is zero.
      std::uint32_t bits[4];
#pragma unroll
      for (int i = 0; i < 4; ++i) bits[i] = __float_as_uint(fmaf(sum[i], kUnitsPerSum, kIntegerBase));
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        pieces[p].high[i] = __byte_perm(bits[2 * i], bits[2 * i + 1], 0x6521);
        pieces[p].low[i] = __byte_perm(bits[2 * i], bits[2 * i + 1], 0x6420);
      }
    }
    std::uint32_t words[kBlocks][2][2] = {};
    const auto write = [&](int block, int n) {
      std::uint32_t* out = shared + level * kLevelWords + places[block][n];
      out[0] = words[block][n][0];
      out[8 * kWords] = words[block][n][1];
    };
#pragma unroll
    for (int n = 0; n < 2; ++n) {
      if (n == 1) {
        weights += kNextLevel;  // behind the last level are other weights, which are not used
        LoadFragments(weights, rows);
      }
      std::uint32_t low[kSteps][2];
#pragma unroll
      for (int i = 0; i < 2 * kSteps; ++i) low[i / 2][i % 2] = By256(columns[i / 2][2 * n + i % 2]);
#pragma unroll
      for (int block = 0; block < kBlocks; ++block) {
        float sum[4] = {};
#pragma unroll
        for (int step = 0; step < kSteps; ++step) {
          const Piece& left = pieces[block * kPieceStride + 2 * step];
          const Piece& right = pieces[block * kPieceStride + 2 * step + 1];
          MultiplyAdd(sum, {left.high[0], left.high[1], right.high[0], right.high[1]}, columns[step][2 * n],
                      columns[step][2 * n + 1]);
          MultiplyAdd(sum, {left.low[0], left.low[1], right.low[0], right.low[1]}, low[step][0], low[step][1]);
        }
        constexpr float kFactor = kUnitsPerSum * (Tile::kIsGrey ? kCountsPerGrey / 256 : 1.0f);
        words[block][n][0] = ToWord(sum[0], sum[1], kFactor);
        words[block][n][1] = ToWord(sum[2], sum[3], kFactor);
        if (!kIsSourceReplaced<kSource>) write(block, n);
      }
    }
    if (kIsSourceReplaced<kSource>) {
      if (level == kNumLevels - 1) __syncthreads();
#pragma unroll
      for (int i = 0; i < 2 * kBlocks; ++i) write(i / 2, i % 2);
    }
  }
}

// Differences are searched two to a word, on top of a base that makes them positive half-precision floats, whose order
// is that of their bits. (A difference is at most a fifth of the range, by the kernels.)
constexpr std::uint32_t kDifferenceBase = 15872;
constexpr std::uint32_t kTwoBases = kDifferenceBase << 16 | kDifferenceBase;

// Of both halves.
__device__ __forceinline__ std::uint32_t Max(std::uint32_t a, std::uint32_t b) {
  std::uint32_t result;
  asm("max.f16x2 %0, %1, %2;" : "=r"(result) : "r"(a), "r"(b));
  return result;
}
__device__ __forceinline__ std::uint32_t Min(std::uint32_t a, std::uint32_t b) {
  std::uint32_t result;
  asm("min.f16x2 %0, %1, %2;" : "=r"(result) : "r"(a), "r"(b));
  return result;
}
__device__ __forceinline__ std::uint32_t Max(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  return Max(Max(a, b), c);
}
__device__ __forceinline__ std::uint32_t Min(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  return Min(Min(a, b), c);
}
// 1 as a half-precision float in each half where they are equal, else 0.
__device__ __forceinline__ std::uint32_t AreEqual(std::uint32_t a, std::uint32_t b) {
  std::uint32_t result;
  asm("set.eq.f16x2.f16x2 %0, %1, %2;" : "=r"(result) : "r"(a), "r"(b));
  return result;
}

// Whether a pixel of a tile is an extremum among its 26 neighbours in difference `d` (between levels d and d + 1) and
// the ones next to it. Of two equal neighbours only the first counts.
__device__ __forceinline__ bool IsExtremum(const std::uint32_t* shared, int d, int row, int column) {
  int here = 0;
  // Of the neighbours that come before, and of the others.
  int high[2] = {INT_MIN, INT_MIN};
  int low[2] = {INT_MAX, INT_MAX};
#pragma unroll
  for (int r = -1; r <= 1; ++r) {
#pragma unroll
    for (int c = -1; c <= 1; ++c) {
      const std::uint32_t* word = shared + (d - 1) * kLevelWords + WordAt(row + r, (column + c) / 2);
      const PlaneValue* at = reinterpret_cast<const PlaneValue*>(word) + (column + c) % 2;
      int counts[4];
#pragma unroll
      for (int level = 0; level < 4; ++level) counts[level] = at[2 * kLevelWords * level];
#pragma unroll
      for (int i = 0; i < 3; ++i) {
        const int difference = counts[i + 1] - counts[i];
        const int is_after = (9 * i + 3 * (r + 1) + c + 1) > 13 ? 1 : 0;
        if (i == 1 && r == 0 && c == 0) {
          here = difference;
        } else {
          high[is_after] = max(high[is_after], difference);
          low[is_after] = min(low[is_after], difference);
        }
      }
    }
  }
  return here > 0 ? here > high[0] && here >= high[1] : here < low[0] && here <= low[1];
}

// Half a warp goes through a strip of rows, a lane through four columns of it.
constexpr int kLanesPerRow = 16;
constexpr int kStripRows = 4;
constexpr int kNumStrips = kOctaveTilePx / kStripRows;
static_assert(kNumStrips * kStripRows == kOctaveTilePx && kNumStrips <= kTileThreads / kLanesPerRow);
// What a lane finds: for each row, difference and pair of columns a bit in each half of a word, from those where 1 as a
// half-precision float has bits down.
constexpr std::uint32_t kFindBits = 0x04000400u;
constexpr int kFindsPerRow = 2 * kScalesPerOctave;  // of a half
constexpr int kFirstFindBit = 10;
constexpr int kRowsPerWord = 2;
constexpr int kLastFindBit = kFirstFindBit - (kRowsPerWord - 1) * kFindsPerRow;
static_assert(kFirstFindBit + kFindsPerRow == 16 && kLastFindBit >= 0 && kStripRows == 2 * kRowsPerWord);

// What the extrema of a tile are written down as.
__device__ __forceinline__ std::uint16_t Code(int level, int row, int column) {
  return static_cast<std::uint16_t>(level << 12 | row << 6 | column);
}
struct ExtremaCounts {
  int num_found;
  int first_output;
};
// They lie behind the levels.
__device__ __forceinline__ std::uint16_t* ExtremaOf(std::uint32_t* shared) {
  return reinterpret_cast<std::uint16_t*>(shared + kNumLevels * kLevelWords);
}

struct TilePlace {
  int first_x;  // of the tile with its border
  int first_y;
  int width;  // of the octave
  int height;
};

// To global memory. (From a pointer the compiler would work out every address anew, beginning with the thread's
// number.)
__device__ __forceinline__ void WriteWords(std::uint64_t address, uint2 words) {
  asm volatile("st.global.v2.b32 [%0], {%1, %2};" ::"l"(address), "r"(words.x), "r"(words.y) : "memory");
}

// Goes through the rows of a tile: half a warp to some of them, a lane to four columns. Finds pixels that none of their
// eight neighbours in the picture nor their two in scale surpasses, and on the way, if `writes`, writes the levels from
// kFirstWritten on to `planes`. Returns the finds of the lane, the first rows in the lower word.
template <int kFirstWritten>
__device__ __forceinline__ std::uint64_t SearchRows(const std::uint32_t* shared, const TilePlace& place, int threshold,
                                                    bool writes, PlaneValue* planes, int stride,
                                                    std::size_t plane_size) {
  const int lane = threadIdx.x % 32;
  const int column = threadIdx.x % kLanesPerRow;
  const int strip = min(static_cast<int>(threadIdx.x) / kLanesPerRow, kNumStrips - 1);
  // Neither of the border, which is the last lane's, nor in the half warp that is left over.
  const bool is_inside = column < kLanesPerRow - 1 && threadIdx.x / kLanesPerRow < kNumStrips;
  const int left_lane = (lane & kLanesPerRow) | ((lane - 1) & (kLanesPerRow - 1));
  const std::uint32_t lowest_maximum = (kDifferenceBase + threshold) * 0x10001u;
  const std::uint32_t highest_minimum = (kDifferenceBase - threshold) * 0x10001u;
  const int x = place.first_x + kBorder + 4 * column;
  const int y = place.first_y + kBorder + kStripRows * strip;
  const int num_written = writes && is_inside && x < place.width ? place.height - y : 0;  // rows, and more
  std::uint64_t written = __cvta_generic_to_global(planes + static_cast<std::ptrdiff_t>(y) * stride + x);
  asm volatile("" : "+l"(written));
  // WordAt for the lane's first word in row 4 * strip + j, with little to do for each j.
  const std::uint32_t* first_row = shared + kStripRows * strip * kWords;
  const int first_word = 2 * column ^ (strip & 1) << 4;
  static_assert(kStripRows == 4 && kBorder == 2);
  std::uint32_t result[2] = {};
  // Of differences 1 to kScalesPerOctave, of the row at hand and the one before: the highest of three columns, the
  // highest of these and all around them but the row after, and what they are compared with.
  std::uint32_t highest[2][kScalesPerOctave][2];
  std::uint32_t lowest[2][kScalesPerOctave][2];
  std::uint32_t top[2][kScalesPerOctave][2];
  std::uint32_t bottom[2][kScalesPerOctave][2];
  std::uint32_t centre[2][kScalesPerOctave][2];
#pragma unroll
  for (int k = 0; k < kStripRows + 2; ++k) {
    const bool is_of_strip = k > 0 && k < kStripRows + 1;
    const int j = kBorder - 1 + k;
    uint2 values[kNumLevels];
    const std::uint32_t* words = first_row + (first_word ^ j << 2);
#pragma unroll
    for (int level = 0; level < kNumLevels; ++level) {
      if (!is_of_strip && (level == 0 || level == kNumLevels - 1)) continue;
      values[level] = *reinterpret_cast<const uint2*>(words + j * kWords + level * kLevelWords);
    }
    if (is_of_strip) {
      if (k - 1 < num_written) {
        std::uint64_t at = written + (kFirstWritten * 2) * plane_size;
#pragma unroll
        for (int level = kFirstWritten; level < kNumLevels; ++level) {
          WriteWords(at, values[level]);
          at += 2 * plane_size;
        }
      }
      written += 2 * static_cast<std::int64_t>(stride);
    }
    std::uint32_t differences[kScalesPerOctave + 2][2];
#pragma unroll
    for (int d = 0; d < kScalesPerOctave + 2; ++d) {
      if (!is_of_strip && (d == 0 || d == kScalesPerOctave + 1)) continue;
      differences[d][0] = values[d + 1].x - values[d].x + kTwoBases;
      differences[d][1] = values[d + 1].y - values[d].y + kTwoBases;
    }
    const int now = k % 2;
    const int before = (k + 1) % 2;
    std::uint32_t found[2] = {};
#pragma unroll
    for (int i = 0; i < kScalesPerOctave; ++i) {
      const std::uint32_t* here = differences[i + 1];
      const std::uint32_t left = __byte_perm(__shfl_sync(0xffffffffu, here[1], left_lane), here[0], 0x5432);
      const std::uint32_t middle = __byte_perm(here[0], here[1], 0x5432);
      const std::uint32_t right = __byte_perm(here[1], __shfl_down_sync(0xffffffffu, here[0], 1, kLanesPerRow), 0x5432);
      highest[now][i][0] = Max(left, middle, here[0]);
      highest[now][i][1] = Max(middle, right, here[1]);
      lowest[now][i][0] = Min(left, middle, here[0]);
      lowest[now][i][1] = Min(middle, right, here[1]);
#pragma unroll
      for (int w = 0; w < 2; ++w) {
        if (k >= 2) {
          found[w] |= (AreEqual(centre[before][i][w], Max(top[before][i][w], highest[now][i][w])) |
                       AreEqual(centre[before][i][w], Min(bottom[before][i][w], lowest[now][i][w]))) &
                      kFindBits << i;
        }
        if (is_of_strip) {
          centre[now][i][w] = here[w];
          top[now][i][w] = Max(highest[before][i][w], highest[now][i][w],
                               Max(differences[i][w], differences[i + 2][w], lowest_maximum));
          bottom[now][i][w] = Min(lowest[before][i][w], lowest[now][i][w],
                                  Min(differences[i][w], differences[i + 2][w], highest_minimum));
        }
      }
    }
    if (k < 2) continue;
    const std::uint32_t finds = found[0] | found[1] << kScalesPerOctave;
    result[(k - 2) / kRowsPerWord] |= finds >> (k - 2) % kRowsPerWord * kFindsPerRow;
  }
  return is_inside ? static_cast<std::uint64_t>(result[1]) << 32 | result[0] : 0;
}

// Looks at what a lane of the search found.
__device__ __forceinline__ void Examine(std::uint32_t* shared, const TilePlace& place, std::uint64_t found,
                                        ExtremaCounts& counts) {
  const int strip = threadIdx.x / kLanesPerRow;
  const int first_column = kBorder + 4 * (threadIdx.x % kLanesPerRow);
#pragma unroll 1
  for (; found != 0; found &= found - 1) {
    const int bit = __ffsll(static_cast<long long>(found)) - 1;
    const int of_half = (bit & 15) - kLastFindBit;
    const bool is_first_row = of_half >= kFindsPerRow;
    const int of_row = is_first_row ? of_half - kFindsPerRow : of_half;
    const bool is_first_pair = of_row < kScalesPerOctave;
    const int level = (is_first_pair ? of_row : of_row - kScalesPerOctave) + 1;
    const int row = kBorder + kStripRows * strip + bit / 32 * kRowsPerWord + (is_first_row ? 0 : 1);
    const int column = first_column + (is_first_pair ? 0 : 2) + (bit >> 4 & 1);
    const int x = place.first_x + column;
    const int y = place.first_y + row;
    if (x < kEdgeMarginPx || x >= place.width - kEdgeMarginPx || y < kEdgeMarginPx ||
        y >= place.height - kEdgeMarginPx || !IsExtremum(shared, level, row, column)) {
      continue;
    }
    const int at = atomicAdd(&counts.num_found, 1);
    if (at < kMaxExtremaPerTile) ExtremaOf(shared)[at] = Code(level, row, column);
  }
}

// Extrema of a tile whose levels are in `shared`. counts.num_found is 0.
template <int kFirstWritten>
__device__ __forceinline__ void FindExtrema(std::uint32_t* shared, const ExtractBuffers& buffers,
                                            const OctaveLayout& octave, int slot, const TilePlace& place,
                                            int lowest_threshold, ExtremaCounts& counts) {
  PlaneValue* planes = buffers.planes + octave.first_value;
  // When there are more than room for, again with a higher threshold: the weakest are left out.
#pragma unroll 1
  for (int threshold = lowest_threshold;; threshold += threshold / 4 + 1) {
    const std::uint64_t found = SearchRows<kFirstWritten>(shared, place, threshold, threshold == lowest_threshold,
                                                          planes, octave.stride, octave.plane_size);
    Examine(shared, place, found, counts);
    __syncthreads();
    if (counts.num_found <= kMaxExtremaPerTile) break;
    __syncthreads();
    if (threadIdx.x == 0) counts.num_found = 0;
    __syncthreads();
  }
  const int num_found = counts.num_found;
  if (num_found == 0) return;
  if (threadIdx.x == 0) counts.first_output = atomicAdd(&buffers.counters->num_extrema, num_found);
  __syncthreads();
  for (int i = threadIdx.x; i < num_found; i += kTileThreads) {
    const int code = ExtremaOf(shared)[i];
    const int x = place.first_x + (code & 63);
    const int y = place.first_y + (code >> 6 & 63);
    buffers.extrema[counts.first_output + i] =
        make_uint2(static_cast<std::uint32_t>(x) | static_cast<std::uint32_t>(y) << 16,
                   static_cast<std::uint32_t>(code >> 12 | slot << 8));
  }
}

// Levels, then the extrema. The source lies where those and, if it is large, the last level will.
template <BandSource kSource>
constexpr int kFirstSourceWord = (kNumLevels - (kIsSourceReplaced<kSource> ? 1 : 0)) * kLevelWords;
template <BandSource kSource>
constexpr int SharedBytes() {
  using Tile = SourceTile<kSource>;
  constexpr int kWithSource = kFirstSourceWord<kSource> * 4 + Tile::kSize * Tile::kPitch * 2;
  constexpr int kWithExtrema = kNumLevels * kLevelWords * 4 + kMaxExtremaPerTile * 2;
  return kWithSource > kWithExtrema ? kWithSource : kWithExtrema;
}

template <BandSource kSource, typename Pixel>
__device__ __forceinline__ void MakeTile(const ExtractBuffers& buffers, const OctaveLayout& octave, int slot,
                                         int tile_x, int tile_y, const Pixel* source, int width, int height, int pitch,
                                         int threshold) {
  extern __shared__ __align__(16) std::uint32_t shared[];
  __shared__ ExtremaCounts counts;
  if (threadIdx.x == 0) counts.num_found = 0;
  std::uint32_t* source_tile = shared + kFirstSourceWord<kSource>;
  const BandFragment* weights = buffers.band_weights[static_cast<int>(kSource)].rows[0][0] + threadIdx.x % 32;
  std::uint32_t rows[SourceTile<kSource>::kSteps][4];
  LoadFragments(weights, rows);
  const TilePlace place = {tile_x * kOctaveTilePx - kBorder, tile_y * kOctaveTilePx - kBorder, octave.width,
                           octave.height};
  constexpr int kMargin = SourceTile<kSource>::kMargin;
  constexpr int kFactor = kSource == BandSource::kEnlargedGrey ? 2 : 1;
  LoadSource<kSource>(source, width, height, pitch, place.first_x / kFactor - kMargin,
                      place.first_y / kFactor - kMargin, source_tile);
  __syncthreads();
  MakeLevels<kSource>(weights, rows, source_tile, shared);
  __syncthreads();
  FindExtrema<kSource == BandSource::kPlane ? 1 : 0>(shared, buffers, octave, slot, place, threshold, counts);
}

template <BandSource kSource>
constexpr int kSlotOf = kSource == BandSource::kEnlargedGrey ? 0 : 1;
// As many blocks as find room on a multiprocessor: of 227 KB four of octave -1, or three and one of octave 0; of 163 KB
// two. Coarse tiles are few, and waited for: rather one less than some registers in memory.
#if !defined(__CUDA_ARCH__) || __CUDA_ARCH__ >= 900
constexpr int kFineBlocks = 4;
constexpr int kCoarseBlocks = 3;
#else
constexpr int kFineBlocks = 2;
constexpr int kCoarseBlocks = 2;
#endif

// Tiles of octave -1 or 0.
template <BandSource kSource>
__global__ void __launch_bounds__(kTileThreads, kFineBlocks)
    FineOctaveKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                     int first_tile_row, int threshold) {
  constexpr int kSlot = kSlotOf<kSource>;
  MakeTile<kSource>(buffers, layout.octaves[kSlot], kSlot, blockIdx.x, first_tile_row + blockIdx.y, buffers.grey,
                    layout.width, layout.height, layout.grey_pitch, threshold);
}

// Octaves 1 and up, from their level 0.
__global__ void __launch_bounds__(kTileThreads, kCoarseBlocks)
    CoarseOctavesKernel(const __grid_constant__ ScaleSpaceLayout layout, const __grid_constant__ ExtractBuffers buffers,
                        int first_tile, int threshold) {
  WaitForKernelBefore();
  const int tile = first_tile + blockIdx.x;
  int slot = layout.num_octaves - 1;
  while (tile < layout.octaves[slot].first_tile) --slot;
  const OctaveLayout& octave = layout.octaves[slot];
  MakeTile<BandSource::kPlane>(buffers, octave, slot, (tile - octave.first_tile) % octave.tile_columns,
                               (tile - octave.first_tile) / octave.tile_columns, buffers.planes + octave.first_value,
                               octave.width, octave.height, octave.stride, threshold);
}

// Blur, then every kFactor-th pixel of every kFactor-th row. A block makes what it can from a tile so many source
// pixels wide: rows of words of four.
constexpr int kReduceWidth = 192;
constexpr int kReduceThreads = 2 * kReduceWidth;
template <int kFactor>
struct Reduction {
  static constexpr int kRadius = ReductionRadius(kFactor);
  static constexpr int kFirst = -kRadius & 3;  // pixels between the first word's and the first one that is needed
  static constexpr int kColumns = (kReduceWidth - kFirst - 2 * kRadius) / kFactor / 16 * 16;  // of a block
  static constexpr int kRows = kFactor == 2 ? 12 : 8;
  static constexpr int kHeight = kFactor * kRows + 2 * kRadius;  // that they are made from
  // Of blurred columns. Rows next to each other, with columns kFactor apart, meet in no bank.
  static constexpr int kTmpPitch = kReduceWidth + 1;
  static constexpr int kTmpBytes = kRows * kTmpPitch * 4;
  static constexpr int kBytes = kTmpBytes + kHeight * kReduceWidth * 2;
};
constexpr int kReduceBytes = Reduction<4>::kBytes;
static_assert(Reduction<2>::kBytes <= kReduceBytes);

// Symmetric, in constant memory as a kernel parameter.
template <int kFactor>
struct BlurWeights {
  float w[Reduction<kFactor>::kRadius + 1] = {};
};

template <typename Pixel>
struct ReductionSource {
  const Pixel* pixels;
  int width;
  int height;
  int pitch;
};
struct ReductionTarget {
  PlaneValue* values;
  int width;
  int height;
  int stride;
};

// A line blurred at kCount places, kFactor apart; at(i): its value i, kRadius of them before the first place. Each
// value is fetched once for all places, and held as long as it takes.
template <int kFactor, int kCount, typename At>
__device__ __forceinline__ void BlurLine(const BlurWeights<kFactor>& weights, const At& at, float (&sums)[kCount]) {
  constexpr int kRadius = Reduction<kFactor>::kRadius;
  constexpr int kLast = kRadius + (kCount - 1) * kFactor;
  float values[kLast + kRadius + 1];
#pragma unroll
  for (int i = kRadius; i <= kLast; ++i) values[i] = at(i);
#pragma unroll
  for (int c = 0; c < kCount; ++c) sums[c] = weights.w[0] * values[kRadius + c * kFactor];
#pragma unroll
  for (int j = 1; j <= kRadius; ++j) {
    values[kRadius - j] = at(kRadius - j);
    values[kLast + j] = at(kLast + j);
#pragma unroll
    for (int c = 0; c < kCount; ++c) {
      const int place = kRadius + c * kFactor;
      sums[c] = fmaf(weights.w[j], values[place - j] + values[place + j], sums[c]);
    }
  }
}

// Four pixels of a line, two to a word, as counts; selector: which ones of the four in the words read (SelectPixels).
template <typename Pixel>
struct FourPixels;
template <>
struct FourPixels<std::uint8_t> {
  using Words = std::uint32_t;
  static __device__ __forceinline__ uint2 Counts(std::uint32_t grey, std::uint32_t selector) {
    const std::uint32_t four = __byte_perm(grey, 0, selector);
    static_assert(kCountsPerGrey == 0x101);
    return make_uint2(__byte_perm(four, 0, 0x1100), __byte_perm(four, 0, 0x3322));
  }
};
template <>
struct FourPixels<PlaneValue> {
  using Words = uint2;
  static __device__ __forceinline__ uint2 Counts(uint2 values, std::uint32_t selector) {
    // Of bytes: value v is bytes 2 * v and 2 * v + 1.
    const std::uint32_t spread =
        (selector & 0x000f) | (selector & 0x00f0) << 4 | (selector & 0x0f00) << 8 | (selector & 0xf000) << 12;
    const std::uint32_t bytes = spread * 0x22u + 0x10101010u;
    return make_uint2(__byte_perm(values.x, values.y, bytes), __byte_perm(values.x, values.y, bytes >> 16));
  }
};

template <int kFactor, typename Pixel>
__device__ __forceinline__ void Reduce(const ReductionSource<Pixel>& in, const ReductionTarget& out,
                                       const BlurWeights<kFactor>& weights, int block, unsigned char* scratch) {
  using R = Reduction<kFactor>;
  float* tmp = reinterpret_cast<float*>(scratch);
  PlaneValue* tile = reinterpret_cast<PlaneValue*>(scratch + R::kTmpBytes);
  const int block_columns = (out.width + R::kColumns - 1) / R::kColumns;
  const int out_x = block % block_columns * R::kColumns;
  const int out_y = block / block_columns * R::kRows;
  // A thread to four pixels of a row.
  constexpr int kThreadsPerRow = kReduceWidth / 4;
  const int first_column = threadIdx.x % kThreadsPerRow * 4;
  const int x = kFactor * out_x - R::kRadius - R::kFirst + first_column;
  const int four = Clamp(x >> 2, 0, (in.width - 1) >> 2);
  const std::uint32_t selector = SelectPixels<4>(x, in.width, 4 * four);
  using Words = typename FourPixels<Pixel>::Words;
  FetchRows<R::kHeight, kReduceThreads / kThreadsPerRow, Words>(
      in.pixels, in.height, in.pitch, kFactor * out_y - R::kRadius, threadIdx.x / kThreadsPerRow, four,
      [&](int row, const Words& words) {
        if (row >= R::kHeight) return;
        *reinterpret_cast<uint2*>(tile + row * kReduceWidth + first_column) =
            FourPixels<Pixel>::Counts(words, selector);
      });
  __syncthreads();
  // A thread to some rows of a column.
  constexpr int kBlurredRows = R::kRows * kReduceWidth / kReduceThreads;
  const int column = threadIdx.x % kReduceWidth;
  const int first_row = threadIdx.x / kReduceWidth * kBlurredRows;
  const PlaneValue* first = tile + kFactor * first_row * kReduceWidth + column;
  float sums[kBlurredRows];
  BlurLine<kFactor>(
      weights, [&](int i) { return ToCounts(first[i * kReduceWidth]); }, sums);
#pragma unroll
  for (int r = 0; r < kBlurredRows; ++r) tmp[(first_row + r) * R::kTmpPitch + column] = sums[r];
  __syncthreads();
  // A warp to kFactor rows, a lane to a pixel.
  constexpr int kLanesPerRow = 32 / kFactor;
  constexpr int kRowParts = R::kRows / kFactor;
  constexpr int kParts = kRowParts * R::kColumns / kLanesPerRow;
  static_assert(R::kRows % kFactor == 0 && R::kColumns % kLanesPerRow == 0);
  const int lane = threadIdx.x % 32;
#pragma unroll 1
  for (int part = threadIdx.x / 32; part < kParts; part += kReduceThreads / 32) {
    const int row = part % kRowParts * kFactor + lane / kLanesPerRow;
    const int out_column = part / kRowParts * kLanesPerRow + lane % kLanesPerRow;
    const float* first_blurred = tmp + row * R::kTmpPitch + R::kFirst + kFactor * out_column;
    float sum[1];
    BlurLine<kFactor>(
        weights, [&](int i) { return first_blurred[i]; }, sum);
    if (out_x + out_column < out.width && out_y + row < out.height) {
      out.values[static_cast<std::size_t>(out_y + row) * out.stride + out_x + out_column] = ToPlaneValue(sum[0]);
    }
  }
}

// Level 0 of two octaves from one source: the first blocks make the one of half the size, the others that of a quarter.
template <typename Pixel>
__global__ void __launch_bounds__(kReduceThreads)
    ReduceKernel(const ReductionSource<Pixel> in, const ReductionTarget half, const ReductionTarget quarter,
                 int num_half_blocks, const __grid_constant__ BlurWeights<2> half_weights,
                 const __grid_constant__ BlurWeights<4> quarter_weights) {
  __shared__ __align__(16) unsigned char scratch[kReduceBytes];
  WaitForKernelBefore();
  const int block = blockIdx.x;
  if (block < num_half_blocks) {
    Reduce<2>(in, half, half_weights, block, scratch);
  } else {
    Reduce<4>(in, quarter, quarter_weights, block - num_half_blocks, scratch);
  }
}

int NumTiles(int size, int tile) { return (size + tile - 1) / tile; }

// The grid point may have less contrast than the refined one. At least 1, and such that the search's words hold it.
int LowestThreshold(const ExtractSettings& settings) {
  const float counts = 0.8f * settings.contrast_threshold * kCountsPerUnit;
  return static_cast<int>(counts < 15000.0f ? counts : 15000.0f) + 1;
}

template <int kFactor>
int NumReduceBlocks(const OctaveLayout& to) {
  using R = Reduction<kFactor>;
  return NumTiles(to.width, R::kColumns) * NumTiles(to.height, R::kRows);
}

template <int kFactor>
BlurWeights<kFactor> ReductionWeights(bool from_grey) {
  const std::vector<float> values = WeightsOfReduction(kFactor, from_grey);
  BlurWeights<kFactor> weights;
  for (std::size_t j = 0; j < values.size(); ++j) weights.w[j] = values[j];
  return weights;
}

// Level 0 of octave `slot` and of the one after it, if there is one.
template <typename Pixel>
cudaError_t LaunchReduction(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                            const ExtractBuffers& buffers, const ReductionSource<Pixel>& in, int slot, bool is_behind,
                            cudaStream_t stream) {
  const auto target = [&](const OctaveLayout& octave) {
    return ReductionTarget{buffers.planes + octave.first_value, octave.width, octave.height, octave.stride};
  };
  const bool has_quarter = slot + 1 < layout.num_octaves;
  const OctaveLayout& half = layout.octaves[slot];
  const OctaveLayout& quarter = layout.octaves[has_quarter ? slot + 1 : slot];
  const int num_half_blocks = NumReduceBlocks<2>(half);
  const int num_blocks = num_half_blocks + (has_quarter ? NumReduceBlocks<4>(quarter) : 0);
  constexpr bool kFromGrey = sizeof(Pixel) == 1;
  return LaunchAfter(settings.can_launch_early && is_behind, ReduceKernel<Pixel>, num_blocks, kReduceThreads, 0, stream,
                     in, target(half), target(quarter), num_half_blocks, ReductionWeights<2>(kFromGrey),
                     ReductionWeights<4>(kFromGrey));
}

template <BandSource kSource>
cudaError_t PrepareFine() {
  return cudaFuncSetAttribute(FineOctaveKernel<kSource>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                              SharedBytes<kSource>());
}

template <BandSource kSource>
cudaError_t LaunchFine(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                       const RowRange& rows, cudaStream_t stream) {
  const OctaveLayout& octave = layout.octaves[kSlotOf<kSource>];
  constexpr int kFactor = kSource == BandSource::kEnlargedGrey ? 2 : 1;
  // Rows of tiles that the grey image's first `num_rows` rows suffice for.
  const auto tile_rows = [&](int num_rows) {
    if (num_rows == layout.height) return octave.num_tiles / octave.tile_columns;
    using Tile = SourceTile<kSource>;
    const int last_first_y = (num_rows - Tile::kSize + Tile::kMargin) * kFactor + kBorder;
    return last_first_y < 0 ? 0 : last_first_y / kOctaveTilePx + 1;
  };
  const int first_row = tile_rows(rows.begin);
  const int num_rows = tile_rows(rows.end) - first_row;
  if (num_rows == 0) return cudaSuccess;
  FineOctaveKernel<kSource><<<dim3(octave.tile_columns, num_rows), kTileThreads, SharedBytes<kSource>(), stream>>>(
      layout, buffers, first_row, LowestThreshold(settings));
  return cudaGetLastError();
}

}  // namespace

cudaError_t PrepareOctaves() {
  if (const cudaError_t error = PrepareFine<BandSource::kEnlargedGrey>(); error != cudaSuccess) return error;
  if (const cudaError_t error = PrepareFine<BandSource::kGrey>(); error != cudaSuccess) return error;
  return cudaFuncSetAttribute(CoarseOctavesKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                              SharedBytes<BandSource::kPlane>());
}

cudaError_t LaunchFinestOctave(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                               const ExtractBuffers& buffers, const RowRange& rows, cudaStream_t stream) {
  static_assert(kFirstOctave == -1 && kFirstCoarseSlot == 2);
  return LaunchFine<BandSource::kEnlargedGrey>(layout, settings, buffers, rows, stream);
}

cudaError_t LaunchOctaveZero(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, const RowRange& rows, cudaStream_t stream) {
  if (layout.num_octaves <= 1) return cudaSuccess;
  return LaunchFine<BandSource::kGrey>(layout, settings, buffers, rows, stream);
}

cudaError_t LaunchLevelZero(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                            const ExtractBuffers& buffers, int slot, bool is_behind, cudaStream_t stream) {
  if (slot == kFirstCoarseSlot) {
    return LaunchReduction<std::uint8_t>(layout, settings, buffers,
                                         {buffers.grey, layout.width, layout.height, layout.grey_pitch}, slot,
                                         is_behind, stream);
  }
  const OctaveLayout& from = layout.octaves[slot - 1];
  return LaunchReduction<PlaneValue>(layout, settings, buffers,
                                     {buffers.planes + from.first_value, from.width, from.height, from.stride}, slot,
                                     is_behind, stream);
}

cudaError_t LaunchCoarseOctaves(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                                const ExtractBuffers& buffers, int first_slot, int end_slot, bool is_behind,
                                cudaStream_t stream) {
  const int first_tile = layout.octaves[first_slot].first_tile;
  const OctaveLayout& last = layout.octaves[end_slot - 1];
  return LaunchAfter(settings.can_launch_early && is_behind, CoarseOctavesKernel,
                     last.first_tile + last.num_tiles - first_tile, kTileThreads, SharedBytes<BandSource::kPlane>(),
                     stream, layout, buffers, first_tile, LowestThreshold(settings));
}

}  // namespace haustra::kernels::cuda
