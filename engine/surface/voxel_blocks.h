// A truncated signed distance volume in a fixed pool of blocks of 8x8x8 voxels, found by a hash of their place.
// Source: Niessner et al. 2013, "Real-time 3D reconstruction at scale using voxel hashing". Blocks are never given back
// one by one: a map whose keyframes moved is built anew (Reset). Full pool: the new block is refused and counted; what
// is there stays. thread-bound(its owner). rt-safe after construction.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace haustra {

// Eight bytes.
struct Voxel {
  static constexpr double kUnit = 32767.0;  // the stored distance at the truncation
  static constexpr int kMaxWeight = 65535;
  static constexpr int kMaxColourWeight = 255;

  std::int16_t distance = 0;       // share of the truncation times kUnit; positive: before the wall
  std::uint16_t weight = 0;        // 0: never seen
  std::uint8_t colour_weight = 0;  // 0: never seen near a wall
  std::array<std::uint8_t, 3> rgb{};
};
static_assert(sizeof(Voxel) == 8);

class VoxelBlocks {
 public:
  static constexpr int kSide = 8;
  static constexpr int kVoxels = kSide * kSide * kSide;
  static constexpr int kNoBlock = -1;

  // In blocks, each component of (-2^20, 2^20).
  using Place = Eigen::Vector3i;
  using Block = std::array<Voxel, kVoxels>;

  // max_blocks >= 1.
  explicit VoxelBlocks(int max_blocks);
  // What the pool takes.
  static std::size_t BytesFor(int max_blocks);

  void Reset();
  int num_blocks() const { return num_blocks_; }
  int max_blocks() const { return static_cast<int>(blocks_.size()); }
  // How often a block was refused since the last Reset.
  std::int64_t num_refused() const { return num_refused_; }

  // kNoBlock: it is not there.
  int Find(const Place& place) const;
  // kNoBlock: the pool is full, or the place is out of range; counted.
  int FindOrAdd(const Place& place);

  const Place& place(int block) const { return places_[block]; }
  Block& block(int block) { return blocks_[block]; }
  const Block& block(int block) const { return blocks_[block]; }
  static int Index(int x, int y, int z) { return (z * kSide + y) * kSide + x; }

 private:
  std::size_t Slot(const Place& place) const;

  int num_blocks_ = 0;
  std::int64_t num_refused_ = 0;
  std::vector<Block> blocks_;
  std::vector<Place> places_;  // of each block
  std::vector<int> slots_;     // hash table: block or kNoBlock; a power of two, twice the blocks at the least
};

}  // namespace haustra
