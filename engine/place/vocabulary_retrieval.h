// Retrieval by visual words: each keyframe is a bag of the words of its strongest features, weighted by frequency and
// by how rare the word is (tf-idf), and an inverted file leads from a word to the keyframes that have it. A view's
// score with a keyframe is 1 - |a - b| / 2 for the L1-normalised bags a and b, that is, what they have in common
// (Nistér and Stewénius 2006, eq. 4 and 5 for the norm L1). Only keyframes that share
// a word are touched: a query takes about 0.2 ms for the 256 words of the view and 0.13 ms for every hundred keyframes
// (haustra_retrieval_benchmark).
//
// Memory is taken at construction, for memory.max_keyframes of retrieval.max_descriptors words each: a keyframe's words
// lie in its own slot and are chained through it, word by word, so no list of a word can be full. Weights and scores
// are integers: nothing depends on the order of summation. thread-bound(mapping).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/config.h"
#include "engine/place/keyframe_slots.h"
#include "engine/place/place_config.h"
#include "engine/place/retrieval.h"
#include "engine/place/view_descriptors.h"
#include "engine/place/vocabulary.h"

namespace haustra {

class VocabularyRetrieval final : public KeyframeRetrieval {
 public:
  // The configurations, the device and the vocabulary outlive it.
  VocabularyRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval, VisionDevice& device,
                      const Vocabulary& vocabulary);

  // Taken at construction, but for a word's first entry (4 bytes a word of the vocabulary).
  static std::size_t BytesFor(const EngineConfig& config);

  // The words are those of the keyframe's strongest features, with or without a map point; read from the device here,
  // once. kCapacityExceeded: as many keyframes as there is room for. Errors of the device: the keyframe is not added.
  Status Add(const Atlas& atlas, KeyframeHandle keyframe) override;
  void Remove(KeyframeHandle keyframe) override;
  // num_votes: words in common, at least retrieval.min_votes.
  Status Query(const Atlas& atlas, const RetrievalQuery& query, std::vector<RetrievalCandidate>* out) override;
  // All of it: looking up words takes no time to speak of.
  Status Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                 std::vector<RetrievalCandidate>* out) override;

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;
  // Weights of one bag add up to at most this.
  static constexpr int kShareBits = 24;

  struct WordShare {
    std::int32_t word = -1;
    std::uint32_t share = 0;  // of the bag
  };
  // One word of one keyframe, a link in the chain of all keyframes with the word. Entry i belongs to the keyframe in
  // slot i / max_words_.
  struct Entry {
    std::int32_t word = -1;
    std::uint32_t share = 0;
    std::uint32_t next = kNone;
    std::uint32_t previous = kNone;
  };
  // The bag of some features of a set, in order of the words; words without weight are left out.
  Status FindWords(FeatureSetHandle set, std::span<const std::int32_t> features);

  const RetrievalConfig& retrieval_;
  const Vocabulary& vocabulary_;
  const std::size_t max_words_;  // of a keyframe
  KeyframeSlots slots_;
  std::vector<std::uint32_t> num_words_of_slot_;
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> first_of_word_;  // entry, or kNone

  // Workspace.
  ViewDescriptors descriptors_;
  std::vector<std::int32_t> strongest_;
  std::vector<std::int32_t> words_;
  std::vector<WordShare> bag_;
  std::vector<std::uint32_t> common_;     // share in common with the query, by slot
  std::vector<std::int32_t> num_common_;  // words in common, by slot
};

}  // namespace haustra
