#include "engine/engine.h"

#include "engine/io/atlas_reader.h"
#include "hal/core/check.h"

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
                          kInitialisations * config.initialisation.kept_views;
  plan.max_match_list = std::max(config.memory.max_local_points, config.features.max);
  plan.extracts_in_background = false;
  return plan;
}

ExtractOptions Engine::ExtractOptionsFor(const EngineConfig& config) {
  ExtractOptions options;
  options.num_features = config.features.num_detected();
  options.contrast_threshold = static_cast<float>(config.features.contrast_threshold);
  options.edge_threshold = static_cast<float>(config.features.edge_threshold);
  options.reflection_threshold = config.features.reflection_threshold;
  options.border_threshold = config.features.border_threshold;
  options.mask_dilation_px = config.features.mask_dilation_px;
  options.root_sift = config.features.root_sift;
  options.upright_dark = config.features.upright_dark;
  return options;
}

MemoryPlan Engine::PlanMemory(const EngineConfig& config, int width_px, int height_px) {
  MemoryPlan plan = Mapper::PlanMemory(config);
  plan.Append(TrackingLink::PlanMemory(config));
  plan.Append(Tracker::PlanMemory(config));
  plan.Add(MemoryPlace::kHostArena, "scene region", 1, SceneRegion::BytesFor(width_px, height_px), "image size");
  plan.Add(MemoryPlace::kHostArena, "place recognition", static_cast<std::uint64_t>(PlaceTask::MaxCandidates(config)),
           PlaceTask::BytesFor(config),
           "features.max, memory.max_keyframes, recognition.max_candidates, common_area.group_size, "
           "common_area.confirming_keyframes, retrieval.max_keyframes_per_query, retrieval.max_descriptors");
  if (config.depth.enabled) plan.Append(DepthKeeper::PlanMemory(config, width_px, height_px));
  return plan;
}

Engine::Engine(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, Mode mode,
               const Clock* clock, ImageView scene_mask, const Vocabulary* vocabulary, DepthMatcher* depth)
    : config_(config),
      camera_(camera),
      clock_(clock),
      arena_(PlanMemory(config, camera.width_px(), camera.height_px()).bytes(MemoryPlace::kHostArena)),
      scene_(camera_, scene_mask, &arena_),
      link_(config_, &arena_),
      places_(config_, &arena_),
      background_device_(BackgroundDevice(device, mode)),
      mapper_(config_, camera_, scene_, background_device_, link_, places_, clock, mode == Mode::kRealTime, vocabulary,
              &arena_),
      recogniser_(config_, camera_, scene_, background_device_),
      tracker_(config_, camera_, scene_, device, link_, clock, &arena_) {
  HAUSTRA_CHECK((depth != nullptr) == config.depth.enabled);
  if (depth == nullptr) return;
  depth_.emplace(config_, camera_, mapper_.atlas(), *depth, &arena_);
}

Engine::Depth::Depth(const EngineConfig& config, const CameraModel& camera, const Atlas& atlas,
                     DepthMatcher& depth_matcher, std::pmr::memory_resource* memory)
    : matcher(depth_matcher),
      pictures(kHandedPictures, memory, camera.width_px(), camera.height_px(), memory),
      mailbox(matcher.width(), matcher.height(), config.features.max, memory),
      keeper(config, camera, atlas, pictures, mailbox, memory) {
  matcher.StopWhen(&is_stopped);
}

Engine::Depth::~Depth() { matcher.StopWhen(nullptr); }

// The device that mapping and merging work with.
VisionDevice& Engine::BackgroundDevice(VisionDevice& device, Mode mode) {
  if (mode == Mode::kSequential) return device;
  VisionDevice* next = &device;
  if (clock_ != nullptr && config_.scheduler.background_gap && device.is_accelerator()) {
    gate_.emplace(*clock_, config_.scheduler.quantile);
    next = &gated_device_.emplace(device, *gate_, *clock_);
  }
  return shared_device_.emplace(*next);
}

bool Engine::MapStep(MapWork work) {
  if (mapper_.Step(work)) return true;
  if (!depth_) return false;
  return work == MapWork::kAll ? depth_->keeper.Step() : depth_->keeper.TakeIn();
}

bool Engine::MergeStep() {
  PlaceTask* task = places_.Asked();
  if (task == nullptr) return false;
  const TimePoint start = clock_ == nullptr ? TimePoint{} : clock_->Now();
  recogniser_.Recognise(task);
  if (clock_ != nullptr) task->merging_duration += clock_->Now() - start;
  places_.Answer();
  return true;
}

bool Engine::DepthStep() {
  if (!depth_ || depth_->is_stopped.load(std::memory_order_relaxed)) return false;
  DepthTask* task = depth_->mailbox.Asked();
  if (task == nullptr) return false;
  const TimePoint start = clock_ == nullptr ? TimePoint{} : clock_->Now();
  const std::span<const DepthView> sources{task->sources.data(), task->sources.size()};
  task->status = depth_->matcher.Match(task->reference, sources, task->seeds, &task->depth);
  task->duration = clock_ == nullptr ? Duration{0} : clock_->Now() - start;
  depth_->mailbox.Answer();
  return true;
}

void Engine::FinishDepth(const std::atomic<bool>& stop) {
  if (!depth_) return;
  depth_->keeper.SetFinishing(true);
  while (!stop.load(std::memory_order_relaxed) && BackgroundStep()) {
  }
  depth_->keeper.SetFinishing(false);
}

void Engine::KeepPicture(const Frame& frame, const FrameResult& result) {
  if (!depth_ || !(result.is_keyframe || result.reason == TrackingReason::kMapProposed)) return;
  HandedPicture* picture = depth_->pictures.BeginPush();
  if (picture != nullptr && picture->Copy(frame)) depth_->pictures.CommitPush();
}

FrameResult Engine::Track(const Frame& frame, TimePoint deadline, TimePoint next_due) {
  if (gate_) gate_->FrameBegins();
  const FrameResult result = tracker_.Track(frame, deadline);
  if (gate_) gate_->FrameEnds(next_due);
  return result;
}

Status Engine::LoadAtlas(std::span<const std::uint8_t> file) {
  HAUSTRA_ASSIGN(SavedAtlas saved, ReadAtlas(file));
  RenumberKeyframes(&saved);
  return mapper_.LoadAtlas(saved);
}

bool Engine::Resolve(const FrameResult& result, ResolvedPose* pose) const {
  if (result.reference_keyframe == kNoId) return false;
  return atlas().Resolve(result.reference_keyframe, result.cam_from_reference, result.reference_scale, pose);
}

}  // namespace haustra
