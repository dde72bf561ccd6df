#include "engine/engine.h"

#include "engine/io/atlas_reader.h"

namespace haustra {
namespace {

// The tracker asks for a keyframe only when the mapper is idle, but for one in need; more would be stale work.
constexpr int kMaxProposals = 3;
// Beside those of the keyframes: current and last frame, reference view, proposals, retired ones; and the frames that
// an initialisation keeps, here and in a proposal that waits.
constexpr int kSpareFeatureSets = 32;

}  // namespace

VisionPlan Engine::PlanFor(const EngineConfig& config, const CameraCalibration& calibration) {
  VisionPlan plan;
  plan.max_width_px = calibration.width_px;
  plan.max_height_px = calibration.height_px;
  plan.max_features = config.features.max;
  plan.max_feature_sets =
      config.memory.max_keyframes + kSpareFeatureSets + 2 * config.initialisation.max_reference_age_frames;
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

Engine::Engine(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, Mode mode,
               const Clock* clock, double scene_share, const Vocabulary* vocabulary)
    : config_(config),
      camera_(camera),
      link_(kMaxProposals, config.features.max, config.initialisation.max_reference_age_frames,
            config.memory.max_local_points),
      mapper_(config_, camera_, device, link_, clock, mode == Mode::kRealTime, vocabulary),
      tracker_(config_, camera_, device, link_, scene_share) {}

Status Engine::LoadAtlas(std::span<const std::uint8_t> file) {
  HAUSTRA_ASSIGN(const SavedAtlas saved, ReadAtlas(file));
  return mapper_.LoadAtlas(saved);
}

bool Engine::Resolve(const FrameResult& result, ResolvedPose* pose) const {
  if (result.reference_keyframe == kNoId) return false;
  return atlas().Resolve(result.reference_keyframe, result.cam_from_reference, result.reference_scale, pose);
}

}  // namespace haustra
