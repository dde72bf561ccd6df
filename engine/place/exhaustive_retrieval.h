// Retrieval by voting: the view's strongest descriptors are matched by brute force against the strongest of each
// keyframe that show a map point; mutual matches that pass the ratio test are votes. Exact, needs no training, and its
// cost is one small match a keyframe, bounded by max_keyframes_per_query: a query that does not reach all keyframes
// leaves the rest to the next one, which begins there. Those matches may be left to another thread (Prepare).
// thread-bound(mapping).
#pragma once

#include <vector>

#include "engine/config.h"
#include "engine/place/descriptor_vote.h"
#include "engine/place/place_config.h"
#include "engine/place/retrieval.h"

namespace haustra {

class ExhaustiveRetrieval final : public KeyframeRetrieval {
 public:
  // The configurations and the device outlive it. `memory` gives the number of keyframes.
  ExhaustiveRetrieval(const EngineConfig& config, const RetrievalConfig& retrieval, VisionDevice& device);

  // At most, when all keyframes are there.
  static std::size_t BytesFor(const EngineConfig& config);

  Status Add(const Atlas& atlas, KeyframeHandle keyframe) override;
  void Remove(KeyframeHandle keyframe) override;
  Status Query(const Atlas& atlas, const RetrievalQuery& query, std::vector<RetrievalCandidate>* out) override;
  Status Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                 std::vector<RetrievalCandidate>* out) override;

 private:
  struct Entry {
    KeyframeHandle keyframe;
    std::vector<std::int32_t> strongest;  // features that vote
    int num_points = -1;                  // of the keyframe when `strongest` was chosen
  };

  const EngineConfig& config_;
  const RetrievalConfig& retrieval_;
  DescriptorVote vote_;
  VoteList votes_;              // of Query
  std::vector<Entry> entries_;  // in order of insertion
  std::uint32_t next_id_ = 0;   // keyframe id at which the next query begins
  std::vector<std::size_t> chosen_;
};

}  // namespace haustra
