// The second half of a query of exhaustive retrieval (exhaustive_retrieval.h): the keyframes are chosen and the
// features that vote are listed; what is left are the matches, one small one a keyframe, which need neither index nor
// atlas.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <vector>

#include "engine/config.h"
#include "engine/place/retrieval.h"
#include "hal/vision_device.h"

namespace haustra {

// Fixed capacity, taken at construction; none when retrieval needs no votes.
struct VoteList {
  struct Entry {
    KeyframeHandle keyframe;
    KeyframeId id = kNoId;
    FeatureSetHandle set;
    std::uint32_t first = 0;  // in `features`
    std::uint32_t num = 0;
  };

  VoteList(const EngineConfig& config, const RetrievalConfig& retrieval, std::pmr::memory_resource* memory);
  static std::size_t BytesFor(const EngineConfig& config, const RetrievalConfig& retrieval);
  // Features of one view that vote, at most.
  static std::size_t MaxVoters(const EngineConfig& config, const RetrievalConfig& retrieval);

  void Clear() {
    query.clear();
    entries.clear();
    features.clear();
  }

  FeatureSetHandle query_set;
  int max_results = 0;
  std::pmr::vector<std::int32_t> query;  // features of the view that vote
  std::pmr::vector<Entry> entries;
  std::pmr::vector<std::int32_t> features;  // of all entries
};

// thread-bound(mapping or merging, whoever has it).
class DescriptorVote {
 public:
  // The configurations and the device outlive it.
  DescriptorVote(const EngineConfig& config, const RetrievalConfig& retrieval, VisionDevice& device);
  static std::size_t BytesFor(const RetrievalConfig& retrieval);

  // As KeyframeRetrieval::Query.
  Status Count(const VoteList& list, std::vector<RetrievalCandidate>* out);

 private:
  // Requests queued on the device before the first is waited for.
  static constexpr int kBatch = 16;

  struct Slot {
    std::size_t entry_idx = 0;
    Ticket ticket;
    std::int32_t num_matches = 0;
    std::vector<Match> matches;
  };

  Status CountBatch(const VoteList& list, std::size_t begin, std::size_t end, std::vector<RetrievalCandidate>* out);

  const EngineConfig& config_;
  const RetrievalConfig& retrieval_;
  VisionDevice& device_;
  std::vector<Slot> slots_;
};

}  // namespace haustra
