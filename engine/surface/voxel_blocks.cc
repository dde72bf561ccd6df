#include "engine/surface/voxel_blocks.h"

#include <algorithm>
#include <bit>

#include "hal/core/check.h"

namespace haustra {
namespace {

constexpr int kMaxPlace = 1 << 20;

std::size_t NumSlots(int max_blocks) { return std::bit_ceil(static_cast<std::size_t>(max_blocks) * 2); }

}  // namespace

VoxelBlocks::VoxelBlocks(int max_blocks) {
  HAUSTRA_CHECK(max_blocks >= 1);
  blocks_.resize(max_blocks);
  places_.resize(max_blocks);
  slots_.assign(NumSlots(max_blocks), kNoBlock);
}

std::size_t VoxelBlocks::BytesFor(int max_blocks) {
  return max_blocks * (sizeof(Block) + sizeof(Place)) + NumSlots(max_blocks) * sizeof(int);
}

void VoxelBlocks::Reset() {
  num_blocks_ = 0;
  num_refused_ = 0;
  std::fill(slots_.begin(), slots_.end(), kNoBlock);
}

// Where the block is, or where it would go: linear probing. There is always an empty slot.
std::size_t VoxelBlocks::Slot(const Place& place) const {
  // Primes of Teschner et al. 2003, "Optimized spatial hashing".
  const auto part = [&](int axis, std::uint64_t prime) { return static_cast<std::uint64_t>(place[axis]) * prime; };
  std::uint64_t hash = part(0, 73856093u) ^ part(1, 19349669u) ^ part(2, 83492791u);
  hash ^= hash >> 15;
  std::size_t slot = hash & (slots_.size() - 1);
  while (slots_[slot] != kNoBlock && places_[slots_[slot]] != place) slot = (slot + 1) & (slots_.size() - 1);
  return slot;
}

int VoxelBlocks::Find(const Place& place) const { return slots_[Slot(place)]; }

int VoxelBlocks::FindOrAdd(const Place& place) {
  const std::size_t slot = Slot(place);
  if (slots_[slot] != kNoBlock) return slots_[slot];
  if (num_blocks_ == max_blocks() || place.cwiseAbs().maxCoeff() >= kMaxPlace) {
    ++num_refused_;
    return kNoBlock;
  }
  const int block = num_blocks_++;
  slots_[slot] = block;
  places_[block] = place;
  blocks_[block].fill(Voxel());
  return block;
}

}  // namespace haustra
