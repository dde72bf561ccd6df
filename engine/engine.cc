#include "engine/engine.h"

#include "engine/io/atlas_reader.h"

namespace haustra {
namespace {

// An initialisation keeps the frames between its views, and so does a proposal that waits.
constexpr int kInitialisations = 2;

}  // namespace

VisionPlan Engine::PlanFor(const EngineConfig& config, const CameraCalibration& calibration) {
  VisionPlan plan;
  plan.max_width_px = calibration.width_px;
  plan.max_height_px = calibration.height_px;
  plan.max_features = config.features.max;
  plan.max_feature_sets = config.memory.max_keyframes + config.memory.spare_feature_sets +
                          kInitialisations * config.initialisation.max_reference_age_frames;
  plan.max_match_list = std::max(config.memory.max_local_points, config.features.max);
  return plan;
}

ExtractOptions Engine::ExtractOptionsFor(const EngineConfig& config) {
  ExtractOptions options;
  options.num_features = config.features.max;
  options.contrast_threshold = static_cast<float>(config.features.contrast_threshold);
  options.edge_threshold = static_cast<float>(config.features.edge_threshold);
  options.reflection_threshold = config.features.reflection_threshold;
  options.border_threshold = config.features.border_threshold;
  options.mask_dilation_px = config.features.mask_dilation_px;
  options.root_sift = config.features.root_sift;
  return options;
}

MemoryPlan Engine::PlanMemory(const EngineConfig& config) {
  MemoryPlan plan = Mapper::PlanMemory(config);
  plan.Append(TrackingLink::PlanMemory(config.memory.max_proposals, config.features.max,
                                       config.initialisation.max_reference_age_frames, config.memory.max_local_points));
  plan.Append(Tracker::PlanMemory(config));
  return plan;
}

Engine::Engine(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, Mode mode,
               const Clock* clock, double scene_share, const Vocabulary* vocabulary)
    : config_(config),
      camera_(camera),
      arena_(PlanMemory(config).bytes(MemoryPlace::kHostArena)),
      link_(config.memory.max_proposals, config.features.max, config.initialisation.max_reference_age_frames,
            config.memory.max_local_points, &arena_),
      mapper_(config_, camera_, GateFor(device, mode, clock), link_, clock, mode == Mode::kRealTime, vocabulary,
              &arena_),
      tracker_(config_, camera_, device, link_, clock, scene_share, &arena_) {}

// The device that the mapper works with.
VisionDevice& Engine::GateFor(VisionDevice& device, Mode mode, const Clock* clock) {
  const bool has_gap = mode == Mode::kRealTime && clock != nullptr && config_.scheduler.background_gap;
  if (!has_gap || !device.is_accelerator()) return device;
  gate_.emplace(*clock, config_.scheduler.quantile);
  return gated_device_.emplace(device, *gate_, *clock);
}

FrameResult Engine::Track(const Frame& frame, TimePoint deadline, TimePoint next_due) {
  if (gate_) gate_->FrameBegins();
  const FrameResult result = tracker_.Track(frame, deadline);
  if (gate_) gate_->FrameEnds(next_due);
  return result;
}

Status Engine::LoadAtlas(std::span<const std::uint8_t> file) {
  HAUSTRA_ASSIGN(const SavedAtlas saved, ReadAtlas(file));
  return mapper_.LoadAtlas(saved);
}

bool Engine::Resolve(const FrameResult& result, ResolvedPose* pose) const {
  if (result.reference_keyframe == kNoId) return false;
  return atlas().Resolve(result.reference_keyframe, result.cam_from_reference, result.reference_scale, pose);
}

}  // namespace haustra
