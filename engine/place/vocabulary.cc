#include "engine/place/vocabulary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "engine/geometry/rng.h"
#include "engine/geometry/rng_streams.h"

namespace haustra {
namespace {

// Sums of so many bytes still fit in 32 bits.
constexpr std::size_t kMaxDescriptors = std::size_t{1} << 24;

using Centre = std::array<std::uint8_t, kDescriptorBytes>;

std::int32_t SquaredDistance(const std::uint8_t* a, const std::uint8_t* b) {
  std::int32_t sum = 0;
  for (int i = 0; i < kDescriptorBytes; ++i) {
    const auto difference = static_cast<std::int16_t>(a[i] - b[i]);
    sum += difference * difference;
  }
  return sum;
}

// Of `num` centres one after the other; ties: the first.
int Nearest(const std::uint8_t* descriptor, const std::uint8_t* centres, int num) {
  int nearest = 0;
  std::int32_t least = std::numeric_limits<std::int32_t>::max();
  for (int i = 0; i < num; ++i) {
    const std::int32_t distance = SquaredDistance(descriptor, centres + i * kDescriptorBytes);
    if (distance >= least) continue;
    least = distance;
    nearest = i;
  }
  return nearest;
}

// k-means on a part of the descriptors.
class Clustering {
 public:
  Clustering(const std::vector<std::uint8_t>& descriptors, const VocabularyOptions& options)
      : descriptors_(descriptors), options_(options), rng_(options.seed, rng_stream::kVocabulary) {}

  // Parts `members` (indices of descriptors): on return they stand cluster by cluster, and `ends` holds where each
  // ends. Fewer than two clusters: all descriptors are alike.
  void Part(std::span<std::uint32_t> members, std::vector<Centre>* centres, std::vector<std::size_t>* ends) {
    Seed(members, centres);
    label_.assign(members.size(), 0);
    bool has_changed = Assign(members, *centres);
    for (int i = 0; i < options_.max_iterations && has_changed; ++i) {
      MoveCentres(members, centres);
      has_changed = Assign(members, *centres);
    }
    // Labels are those of the final centres, so that a descriptor of the sample finds the node it was counted in.
    Sort(members, centres, ends);
  }

 private:
  const std::uint8_t* descriptor(std::uint32_t i) const { return &descriptors_[std::size_t{i} * kDescriptorBytes]; }

  // k-means++: each further centre is drawn with a chance proportional to the squared distance from those there are.
  void Seed(std::span<const std::uint32_t> members, std::vector<Centre>* centres) {
    centres->clear();
    distance_.assign(members.size(), std::numeric_limits<std::int32_t>::max());
    std::size_t chosen = rng_.UniformInt(static_cast<std::uint32_t>(members.size()));
    while (true) {
      Centre& centre = centres->emplace_back();
      std::copy_n(descriptor(members[chosen]), kDescriptorBytes, centre.begin());
      if (centres->size() == static_cast<std::size_t>(options_.branching)) return;
      std::uint64_t total = 0;
      for (std::size_t i = 0; i < members.size(); ++i) {
        distance_[i] = std::min(distance_[i], SquaredDistance(descriptor(members[i]), centre.data()));
        total += static_cast<std::uint64_t>(distance_[i]);
      }
      if (total == 0) return;
      auto left = static_cast<std::uint64_t>(rng_.Uniform() * static_cast<double>(total));
      for (chosen = 0; chosen + 1 < members.size(); ++chosen) {
        const auto share = static_cast<std::uint64_t>(distance_[chosen]);
        if (left < share) break;
        left -= share;
      }
    }
  }

  bool Assign(std::span<const std::uint32_t> members, const std::vector<Centre>& centres) {
    bool has_changed = false;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const int label = Nearest(descriptor(members[i]), centres.front().data(), static_cast<int>(centres.size()));
      has_changed = has_changed || label != label_[i];
      label_[i] = label;
    }
    return has_changed;
  }

  void MoveCentres(std::span<const std::uint32_t> members, std::vector<Centre>* centres) {
    sums_.assign(centres->size(), {});
    counts_.assign(centres->size(), 0);
    for (std::size_t i = 0; i < members.size(); ++i) {
      const std::uint8_t* const bytes = descriptor(members[i]);
      std::array<std::uint32_t, kDescriptorBytes>& sum = sums_[label_[i]];
      for (int k = 0; k < kDescriptorBytes; ++k) sum[k] += bytes[k];
      ++counts_[label_[i]];
    }
    for (std::size_t c = 0; c < centres->size(); ++c) {
      if (counts_[c] == 0) continue;  // stays where it is; dropped in the end if nothing comes to it
      for (int k = 0; k < kDescriptorBytes; ++k) {
        (*centres)[c][k] = static_cast<std::uint8_t>((std::uint64_t{sums_[c][k]} + counts_[c] / 2) / counts_[c]);
      }
    }
  }

