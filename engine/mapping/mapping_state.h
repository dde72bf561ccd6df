// What the stages of mapping share: the atlas, where in it tracking is, and what they were told. Owned by the mapper;
// whoever is given it may change the atlas. thread-bound(mapping).
#pragma once

#include <cstdint>
#include <memory_resource>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/mapping/local_bundle.h"
#include "engine/noise_model.h"
#include "engine/tracking/tracking_link.h"
#include "hal/clock.h"
#include "hal/vision_device.h"

namespace haustra {

struct MapperCounters {
  std::uint64_t num_keyframes = 0;
  std::uint64_t num_keyframes_culled = 0;
  std::uint64_t num_keyframes_refused = 0;     // pool full, and nothing in it might go
  std::uint64_t num_keyframe_ids_refused = 0;  // of these, because all ids had been given
  std::uint64_t num_maps_refused = 0;          // foundings for which the table of maps had no room
  std::uint64_t num_points_created = 0;
  std::uint64_t num_points_culled = 0;
  std::uint64_t num_points_fused = 0;
  std::uint64_t num_bundles_stopped = 0;  // before they were done: for want of time, or for a proposal that waited
  std::uint64_t num_snapshots_cut = 0;    // that had no room for all points of their window
  std::uint64_t num_foundings_refused = 0;
  std::uint64_t num_placeless = 0;              // frames without a pose whose place was looked for
  std::uint64_t num_places_skipped = 0;         // keyframes whose place was not looked for: the recogniser was busy
  std::uint64_t num_place_points_left_out = 0;  // of wider groups, for want of room in a question
  std::uint64_t num_merges_outdated = 0;        // answers that came too late to be applied
  std::uint64_t num_loops_left_open = 0;        // joins, too, that ended as CommonAreaVerdict::kNotJoined
  std::uint64_t num_reframings = 0;             // times that a map was moved: the epoch of what is published
  std::uint64_t num_reliefs_turned = 0;         // young maps that were built anew (relief_check.h)
  std::uint64_t num_marks_set = 0;
  std::uint64_t num_marks_removed = 0;
  // Time spent, for the stage table; only measured when a clock is given.
  Duration insert_time{0}, create_time{0}, fuse_time{0}, bundle_time{0}, cull_time{0}, merge_time{0};
  Duration asking_time{0};  // of place recognition: what is done on the mapping thread
  Duration place_time{0};   // all of it, wherever it ran
  Duration relocalisation_time{0}, settle_time{0};
};

struct MappingState {
  // Takes the memory of the atlas. `time` may be null: then nothing is timed, and time bounds nothing.
  MappingState(const EngineConfig& engine_config, const CameraModel& camera_model, const SceneRegion& scene_region,
               VisionDevice& vision_device, TrackingLink& tracking_link, const Clock* time, bool has_time_box,
               std::pmr::memory_resource* memory)
      : config(engine_config),
        camera(camera_model),
        scene(scene_region),
        device(vision_device),
        link(tracking_link),
        clock(time),
        is_time_boxed(has_time_box && time != nullptr),
        noise(engine_config.noise),
        atlas(CapacityOf(engine_config), memory) {}
  static Atlas::Capacity CapacityOf(const EngineConfig& engine_config) {
    const MemoryConfig& memory = engine_config.memory;
    return {memory.max_keyframes,    memory.max_map_points,      memory.max_maps,
            memory.max_keyframe_ids, engine_config.features.max, memory.max_marks};
  }

  TimePoint Now() const { return clock == nullptr ? TimePoint{} : clock->Now(); }

  // Of a bundle that may last `max_ms` in real-time mode. After `min_iterations` it ends as well when a proposal waits
  // beside the `num_known` ones that are being worked on. Sequential mode: no limits.
  LocalBundle::Limits BundleLimits(int max_ms, int num_known, int min_iterations) const {
    if (!is_time_boxed) return {};
    const auto is_awaited = [this, num_known, num_left = min_iterations]() mutable {
      return num_left-- <= 0 && link.num_pending.load(std::memory_order_acquire) > num_known;
    };
    return {clock, Now() + std::chrono::milliseconds(max_ms), is_awaited};
  }

  const EngineConfig& config;
  const CameraModel& camera;
  const SceneRegion& scene;
  VisionDevice& device;
  TrackingLink& link;
  const Clock* clock;
  bool is_time_boxed;
  NoiseModel noise;  // of the last proposal
  Atlas atlas;
  MapHandle active;       // invalid: none
  KeyframeHandle newest;  // of the active map: where tracking is
  MapHandle turned;       // the map that was built anew last (relief_check.h); invalid: none
  // A join works on copies of the seam (merger.h): no bundle may move what is there. The map settles when it is done.
  bool is_seam_open = false;
  MapperCounters counters;
};

}  // namespace haustra
