#include "engine/place/hamming_index.h"

#include <algorithm>
#include <cstdlib>

#include "engine/geometry/rng.h"
#include "hal/core/check.h"

namespace haustra {
namespace {

constexpr std::uint64_t kSeed = 1;
constexpr std::uint8_t kFar = 255;
// A mean of bytes is kept to an eighth. With it, three rotations grow the longest descriptor to 4e7: 32 bits are
// enough.
constexpr std::int32_t kScale = 8;

// Without an instruction of its own, which the baseline of x86-64 lacks (Warren 2012, "Hacker's Delight", 5-1).
inline int CountBits(std::uint64_t bits) {
  bits -= (bits >> 1) & 0x5555555555555555u;
  bits = (bits & 0x3333333333333333u) + ((bits >> 2) & 0x3333333333333333u);
  bits = (bits + (bits >> 4)) & 0x0f0f0f0f0f0f0f0fu;
  return static_cast<int>((bits * 0x0101010101010101u) >> 56);
}

// What a vote is worth that `num` keyframes get.
constexpr std::uint64_t RarityOf(std::size_t num) { return (std::uint64_t{1} << 20) / num; }

struct LongAxis {
  std::int32_t length = -1;
  int code = 0;  // 2 * axis + (1 where negative)
};

// The four longest, longest first; of equals the first.
std::array<LongAxis, 4> LongestOf(std::span<const std::int32_t> axes) {
  std::array<LongAxis, 4> longest;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const LongAxis axis = {std::abs(axes[k]), static_cast<int>(2 * k) + (axes[k] < 0 ? 1 : 0)};
    if (axis.length <= longest.back().length) continue;
    std::size_t place = longest.size() - 1;
    for (; place > 0 && axis.length > longest[place - 1].length; --place) longest[place] = longest[place - 1];
    longest[place] = axis;
  }
  return longest;
}

}  // namespace

HammingIndex::HammingIndex(int max_keyframes, int max_descriptors)
    : max_descriptors_(static_cast<std::uint32_t>(max_descriptors)),
      blocks_(NumBlocks(max_keyframes, max_descriptors)),
      signatures_(blocks_.size() * kBlockSize),
      owners_(signatures_.size()),
      num_of_slot_(static_cast<std::size_t>(max_keyframes), 0u),
      entry_of_owner_(static_cast<std::size_t>(max_keyframes) * max_descriptors_),
      cell_of_owner_(entry_of_owner_.size()),
      nearest_(static_cast<std::size_t>(max_keyframes), kFar) {
  Rng rng(kSeed);
  for (Axes& flips : flips_) {
    for (std::int32_t& flip : flips) flip = (rng.Next() & 1u) != 0 ? -1 : 0;
  }
  first_of_cell_.fill(kNone);
  for (std::size_t i = blocks_.size(); i-- > 0;) {
    blocks_[i].next = first_free_;
    first_free_ = static_cast<std::uint32_t>(i);
  }
  touched_.reserve(static_cast<std::size_t>(max_keyframes));
}

std::size_t HammingIndex::NumBlocks(int max_keyframes, int max_descriptors) {
  // Full ones, and one of each cell that is not.
  return static_cast<std::size_t>(max_keyframes) * static_cast<std::size_t>(max_descriptors) / kBlockSize + kNumCells;
}

std::size_t HammingIndex::BytesFor(int max_keyframes, int max_descriptors) {
  const auto num_keyframes = static_cast<std::size_t>(max_keyframes);
  return NumBlocks(max_keyframes, max_descriptors) *
             (sizeof(Block) + kBlockSize * (sizeof(std::uint64_t) + sizeof(std::uint32_t))) +
         num_keyframes * static_cast<std::size_t>(max_descriptors) * (sizeof(std::uint32_t) + sizeof(std::uint16_t)) +
         num_keyframes * (2 * sizeof(std::uint32_t) + sizeof(std::uint8_t));
}

std::span<const std::int32_t> HammingIndex::Centre(std::span<const std::uint8_t> descriptors,
                                                   std::span<const std::int32_t> features) {
  features = features.first(std::min<std::size_t>(features.size(), max_descriptors_));
  mean_.fill(0);
  for (const std::int32_t feature : features) {
    const std::uint8_t* descriptor = &descriptors[static_cast<std::size_t>(feature) * kDescriptorBytes];
    for (std::size_t k = 0; k < mean_.size(); ++k) mean_[k] += descriptor[k];
  }
  const auto num = std::max<std::int32_t>(static_cast<std::int32_t>(features.size()), 1);
  for (std::int32_t& sum : mean_) sum = static_cast<std::int32_t>(std::int64_t{sum} * kScale / num);
  return features;
}

// Changes of sign and a Walsh-Hadamard transform: orthogonal but for its scale.
void HammingIndex::Rotate(int rotation, Axes* axes) const {
  Axes& v = *axes;
  const Axes& flips = flips_[static_cast<std::size_t>(rotation)];
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = (v[i] ^ flips[i]) - flips[i];
  for (std::size_t half = 1; half < v.size(); half *= 2) {
    for (std::size_t begin = 0; begin < v.size(); begin += 2 * half) {
      for (std::size_t i = begin; i < begin + half; ++i) {
        const std::int32_t a = v[i], b = v[i + half];
        v[i] = a + b;
        v[i + half] = a - b;
      }
    }
  }
}