  // By label, in the order they had; clusters without members go.
  void Sort(std::span<std::uint32_t> members, std::vector<Centre>* centres, std::vector<std::size_t>* ends) {
    std::vector<std::size_t> next(centres->size() + 1, 0);
    for (const int label : label_) ++next[label + 1];
    std::partial_sum(next.begin(), next.end(), next.begin());
    ends->clear();
    std::size_t num_kept = 0;
    for (std::size_t c = 0; c < centres->size(); ++c) {
      if (next[c] == next[c + 1]) continue;
      ends->push_back(next[c + 1]);
      (*centres)[num_kept++] = (*centres)[c];
    }
    centres->resize(num_kept);
    sorted_.resize(members.size());
    for (std::size_t i = 0; i < members.size(); ++i) sorted_[next[label_[i]]++] = members[i];
    std::copy(sorted_.begin(), sorted_.end(), members.begin());
  }

  const std::vector<std::uint8_t>& descriptors_;
  const VocabularyOptions& options_;
  Rng rng_;
  std::vector<int> label_;              // of each member
  std::vector<std::int32_t> distance_;  // squared, of each member to the nearest seed
  std::vector<std::array<std::uint32_t, kDescriptorBytes>> sums_;
  std::vector<std::uint32_t> counts_;
  std::vector<std::uint32_t> sorted_;
};

Status OutOfRange(const char* name, std::int64_t value, std::int64_t min, std::int64_t max) {
  return InvalidArgument(std::string("vocabulary: ") + name + " is " + std::to_string(value) + ", must be in [" +
                         std::to_string(min) + ", " + std::to_string(max) + "]");
}

Status CheckShape(int branching, int depth) {
  if (branching < Vocabulary::kMinBranching || branching > Vocabulary::kMaxBranching) {
    return OutOfRange("branching", branching, Vocabulary::kMinBranching, Vocabulary::kMaxBranching);
  }
  if (depth < 1 || depth > Vocabulary::kMaxDepth) return OutOfRange("depth", depth, 1, Vocabulary::kMaxDepth);
  return Status::Ok();
}

Status CheckSample(const VocabularySample& sample) {
  const std::size_t num = sample.num_descriptors();
  if (num == 0) return InvalidArgument("vocabulary: no descriptors to learn from");
  if (sample.descriptors.size() != num * kDescriptorBytes) {
    return InvalidArgument("vocabulary: " + std::to_string(sample.descriptors.size()) +
                           " bytes of descriptors are no multiple of " + std::to_string(kDescriptorBytes));
  }
  if (num > kMaxDescriptors) {
    return CapacityExceeded("vocabulary: " + std::to_string(num) + " descriptors, at most " +
                            std::to_string(kMaxDescriptors) + " can be learnt from");
  }
  if (!std::is_sorted(sample.picture_ends.begin(), sample.picture_ends.end()) || sample.picture_ends.empty() ||
      sample.picture_ends.back() != num) {
    return InvalidArgument("vocabulary: the ends of the pictures do not fit " + std::to_string(num) + " descriptors");
  }
  return Status::Ok();
}

// ln(pictures / pictures with the word), from a tree without weights.
void Weigh(const VocabularySample& sample, const Vocabulary& vocabulary, std::vector<std::uint32_t>* weights) {
  std::vector<std::uint32_t> num_pictures(vocabulary.num_words(), 0);
  std::vector<std::int64_t> last_picture(vocabulary.num_words(), -1);
  std::size_t begin = 0;
  for (std::size_t picture = 0; picture < sample.picture_ends.size(); ++picture) {
    for (std::size_t i = begin; i < sample.picture_ends[picture]; ++i) {
      const std::int32_t word = vocabulary.WordOf(&sample.descriptors[i * kDescriptorBytes]);
      if (last_picture[word] == static_cast<std::int64_t>(picture)) continue;
      last_picture[word] = static_cast<std::int64_t>(picture);
      ++num_pictures[word];
    }
    begin = sample.picture_ends[picture];
  }
  const auto num_all = static_cast<double>(sample.picture_ends.size());
  for (std::size_t word = 0; word < num_pictures.size(); ++word) {
    // Every word was made from descriptors of the sample, so the count is not 0.
    const double weight = std::log(num_all / static_cast<double>(std::max(num_pictures[word], 1u)));
    (*weights)[word] = static_cast<std::uint32_t>(std::lround(weight * (1 << Vocabulary::kWeightBits)));
  }
}

}  // namespace

