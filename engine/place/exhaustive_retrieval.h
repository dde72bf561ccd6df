// Retrieval by voting: the view's strongest descriptors are matched by brute force against the strongest of each
// keyframe that show a map point; mutual matches that pass the ratio test are votes. Needs no training. While there are
// no more than max_keyframes_per_query keyframes all of them are voted on; of more, those that an index of binary
// signatures ranks first (hamming_index.h), which bounds what a query costs. The matches may be left to another thread
// (Prepare). thread-bound(mapping).
#pragma once

#include <optional>
#include <vector>

#include "engine/config.h"
#include "engine/place/descriptor_vote.h"
#include "engine/place/hamming_index.h"
#include "engine/place/keyframe_slots.h"
#include "engine/place/place_config.h"
#include "engine/place/retrieval.h"
#include "engine/place/view_descriptors.h"

namespace haustra {

class ExhaustiveRetrieval final : public KeyframeRetrieval {
 public:
  // The configurations and the device outlive it. `memory` gives the number of keyframes.
  ExhaustiveRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval, VisionDevice& device);

  // Taken at construction.
  static std::size_t BytesFor(const EngineConfig& config);

  // The index has the keyframe's strongest features, with or without a map point; they are read from the device here,
  // once. kCapacityExceeded: as many keyframes as there is room for. Errors of the device: the keyframe is not added.
  Status Add(const Atlas& atlas, KeyframeHandle keyframe) override;
  void Remove(KeyframeHandle keyframe) override;
  Status Query(const Atlas& atlas, const RetrievalQuery& query, std::vector<RetrievalCandidate>* out) override;
  // What is left are the matches. With more than max_keyframes_per_query keyframes the view's descriptors are read from
  // the device here, and ranking 3000 of them takes about 10 ms on one core
  // (decisions/2026-11-25-an-index-before-the-vote.md).
  Status Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                 std::vector<RetrievalCandidate>* out) override;

 private:
  struct Voters {
    std::optional<std::uint64_t> num_point_changes;  // of the keyframe when they were chosen
    std::uint32_t num = 0;
  };

  // Keyframes that may be found, into chosen_, best first, and not more than the limit.
  Status Choose(const Atlas& atlas, const RetrievalQuery& query);
  // The keyframe's strongest features with a map point, as they are now.
  std::span<const std::int32_t> VotersOf(std::uint32_t slot, const Keyframe& keyframe);

  const RetrievalConfig& retrieval_;
  const std::size_t max_voters_;  // of a keyframe or a view
  DescriptorVote vote_;
  VoteList votes_;  // of Query
  HammingIndex index_;
  KeyframeSlots slots_;
  std::vector<Voters> voters_of_slot_;
  std::vector<std::int32_t> voters_;  // max_voters_ for each slot

  // Workspace.
  ViewDescriptors descriptors_;
  std::vector<std::int32_t> strongest_;
  std::vector<std::uint8_t> is_eligible_;  // by slot
  std::vector<std::uint64_t> scores_;      // by slot
  struct Ranked {
    std::uint64_t score = 0;
    KeyframeId id = kNoId;
    std::uint32_t slot = 0;
  };
  std::vector<Ranked> chosen_;
};

}  // namespace haustra
