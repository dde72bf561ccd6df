#include "kernels/cpu/cpu_vision_device.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <new>
#include <optional>
#include <string>

#include "kernels/common/request_checks.h"
#include "kernels/cpu/brute_force_matcher.h"
#include "kernels/cpu/feature_set_pool.h"
#include "kernels/cpu/guided_matcher.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/sift_extractor.h"

namespace haustra {
namespace kernels {
namespace {

constexpr int kMaxThreads = 64;

class CpuVisionDevice final : public VisionDevice, private FeatureCounts {
 public:
  CpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options, int num_threads, SimdLevel level)
      : plan_(plan),
        max_list_(std::max(plan.max_features, plan.max_match_list)),
        name_("cpu-" + std::string(ToString(level))),
        pool_(num_threads),
        sets_(plan),
        static_mask_(static_cast<std::size_t>(plan.max_width_px) * plan.max_height_px) {
    for (int i = 0; i < static_cast<int>(Lane::kNumLanes); ++i) {
      const Lane lane = static_cast<Lane>(i);
      LaneWork& work = lanes_[i].emplace(plan, max_list_, options, level, pool_, lane, sets_);
      if (lane == Lane::kTracking) {
        work.extractor->Prefault();
        work.brute_force.Prefault();
        work.guided.Prefault();
      }
    }
  }

  std::string_view name() const override { return name_; }
  const VisionPlan& plan() const override { return plan_; }

  Status SetStaticMask(ImageView mask) override {
    if (mask.is_empty()) {
      static_mask_view_ = {};
      return Status::Ok();
    }
    if (mask.format != PixelFormat::kGrey8) return InvalidArgument("static mask must be an 8-bit grey image");
    HAUSTRA_TRY(CheckImageSize(mask, plan_, "static mask"));
    for (int y = 0; y < mask.height; ++y) {
      std::memcpy(static_mask_.data() + static_cast<std::size_t>(y) * mask.width, mask.row(y), mask.width);
    }
    static_mask_view_ = {static_mask_.data(), mask.width, mask.height, mask.width, PixelFormat::kGrey8};
    return Status::Ok();
  }

  Result<FeatureSetHandle> CreateFeatureSet() override {
    const FeatureSetHandle handle = sets_.Create();
    if (!handle.is_valid()) return Status(StatusCode::kCapacityExceeded);  // a message would allocate
    return handle;
  }

  bool RetainFeatureSet(FeatureSetHandle set) override { return sets_.Retain(set); }
  void ReleaseFeatureSet(FeatureSetHandle set) override { sets_.Release(set); }
  std::int32_t num_free_feature_sets() const override { return sets_.num_free(); }

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    HAUSTRA_TRY(CheckExtractRequest(lane, request, plan_, static_mask_view_.width, static_mask_view_.height));
    bool is_stale = false;
    FeatureSet* set = sets_.BeginWrite(request.set, &is_stale);
    if (set == nullptr) return WriteRefused(is_stale);