Result<Vocabulary> Vocabulary::Train(const VocabularySample& sample, const VocabularyOptions& options) {
  HAUSTRA_TRY(CheckShape(options.branching, options.depth));
  if (options.max_iterations < 1 || options.max_iterations > 100) {
    return OutOfRange("max_iterations", options.max_iterations, 1, 100);
  }
  HAUSTRA_TRY(CheckSample(sample));

  VocabularyTree tree;
  tree.branching = options.branching;
  tree.depth = options.depth;
  tree.root_sift = options.root_sift;
  tree.num_pictures = static_cast<std::uint32_t>(sample.picture_ends.size());
  tree.num_descriptors = sample.num_descriptors();

  std::vector<std::uint32_t> members(sample.num_descriptors());
  std::iota(members.begin(), members.end(), 0u);
  // Members of each node, by node.
  struct Part {
    std::size_t begin, end;
    int level;
  };
  std::vector<Part> parts{{0, members.size(), 0}};
  Clustering clustering(sample.descriptors, options);
  std::vector<Centre> centres;
  std::vector<std::size_t> ends;
  for (std::size_t node = 0; node < parts.size(); ++node) {
    const Part part = parts[node];
    const std::size_t count = part.end - part.begin;
    tree.num_children.push_back(0);
    if (part.level == options.depth || count < 2 * static_cast<std::size_t>(options.branching)) continue;
    clustering.Part(std::span(members).subspan(part.begin, count), &centres, &ends);
    if (centres.size() < 2) continue;
    if (parts.size() + centres.size() > kMaxNodes) {
      return CapacityExceeded("vocabulary: more than " + std::to_string(kMaxNodes) + " nodes");
    }
    tree.num_children.back() = static_cast<std::uint8_t>(centres.size());
    std::size_t begin = part.begin;
    for (std::size_t c = 0; c < centres.size(); ++c) {
      tree.centres.insert(tree.centres.end(), centres[c].begin(), centres[c].end());
      parts.push_back({begin, part.begin + ends[c], part.level + 1});
      begin = part.begin + ends[c];
    }
  }
  const auto num_words = std::count(tree.num_children.begin(), tree.num_children.end(), 0);
  tree.weights.assign(static_cast<std::size_t>(num_words), 0);
  HAUSTRA_ASSIGN(Vocabulary vocabulary, FromTree(std::move(tree)));
  Weigh(sample, vocabulary, &vocabulary.tree_.weights);
  return vocabulary;
}

Result<Vocabulary> Vocabulary::FromTree(VocabularyTree tree) {
  HAUSTRA_TRY(CheckShape(tree.branching, tree.depth));
  const std::size_t num_nodes = tree.num_children.size();
  if (num_nodes == 0 || num_nodes > kMaxNodes) {
    return OutOfRange("number of nodes", static_cast<std::int64_t>(num_nodes), 1, kMaxNodes);
  }
  if (tree.centres.size() != (num_nodes - 1) * kDescriptorBytes) {
    return InvalidArgument("vocabulary: " + std::to_string(tree.centres.size()) + " bytes of centres for " +
                           std::to_string(num_nodes) + " nodes");
  }
  Vocabulary vocabulary;
  vocabulary.nodes_.resize(num_nodes);
  std::vector<std::uint8_t> level(num_nodes, 0);
  std::size_t num_reached = 1, num_words = 0;
  for (std::size_t i = 0; i < num_nodes; ++i) {
    const auto where = [&] { return "vocabulary: node " + std::to_string(i) + " "; };
    const std::size_t count = tree.num_children[i];
    if (i >= num_reached) return InvalidArgument(where() + "has no parent");
    if (count == 0) {
      vocabulary.nodes_[i].word = static_cast<std::int32_t>(num_words++);
      continue;
    }
    if (count == 1 || count > static_cast<std::size_t>(tree.branching)) {
      return InvalidArgument(where() + "has " + std::to_string(count) + " children, branching is " +
                             std::to_string(tree.branching));
    }
    if (level[i] == tree.depth) return InvalidArgument(where() + "is parted below the depth of the tree");
    if (num_reached + count > num_nodes) return InvalidArgument(where() + "has children that are not there");
    vocabulary.nodes_[i].first_child = static_cast<std::uint32_t>(num_reached);
    vocabulary.nodes_[i].num_children = static_cast<std::uint32_t>(count);
    for (std::size_t c = 0; c < count; ++c) level[num_reached++] = static_cast<std::uint8_t>(level[i] + 1);
  }
  if (tree.weights.size() != num_words) {
    return InvalidArgument("vocabulary: " + std::to_string(tree.weights.size()) + " weights for " +
                           std::to_string(num_words) + " words");
  }
  for (std::size_t word = 0; word < num_words; ++word) {
    if (tree.weights[word] > kMaxWeight) {
      return InvalidArgument("vocabulary: weight of word " + std::to_string(word) + " is " +
                             std::to_string(tree.weights[word]) + ", at most " + std::to_string(kMaxWeight));
    }
  }
  vocabulary.tree_ = std::move(tree);
  return vocabulary;
}

std::int32_t Vocabulary::WordOf(const std::uint8_t* descriptor) const {
  const Node* node = &nodes_.front();
  while (node->num_children > 0) {
    const std::uint8_t* const centres = &tree_.centres[(node->first_child - std::size_t{1}) * kDescriptorBytes];
    node = &nodes_[node->first_child + Nearest(descriptor, centres, static_cast<int>(node->num_children))];
  }
  return node->word;
}

}  // namespace haustra
