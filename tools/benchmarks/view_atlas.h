// An atlas of recorded views instead of mapped keyframes: each sequence is a map, each view a keyframe at its true
// place, and features that match from one view to the next have a map point, as mapping would give them. For benchmarks
// of retrieval: what is found does not depend on how a run went.
#pragma once

#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/config.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"
#include "tools/benchmarks/recorded_views.h"

namespace haustra::benchmarks {

struct PlacedView {
  KeyframeHandle keyframe;
  const RecordedView* view = nullptr;
  double depth = 0.0;  // median distance of what it sees, by triangulation with the true poses; 0: not known
};

class ViewAtlas {
 public:
  // `config` and the device, which holds the views' features, outlive it. max_views: of all sequences.
  ViewAtlas(const EngineConfig& config, int max_views, VisionDevice& device);

  // The clear views among every `step`-th as a new map, in order. Errors: the device's;
  // kCapacityExceeded.
  Result<std::vector<PlacedView>> AddSequence(const RecordedSequence& sequence, int step);

  const Atlas& atlas() const { return atlas_; }

 private:
  Status Connect(MapHandle map, PlacedView* earlier, PlacedView* later);

  const EngineConfig& config_;
  VisionDevice& device_;
  Atlas atlas_;
  std::vector<Match> matches_;
};

}  // namespace haustra::benchmarks