    const int num_features = WorkOf(lane).extractor->Extract(request.image, static_mask_view_, request.max_features,
                                                             request.min_scale_px, *set);
    std::copy_n(set->keypoints, num_features, request.keypoints.data());
    *request.num_keypoints = num_features;
    sets_.Publish(request.set, num_features);
    return NextTicket();
  }

  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    HAUSTRA_TRY(CheckMatchRequest(request, plan_, *this));
    *request.num_matches = WorkOf(lane).brute_force.Match(request);
    return NextTicket();
  }

  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    HAUSTRA_TRY(CheckGuidedMatchRequest(request, plan_, *this));
    *request.num_matches = WorkOf(lane).guided.Match(request);
    return NextTicket();
  }

  Status Wait(Ticket ticket, TimePoint) override {
    if (ticket.value == 0 || ticket.value > last_ticket_.load(std::memory_order_relaxed)) {
      return InvalidArgument("ticket " + std::to_string(ticket.value) + " was never given out");
    }
    return Status::Ok();
  }

  Status ReadDescriptors(FeatureSetHandle handle, std::span<std::uint8_t> out) override {
    const FeatureSet* set = sets_.Get(handle);
    if (set == nullptr) return InvalidArgument("descriptors to read: stale or invalid feature set");
    const std::size_t num_bytes = static_cast<std::size_t>(set->num_features) * kDescriptorBytes;
    if (out.size() < num_bytes) {
      return InvalidArgument("room for " + std::to_string(out.size()) + " bytes of descriptors, the set has " +
                             std::to_string(num_bytes));
    }
    if (num_bytes > 0) std::memcpy(out.data(), set->descriptors, num_bytes);
    return Status::Ok();
  }

  Status WriteFeatures(FeatureSetHandle handle, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override {
    HAUSTRA_TRY(CheckFeaturesToWrite(keypoints, descriptors, plan_));
    bool is_stale = false;
    FeatureSet* set = sets_.BeginWrite(handle, &is_stale);
    if (set == nullptr) return WriteRefused(is_stale);
    std::copy(keypoints.begin(), keypoints.end(), set->keypoints);
    std::copy(descriptors.begin(), descriptors.end(), set->descriptors);
    sets_.Publish(handle, static_cast<std::int32_t>(keypoints.size()));
    return Status::Ok();
  }

 private:
  // Everything that work on one lane writes to.
  struct LaneWork {
    LaneWork(const VisionPlan& plan, int max_list, const ExtractOptions& options, SimdLevel level, LanePool& pool,
             Lane lane, const FeatureSetPool& sets)
        : brute_force(max_list, sets, level, pool, lane), guided(plan, sets, level, pool, lane) {
      if (Extracts(lane, plan)) extractor.emplace(plan, options, level, pool, lane);
    }

    std::optional<SiftExtractor> extractor;  // when the lane extracts
    BruteForceMatcher brute_force;
    GuidedMatcher guided;
  };

  std::int32_t NumFeatures(FeatureSetHandle handle) const override {
    const FeatureSet* set = sets_.Get(handle);
    return set != nullptr ? set->num_features : -1;
  }

  static Status WriteRefused(bool is_stale) {
    if (is_stale) return InvalidArgument("feature set to write: stale or invalid handle");
    return FailedPrecondition("feature set to write was written before; a set is written once");
  }

  LaneWork& WorkOf(Lane lane) { return *lanes_[static_cast<int>(lane)]; }
  Ticket NextTicket() { return Ticket{last_ticket_.fetch_add(1, std::memory_order_relaxed) + 1}; }

  const VisionPlan plan_;
  const int max_list_;
  const std::string name_;
  LanePool pool_;
  FeatureSetPool sets_;
  AlignedBuffer<std::uint8_t> static_mask_;
  ImageView static_mask_view_;
  std::optional<LaneWork> lanes_[static_cast<int>(Lane::kNumLanes)];
  std::atomic<std::uint64_t> last_ticket_{0};
};

}  // namespace
}  // namespace kernels

MemoryPlan PlanCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options, int num_threads) {
  const auto num_lanes = static_cast<std::uint64_t>(Lane::kNumLanes);
  const auto num_extracting = static_cast<std::uint64_t>(kernels::NumExtractingLanes(plan));
  MemoryPlan memory;
  const auto add = [&memory](const char* pool, std::uint64_t count, std::uint64_t bytes, const char* sized_by) {
    memory.Add(MemoryPlace::kHost, pool, count, bytes, sized_by);
  };
  add("feature sets (cpu)", plan.max_feature_sets, kernels::FeatureSetPool::BytesFor(plan),
      "memory.max_keyframes x features.max");
  add("extraction (cpu)", num_extracting,
      num_extracting * kernels::SiftExtractor::BytesFor(plan, options, num_threads) +
          kernels::AlignedBuffer<std::uint8_t>::BytesFor(static_cast<std::size_t>(plan.max_width_px) *
                                                         plan.max_height_px),
      "image size");
  add("matching (cpu)", num_lanes,
      num_lanes * (kernels::BruteForceMatcher::BytesFor(std::max(plan.max_features, plan.max_match_list), num_threads) +
                   kernels::GuidedMatcher::BytesFor(plan)),
      "memory.max_local_points, features.max; one for each lane");
  return memory;
}

Result<std::unique_ptr<VisionDevice>> CreateCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                            int num_threads) {
  return CreateCpuVisionDevice(plan, options, num_threads, kernels::BestSimdLevel());
}

Result<std::unique_ptr<VisionDevice>> CreateCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                            int num_threads, kernels::SimdLevel level) {
  HAUSTRA_TRY(kernels::CheckPlan(plan));
  HAUSTRA_TRY(kernels::CheckExtractOptions(options, plan));
  if (num_threads < 1 || num_threads > kernels::kMaxThreads) {
    return InvalidArgument("num_threads = " + std::to_string(num_threads) + " is out of range, must be in [1, 64]");
  }
  if (!kernels::IsSupported(level)) {
    return Unavailable("this processor has no " + std::string(kernels::ToString(level)));
  }
  try {
    return std::unique_ptr<VisionDevice>(new kernels::CpuVisionDevice(plan, options, num_threads, level));
  } catch (const std::bad_alloc&) {
    return CapacityExceeded("not enough memory for " + std::to_string(plan.max_feature_sets) + " feature sets of " +
                            std::to_string(plan.max_features) + " features and images of " +
                            std::to_string(plan.max_width_px) + "x" + std::to_string(plan.max_height_px));
  }
}

}  // namespace haustra