HammingIndex::Embedded HammingIndex::Embed(const std::uint8_t* descriptor) const {
  Axes axes;
  for (std::size_t k = 0; k < axes.size(); ++k) axes[k] = descriptor[k] * kScale - mean_[k];
  for (int rotation = 0; rotation < kNumRotations; ++rotation) Rotate(rotation, &axes);
  const auto first = LongestOf(std::span(axes).first<kGroupSize>());
  const auto second = LongestOf(std::span(axes).subspan<kGroupSize, kGroupSize>());
  Embedded embedded;
  std::array<std::int32_t, kNumProbes> lengths;
  lengths.fill(-1);
  for (const LongAxis& a : first) {
    for (const LongAxis& b : second) {
      const std::int32_t length = a.length + b.length;
      // Of equals the one that came before stays.
      if (length <= lengths.back()) continue;
      std::size_t place = kNumProbes - 1;
      for (; place > 0 && length > lengths[place - 1]; --place) {
        lengths[place] = lengths[place - 1];
        embedded.cells[place] = embedded.cells[place - 1];
      }
      lengths[place] = length;
      embedded.cells[place] = static_cast<std::uint16_t>(a.code * 2 * kGroupSize + b.code);
    }
  }
  for (std::size_t bit = 0; bit < 64; ++bit) {
    embedded.signature |= static_cast<std::uint64_t>(axes[2 * kGroupSize + bit] > 0 ? 1 : 0) << bit;
  }
  return embedded;
}

void HammingIndex::Insert(std::uint16_t cell, std::uint64_t signature, std::uint32_t owner) {
  std::uint32_t& first = first_of_cell_[cell];
  if (first == kNone || blocks_[first].num == kBlockSize) {
    const std::uint32_t block = first_free_;
    HAUSTRA_CHECK(block != kNone);
    first_free_ = blocks_[block].next;
    blocks_[block].next = first;
    first = block;
  }
  const std::uint32_t entry = first * kBlockSize + blocks_[first].num++;
  signatures_[entry] = signature;
  owners_[entry] = owner;
  entry_of_owner_[owner] = entry;
  cell_of_owner_[owner] = cell;
  ++num_of_cell_[cell];
  ++num_entries_;
}

// The last entry of the cell's first block takes the place.
void HammingIndex::Erase(std::uint32_t owner) {
  const std::uint32_t entry = entry_of_owner_[owner];
  std::uint32_t& first = first_of_cell_[cell_of_owner_[owner]];
  --num_of_cell_[cell_of_owner_[owner]];
  --num_entries_;
  const std::uint32_t last = first * kBlockSize + --blocks_[first].num;
  signatures_[entry] = signatures_[last];
  owners_[entry] = owners_[last];
  entry_of_owner_[owners_[last]] = entry;
  if (blocks_[first].num > 0) return;
  const std::uint32_t empty = first;
  first = blocks_[empty].next;
  blocks_[empty].next = first_free_;
  first_free_ = empty;
}

void HammingIndex::Add(std::uint32_t slot, std::span<const std::uint8_t> descriptors,
                       std::span<const std::int32_t> features) {
  HAUSTRA_CHECK(num_of_slot_[slot] == 0);
  for (const std::int32_t feature : Centre(descriptors, features)) {
    const Embedded embedded = Embed(&descriptors[static_cast<std::size_t>(feature) * kDescriptorBytes]);
    Insert(embedded.cells[0], embedded.signature, slot * max_descriptors_ + num_of_slot_[slot]);
    ++num_of_slot_[slot];
  }
}

void HammingIndex::Remove(std::uint32_t slot) {
  for (std::uint32_t i = 0; i < num_of_slot_[slot]; ++i) Erase(slot * max_descriptors_ + i);
  num_of_slot_[slot] = 0;
}

void HammingIndex::FindNear(const Embedded& query, std::span<const std::uint8_t> is_eligible) {
  const std::uint32_t stop = std::max(kMinStopEntries, num_entries_ / kNumCells * kStopRatio);
  for (const std::uint16_t cell : query.cells) {
    if (num_of_cell_[cell] > stop) continue;
    for (std::uint32_t i = first_of_cell_[cell]; i != kNone; i = blocks_[i].next) {
      const std::uint32_t begin = i * kBlockSize;
      for (std::uint32_t entry = begin; entry < begin + blocks_[i].num; ++entry) {
        const int distance = CountBits(signatures_[entry] ^ query.signature);
        if (distance > kMaxDistance) continue;
        const std::uint32_t slot = owners_[entry] / max_descriptors_;
        if (is_eligible[slot] == 0 || distance >= nearest_[slot]) continue;
        if (nearest_[slot] == kFar) touched_.push_back(slot);
        nearest_[slot] = static_cast<std::uint8_t>(distance);
      }
    }
  }
}

void HammingIndex::Score(std::span<const std::uint8_t> descriptors, std::span<const std::int32_t> features,
                         std::span<const std::uint8_t> is_eligible, std::span<std::uint64_t> scores) {
  std::fill(scores.begin(), scores.end(), 0u);
  for (const std::int32_t feature : Centre(descriptors, features)) {
    FindNear(Embed(&descriptors[static_cast<std::size_t>(feature) * kDescriptorBytes]), is_eligible);
    if (touched_.empty()) continue;
    const std::uint64_t rarity = RarityOf(touched_.size());
    for (const std::uint32_t slot : touched_) {
      const auto nearness = static_cast<std::uint64_t>(kMaxDistance + 1 - nearest_[slot]);
      scores[slot] += nearness * nearness * rarity;
      nearest_[slot] = kFar;
    }
    touched_.clear();
  }
}

}  // namespace haustra
