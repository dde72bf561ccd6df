// A vocabulary of visual words: a tree of k-means clusters of SIFT descriptors (Nistér and Stewénius 2006, "Scalable
// recognition with a vocabulary tree"). A descriptor goes down from the root to the nearest child of each node; the
// leaf where it ends is its word. Each word has a weight, the inverse document frequency of the training pictures.
//
// All arithmetic on descriptors is on integers: the centres are rounded to bytes, distances are squared L2, and ties go
// to the first child, so the same descriptors and options give the same vocabulary and the same words on any machine.
// Immutable after construction; reentrant. WordOf is rt-safe, about 1 us with 10 branches and 4 levels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

struct VocabularyOptions {
  int branching = 10;       // children of a node [2, 64]
  int depth = 4;            // levels below the root [1, 8]
  int max_iterations = 10;  // of k-means in one node [1, 100]
  bool root_sift = false;   // kind of the descriptors; those of a view must be of the same
  std::uint64_t seed = 1;
};

// What a vocabulary is learnt from: the descriptors of some pictures, one picture after the other.
struct VocabularySample {
  std::vector<std::uint8_t> descriptors;  // N x 128, row-major
  std::vector<std::size_t> picture_ends;  // end of each picture's descriptors, ascending; the last is N

  std::size_t num_descriptors() const { return descriptors.size() / kDescriptorBytes; }
};

// The tree as it is stored, nodes in breadth-first order (the children of a node stand together, those of the first
// node first); node 0 is the root.
struct VocabularyTree {
  int branching = 0;
  int depth = 0;
  bool root_sift = false;
  std::uint32_t num_pictures = 0;          // that it was trained on
  std::uint64_t num_descriptors = 0;       // likewise
  std::vector<std::uint8_t> num_children;  // of each node: 0 (a word) or [2, branching]
  std::vector<std::uint32_t> weights;      // of each word, in the order of the nodes: natural logarithm times 2^16
  std::vector<std::uint8_t> centres;       // of each node but the root, x 128
};

class Vocabulary {
 public:
  static constexpr int kMinBranching = 2, kMaxBranching = 64;
  static constexpr int kMaxDepth = 8;
  static constexpr std::uint32_t kMaxNodes = 1u << 24;
  static constexpr int kWeightBits = 16;
  static constexpr std::uint32_t kMaxWeight = 32u << kWeightBits;  // no logarithm of a count comes near it

  // Hierarchical k-means with k-means++ seeding (Arthur and Vassilvitskii 2007). A node with fewer than twice as many
  // descriptors as it would have children is not parted. kInvalidArgument: options out of range, no descriptors,
  // picture_ends that do not fit; kCapacityExceeded: more than kMaxNodes nodes or 2^24 descriptors. Allocates. Cost:
  // about descriptors * branching * depth * (max_iterations + 2) * 25 ns.
  static Result<Vocabulary> Train(const VocabularySample& sample, const VocabularyOptions& options);

  // kInvalidArgument, saying where, when it is not such a tree.
  static Result<Vocabulary> FromTree(VocabularyTree tree);

  // descriptor: 128 bytes. [0, num_words)
  std::int32_t WordOf(const std::uint8_t* descriptor) const;
  std::int32_t num_words() const { return static_cast<std::int32_t>(tree_.weights.size()); }
  // 0 for a word that is in every picture: it tells nothing.
  std::uint32_t weight(std::int32_t word) const { return tree_.weights[static_cast<std::size_t>(word)]; }
  const VocabularyTree& tree() const { return tree_; }

 private:
  struct Node {
    std::uint32_t first_child = 0;
    std::uint32_t num_children = 0;
    std::int32_t word = -1;  // of a leaf
  };

  VocabularyTree tree_;
  std::vector<Node> nodes_;
};

}  // namespace haustra
