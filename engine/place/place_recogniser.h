// Place recognition for one new keyframe: which other piece of the atlas shows the same wall? Retrieves candidates
// among all keyframes of all maps that are not connected with it, verifies the best, and before it says yes it looks
// for a rival: a second place of the same map, or of the keyframe's own, that agrees as well but lies elsewhere. Then
// the place is not distinctive and nothing is joined. Reads the atlas only. thread-bound(mapping), deterministic for
// one seed.
#pragma once

#include <memory>
#include <vector>

#include "engine/place/common_area.h"
#include "engine/place/place_config.h"
#include "engine/place/retrieval.h"

namespace haustra {

struct PlaceReport {
  int num_candidates = 0;               // that retrieval proposed
  std::vector<CommonAreaCounts> tried;  // every verification, in order, with its reason
};

class PlaceRecogniser {
 public:
  // Everything named outlives it.
  PlaceRecogniser(const EngineConfig& config, const PlaceConfig& place, const CameraModel& camera, VisionDevice& device,
                  KeyframeRetrieval& retrieval);

  // True: `area` is accepted and says where. `report` is replaced either way. A device that fails gives false; the
  // report then holds an entry kDeviceFailed. Cost: one retrieval and at most twice max_candidates verifications.
  bool Recognise(const Atlas& atlas, KeyframeHandle keyframe, CommonArea* area, PlaceReport* report);

 private:
  void MarkConnected(const Atlas& atlas, KeyframeHandle keyframe);
  bool IsOnePlace(const Atlas& atlas, KeyframeHandle a, KeyframeHandle b);
  bool HasRival(const Atlas& atlas, const CommonArea& accepted, std::size_t accepted_idx, PlaceReport* report);

  const EngineConfig& config_;
  const PlaceConfig& place_;
  KeyframeRetrieval& retrieval_;
  CommonAreaVerifier verifier_;
  Rng rng_;
  std::vector<std::int32_t> strongest_;
  std::vector<RetrievalCandidate> candidates_;
  std::vector<std::uint8_t> is_tried_;      // of candidates_
  std::vector<std::uint8_t> is_connected_;  // by keyframe slot
  std::vector<KeyframeHandle> connected_;
  std::vector<Covisible> covisible_;
  CommonArea rival_;
};

}  // namespace haustra
