// Which keyframes of the atlas look like a given view: the first, cheap step of relocalisation, merging and loop
// closing. It may err in both directions; what it proposes is verified by geometry (common_area.h, relocaliser.h).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

struct RetrievalQuery {
  FeatureSetHandle set;                     // of the view
  std::span<const std::int32_t> strongest;  // its features that may vote, strongest first
  int max_results = 10;                     // [1, ...)
  // Keyframes for which this is true are left out; may be empty. It must not change the atlas.
  std::function<bool(KeyframeHandle, const Keyframe&)> is_excluded;
};

struct RetrievalCandidate {
  KeyframeHandle keyframe;
  double score = 0.0;  // the larger the more alike, in [0, 1]; comparable within one query only
  int num_votes = 0;   // matched descriptors or shared words
  KeyframeId id = kNoId;
};

struct VoteList;

// thread-bound(mapping). Deterministic: the same calls in the same order give the same answers.
class KeyframeRetrieval {
 public:
  virtual ~KeyframeRetrieval() = default;

  // Every keyframe once, after its insertion into the atlas, and when it leaves it (before its feature set is
  // released). Moving, merging and optimising maps changes nothing here.
  virtual Status Add(const Atlas& atlas, KeyframeHandle keyframe) = 0;
  virtual void Remove(KeyframeHandle keyframe) = 0;

  // The best matching keyframes, best first (ties: older first). Replaces `out`; on error it is empty. Errors are those
  // of the device.
  virtual Status Query(const Atlas& atlas, const RetrievalQuery& query, std::vector<RetrievalCandidate>* out) = 0;

  // As Query, but what takes long and needs neither index nor atlas is left for another thread: the answer is `out`, or
  // when `votes` is not empty, what DescriptorVote::Count makes of it (descriptor_vote.h).
  virtual Status Prepare(const Atlas& atlas, const RetrievalQuery& query, VoteList* votes,
                         std::vector<RetrievalCandidate>* out) = 0;
};

}  // namespace haustra
