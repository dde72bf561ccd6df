// Place recognition for one new keyframe: which other piece of the atlas shows the same wall? Answers what the scout
// asks (place_scout.h): counts the votes for what looks alike, then verifies the best candidates, and before it says
// yes it hears the rivals: a second place of the same map, or of the keyframe's own, that agrees as well but lies
// elsewhere. Then the place is not distinctive and nothing is joined. Reads the task alone, never the atlas.
// thread-bound(merging), deterministic for one seed.
#pragma once

#include "engine/camera/scene_region.h"
#include "engine/noise_model.h"
#include "engine/place/common_area.h"
#include "engine/place/place_task.h"

namespace haustra {

class PlaceRecogniser {
 public:
  // Everything named outlives it.
  PlaceRecogniser(const EngineConfig& config, const CameraModel& camera, const SceneRegion& scene,
                  VisionDevice& device);

  // Fills the answer to the task's stage. A device that fails leaves entries kDeviceFailed. Cost: at most twice
  // max_candidates verifications.
  void Recognise(PlaceTask* task);

 private:
  void Verify(PlaceTask* task);
  bool HasRival(PlaceTask* task, const PlaceCandidate& accepted);

  const EngineConfig& config_;
  NoiseModel noise_;  // as of the task
  DescriptorVote vote_;
  CommonAreaVerifier verifier_;
  Rng rng_;
  CommonArea rival_;
};

}  // namespace haustra
