// The SLAM engine: the only header of engine/ that a program needs to run it.
//
//   Engine engine(config, camera, device, Engine::Mode::kSequential, nullptr, 1.0);
//   for each frame: FrameResult result = engine.Track(frame, kNoDeadline); while (engine.MapStep()) {}
//   engine.Resolve(result, &pose)   // final pose, any time later
//
// Sequential: one thread calls Track and MapStep in turn; the results repeat to the bit for the same frames,
// configuration and device. Real time: one thread calls Track only, another MapStep only; they share no lock
// (tracker.h, mapper.h). The engine knows no file, camera or GPU: frames come in as views, the device is handed in.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/mapping/mapper.h"
#include "engine/tracking/frame_result.h"
#include "engine/tracking/tracker.h"
#include "hal/clock.h"
#include "hal/vision_device.h"

namespace haustra {

class Engine {
 public:
  enum class Mode { kSequential, kRealTime };

  // What the vision device must be planned for.
  static VisionPlan PlanFor(const EngineConfig& config, const CameraCalibration& calibration);
  static ExtractOptions ExtractOptionsFor(const EngineConfig& config);

  // `device` is planned by PlanFor and outlives the engine. `clock` (may be null) times the stages of the mapper, and
  // in real-time mode boxes its work. Takes all its memory here.
  // scene_share: part of the image's area inside the scope's window (static mask), (0, 1].
  // `vocabulary` fits the configuration and outlives the engine; null unless config.place.retrieval asks for one
  // (engine/place/make_retrieval.h).
  Engine(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, Mode mode, const Clock* clock,
         double scene_share, const Vocabulary* vocabulary = nullptr);

  // Before the first frame: the maps of an atlas file (engine/io/atlas_format.h) become stored maps of this engine,
  // which tracking may find itself in and maps of this run may be joined with. Nothing is changed on error:
  // kInvalidArgument (not an atlas file), kDataLoss (damaged), kFailedPrecondition (other version, camera or
  // descriptors), kCapacityExceeded (a pool is too small).
  Status LoadAtlas(std::span<const std::uint8_t> file);
  // All maps, for LoadAtlas. Mapping thread between two steps, or any when both have stopped. Errors of the sink.
  Status SaveAtlas(ByteSink& sink) const { return mapper_.SaveAtlas(sink); }

  // Tracking thread. rt-safe.
  FrameResult Track(const Frame& frame, TimePoint deadline) { return tracker_.Track(frame, deadline); }
  FrameResult SkipDamaged(std::uint32_t frame_index, TimePoint timestamp) {
    return tracker_.SkipDamaged(frame_index, timestamp);
  }

  // Mapping thread. False when there was nothing to do.
  bool MapStep() { return mapper_.Step(); }

  // Mapping thread, or any when both have stopped.
  const Atlas& atlas() const { return mapper_.atlas(); }
  const MapperCounters& mapper_counters() const { return mapper_.counters(); }
  SpscRing<MapEvent>& map_events() { return mapper_.events(); }
  SpscRing<LatePose>& late_poses() { return mapper_.late_poses(); }
  // The pose of a frame in the map that it belongs to now. False when it was never tracked or its map was dropped.
  bool Resolve(const FrameResult& result, ResolvedPose* pose) const;

  const CameraModel& camera() const { return camera_; }
  const EngineConfig& config() const { return config_; }

 private:
  EngineConfig config_;
  CameraModel camera_;
  TrackingLink link_;
  Mapper mapper_;
  Tracker tracker_;
};

}  // namespace haustra
