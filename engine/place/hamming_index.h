// Which keyframes have descriptors like those of a view, by Hamming embedding (Jégou, Douze and Schmid 2008, "Hamming
// embedding and weak geometric consistency for large scale image search"): an inverted file whose entries carry a
// binary signature of the descriptor, so that a cell's entries are told apart by one exclusive or and a count of bits.
// It only ranks; descriptor_vote.h decides.
//
// Nothing is trained. After a pseudo-random rotation two groups of 32 axes give the cell, each by the axis, with its
// sign, on which the descriptor is longest (cross-polytopes, Andoni et al. 2015, "Practical and optimal LSH for angular
// distance"). A view asks the cells of the next longest axes, too (multi-probe, Lv et al. 2007). The signature is the
// signs on the other 64 axes. Descriptors are centred on the mean of their own view, without which most of them would
// lie in few cells.
//
// All arithmetic is on integers, and sums of votes do not depend on their order: what is ranked depends on the
// keyframes that are there alone, not on device, machine or history. Memory is taken at construction; 18 bytes a
// descriptor. thread-bound(its owner), no call allocates.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/vision_device.h"

namespace haustra {

class HammingIndex {
 public:
  // max_descriptors: of a keyframe or a view.
  HammingIndex(int max_keyframes, int max_descriptors);
  static std::size_t BytesFor(int max_keyframes, int max_descriptors);

  // Rows of `descriptors` (N x 128 u8) with the indices `features`, of which the first max_descriptors count. The slot,
  // [0, max_keyframes), is empty. About 1 ms for 256.
  void Add(std::uint32_t slot, std::span<const std::uint8_t> descriptors, std::span<const std::int32_t> features);
  // Of an empty slot: nothing happens.
  void Remove(std::uint32_t slot);

  // scores[slot], both of max_keyframes: the larger the more alike; 0 where is_eligible is 0 or nothing is alike. A
  // descriptor of the view gives a keyframe one vote at most. It weighs more the nearer the descriptors are, and the
  // fewer eligible keyframes it votes for.
  void Score(std::span<const std::uint8_t> descriptors, std::span<const std::int32_t> features,
             std::span<const std::uint8_t> is_eligible, std::span<std::uint64_t> scores);

 private:
  static constexpr int kGroupSize = 32;  // axes of one cross-polytope, of which there are two
  static constexpr int kNumCells = 4 * kGroupSize * kGroupSize;
  static constexpr int kNumProbes = 12;
  static constexpr int kMaxDistance = 10;  // of signatures, bits of 64
  // A cell with more entries than both tells nothing apart, and is not read (a stop list, Sivic and Zisserman 2003,
  // "Video Google"): most of the time went into a few such cells.
  static constexpr std::uint32_t kMinStopEntries = 2048;
  static constexpr std::uint32_t kStopRatio = 8;  // over the mean of all cells
  static constexpr std::uint32_t kBlockSize = 32;
  static constexpr std::uint32_t kNone = 0xffffffffu;
  static constexpr int kNumRotations = 3;  // as good as a random one (Andoni et al. 2015, section 4)

  using Axes = std::array<std::int32_t, kDescriptorBytes>;

  // Some entries of one cell, which lie in signatures_ and owners_. All blocks of a cell are full but the first.
  struct Block {
    std::uint32_t num = 0;
    std::uint32_t next = kNone;
  };
  struct Embedded {
    std::uint64_t signature = 0;
    std::array<std::uint16_t, kNumProbes> cells{};  // nearest first
  };

  static std::size_t NumBlocks(int max_keyframes, int max_descriptors);
  // The first descriptors of the list, as many as count; sets mean_.
  std::span<const std::int32_t> Centre(std::span<const std::uint8_t> descriptors,
                                       std::span<const std::int32_t> features);
  Embedded Embed(const std::uint8_t* descriptor) const;
  void Rotate(int rotation, Axes* axes) const;
  void Insert(std::uint16_t cell, std::uint64_t signature, std::uint32_t owner);
  void Erase(std::uint32_t owner);
  // Nearest signature of each eligible keyframe into nearest_, the keyframes into touched_.
  void FindNear(const Embedded& query, std::span<const std::uint8_t> is_eligible);

  const std::uint32_t max_descriptors_;
  std::array<Axes, kNumRotations> flips_;  // -1 on the axes whose sign is changed, else 0
  std::vector<Block> blocks_;
  std::vector<std::uint64_t> signatures_;  // of the entries, kBlockSize a block
  std::vector<std::uint32_t> owners_;      // slot * max_descriptors_ + place among the slot's descriptors
  std::uint32_t first_free_ = kNone;
  std::array<std::uint32_t, kNumCells> first_of_cell_;
  std::array<std::uint32_t, kNumCells> num_of_cell_{};
  std::uint32_t num_entries_ = 0;
  std::vector<std::uint32_t> num_of_slot_;
  std::vector<std::uint32_t> entry_of_owner_;  // block * kBlockSize + place
  std::vector<std::uint16_t> cell_of_owner_;

  // Workspace.
  Axes mean_{};
  std::vector<std::uint8_t> nearest_;  // by slot, kFar: none
  std::vector<std::uint32_t> touched_;
};

}  // namespace haustra
