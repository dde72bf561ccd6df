// The SLAM engine: the only header of engine/ that a program needs to run it.
//
//   Engine engine(config, camera, device, Engine::Mode::kSequential, nullptr, mask);
//   for each frame: FrameResult result = engine.Track(frame, kNoDeadline); while (engine.BackgroundStep()) {}
//   engine.Resolve(result, &pose)   // final pose, any time later
//
// Sequential: one thread calls Track and BackgroundStep in turn; the results repeat to the bit for the same frames,
// configuration and device. Real time: one thread calls Track and KeepPicture only, another MapStep only, a third
// MergeStep only, a fourth DepthStep only. Tracking shares no lock with the others (tracker.h, mapper.h,
// task_mailbox.h). The engine knows no file, camera or GPU: frames come in as views, the device is handed in.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/camera/scene_region.h"
#include "engine/config.h"
#include "engine/depth/depth_keeper.h"
#include "engine/mapping/mapper.h"
#include "engine/place/place_mailbox.h"
#include "engine/place/place_recogniser.h"
#include "engine/scheduler/background_gate.h"
#include "engine/scheduler/gated_vision_device.h"
#include "engine/scheduler/shared_lane_device.h"
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
  // What an engine of this configuration takes on the host for pictures of this size, pool by pool; the vision device
  // and the matcher of depths have plans of their own.
  static MemoryPlan PlanMemory(const EngineConfig& config, int width_px, int height_px);

  // `device` is planned by PlanFor and outlives the engine. `clock` (may be null) times the stages of tracker and
  // mapper; in real-time mode it boxes the mapper's work and tells the tracker what it has time for. Takes all its
  // memory here: one arena for the pools, and workspaces on the heap. Throws std::bad_alloc; CheckFits(PlanMemory)
  // tells beforehand. scene_mask: see SceneRegion.
  // `vocabulary` fits the configuration and outlives the engine; null unless config.place.retrieval asks for one
  // (engine/place/make_retrieval.h). `depth` is made with config.depth.options() for this camera and outlives the
  // engine; null unless config.depth.enabled asks for one.
  Engine(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, Mode mode, const Clock* clock,
         ImageView scene_mask, const Vocabulary* vocabulary = nullptr, DepthMatcher* depth = nullptr);

  // Before the first frame: the maps of an atlas file (engine/io/atlas_format.h) become stored maps of this engine,
  // which tracking may find itself in and maps of this run may be joined with. Their keyframes get new ids, from 0 on:
  // each run has all ids of memory.max_keyframe_ids but those. Nothing is changed on error:
  // kInvalidArgument (not an atlas file), kDataLoss (damaged), kFailedPrecondition (other version, camera or
  // descriptors), kCapacityExceeded (a pool is too small).
  Status LoadAtlas(std::span<const std::uint8_t> file);
  // All maps, for LoadAtlas. Mapping thread between two steps, or any when both have stopped. Errors of the sink.
  Status SaveAtlas(ByteSink& sink) const { return mapper_.SaveAtlas(sink); }

  // Any thread, when all have stopped: frames will be numbered anew. What was mapped stays; frames that were answered
  // before can no longer be marked.
  void BeginSession() { mapper_.BeginSession(); }
  // Tracking thread, before its first frame: threads of the device that work for it take on its policy and priority.
  // kFailedPrecondition: the system refuses.
  Status ServeThisThread() { return tracker_.ServeThisThread(); }
  // Tracking thread. rt-safe. deadline: when the pose must be there (engine/scheduler), kNoDeadline in sequential mode.
  // next_due: when the next frame is expected; the mapper keeps an accelerator free for it. The frame's pixels stay
  // until MayReleaseFrame.
  FrameResult Track(const Frame& frame, TimePoint deadline, TimePoint next_due = kNoDeadline);
  // Tracking thread, after the answer to this frame was given. rt-safe: copies the picture of a keyframe, whose depth
  // is searched later; nothing without config.depth.enabled.
  void KeepPicture(const Frame& frame, const FrameResult& result);
  // False: the device still reads the last frame at `until`. Always true without a deadline.
  bool MayReleaseFrame(TimePoint until) { return tracker_.MayReleaseFrame(until); }
  // Tracking thread, after Track. rt-safe. See Tracker.
  std::size_t MatchedPixels(std::span<Eigen::Vector2f> to) const { return tracker_.MatchedPixels(to); }
  FrameResult SkipDamaged(std::uint32_t frame_index, TimePoint timestamp) {
    return tracker_.SkipDamaged(frame_index, timestamp);
  }

  // Mapping thread between two steps, or any when both have stopped: a doctor's mark in a frame that was tracked
  // (engine/mapping/mark_keeper.h has the errors), and its end. From the next frame on it is seen in mark_sightings().
  Result<MarkId> SetMark(const MarkRequest& request) { return mapper_.SetMark(request); }
  Status RemoveMark(std::string_view label) { return mapper_.RemoveMark(label); }
  // Tracking thread: all marks of the map in which the last frame was tracked, as of its answer.
  const MarkSightings& mark_sightings() const { return tracker_.mark_sightings(); }

  // Mapping thread. False when there was nothing to do. What the depth of keyframes asks for comes last.
  bool MapStep(MapWork work = MapWork::kAll);
  // Merging thread: answers what mapping asks about places (engine/place). False when there was nothing to do.
  bool MergeStep();
  // Any thread. Merging has something to do; mapping has asked something whose answer it has not yet taken.
  bool has_merge_work() const { return places_.has_question(); }
  bool is_merging() const { return places_.is_out(); }
  // Depth thread: searches the depth of a keyframe (engine/depth). False when there was nothing to do, or it is
  // stopped.
  bool DepthStep();
  // Any thread. DepthStep has something to do.
  bool has_depth_work() const { return depth_ && depth_->mailbox.has_question(); }
  // Any thread. When it is stopped DepthStep ends within milliseconds, and what it was at is asked again.
  void StopDepth(bool stop) {
    if (depth_) depth_->is_stopped.store(stop, std::memory_order_relaxed);
  }
  // All in turn, on one thread: every question is answered before mapping goes on.
  bool BackgroundStep() { return MergeStep() || MapStep() || DepthStep(); }
  // Any thread, when all have stopped: no frame will come any more. Searches what was still to come, and tries once
  // more what knew too little in its turn. Takes as many seconds as DepthStep does for all kept pictures; ends early
  // when `stop` becomes true.
  void FinishDepth(const std::atomic<bool>& stop);

  // Mapping thread, or any when both have stopped.
  const Atlas& atlas() const { return mapper_.atlas(); }
  const MapperCounters& mapper_counters() const { return mapper_.counters(); }
  // Any thread.
  PoolUse pool_use() const { return mapper_.pool_use(); }
  // Mapping thread, or any when both have stopped. Null: no depth is searched.
  const DepthKeeper* depths() const { return depth_ ? &depth_->keeper : nullptr; }
  // Keyframes whose pictures found the ring full. Exact when both threads have stopped.
  std::uint64_t num_pictures_refused() const { return depth_ ? depth_->pictures.num_dropped() : 0; }
  const EvictionCounters& evictions() const { return mapper_.evictions(); }
  const MemoryArena& arena() const { return arena_; }
  std::uint64_t max_proposals() const { return link_.proposals.capacity(); }
  // Proposals that found the ring full. Exact when both threads have stopped.
  std::uint64_t num_proposals_refused() const { return link_.proposals.num_dropped(); }
  // Frames for which the device had no feature set left. Any thread.
  std::uint64_t num_feature_sets_refused() const { return tracker_.num_sets_refused(); }
  SpscRing<MapEvent>& map_events() { return mapper_.events(); }
  SpscRing<LatePose>& late_poses() { return mapper_.late_poses(); }
  // The pose of a frame in the map that it belongs to now. False when it was never tracked or its map was dropped.
  bool Resolve(const FrameResult& result, ResolvedPose* pose) const;

  const CameraModel& camera() const { return camera_; }
  const EngineConfig& config() const { return config_; }

 private:
  struct Depth {
    Depth(const EngineConfig& config, const CameraModel& camera, const Atlas& atlas, DepthMatcher& depth_matcher,
          std::pmr::memory_resource* memory);
    ~Depth();
    Depth(const Depth&) = delete;  // the matcher looks at it

    DepthMatcher& matcher;
    PictureRing pictures;  // tracking to mapping
    DepthMailbox mailbox;  // mapping to depth and back
    DepthKeeper keeper;
    std::atomic<bool> is_stopped{false};
  };

  VisionDevice& BackgroundDevice(VisionDevice& device, Mode mode);

  EngineConfig config_;
  CameraModel camera_;
  const Clock* clock_;
  MemoryArena arena_;  // of everything below
  SceneRegion scene_;
  TrackingLink link_;
  PlaceMailbox places_;
  // Real-time mode only; the gate on an accelerator only.
  std::optional<BackgroundGate> gate_;
  std::optional<GatedVisionDevice> gated_device_;
  std::optional<SharedLaneDevice> shared_device_;
  VisionDevice& background_device_;
  Mapper mapper_;
  std::optional<Depth> depth_;
  PlaceRecogniser recogniser_;
  Tracker tracker_;
};

}  // namespace haustra
