#include "kernels/cpu/cpu_vision_device.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>
#include <optional>
#include <string>
#include <system_error>

#include "kernels/common/lane_requests.h"
#include "kernels/common/request_checks.h"
#include "kernels/cpu/brute_force_matcher.h"
#include "kernels/cpu/feature_set_pool.h"
#include "kernels/cpu/guided_matcher.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/sift_extractor.h"

namespace haustra {
namespace kernels {
namespace {

class CpuVisionDevice final : public VisionDevice, private FeatureCounts {
 public:
  CpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options, int num_threads, SimdLevel level)
      : plan_(plan),
        max_list_(std::max(plan.max_features, plan.max_match_list)),
        name_("cpu-" + std::string(ToString(level))),
        sets_(plan),
        static_mask_(static_cast<std::size_t>(plan.max_width_px) * plan.max_height_px) {
    for (int i = 0; i < static_cast<int>(Lane::kNumLanes); ++i) {
      const Lane lane = static_cast<Lane>(i);
      LaneWork& work = lanes_[i].emplace(plan, max_list_, options, level, num_threads, lane, sets_);
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
    LaneWork& work = WorkOf(lane);
    HAUSTRA_TRY(CheckPlacesToFollow(request, plan_, work.extractor->width_px(), work.extractor->height_px()));
    Settle(work);
    bool is_stale = false;
    FeatureSet* set = sets_.BeginWrite(request.set, &is_stale);
    if (set == nullptr) return WriteRefused(is_stale);
    // The caller may release it after a wait that gave up.
    sets_.Retain(request.set);
    work.kind = WorkKind::kExtraction;
    work.extract = request;
    work.set = set;
    work.extractor->Begin(request, static_mask_view_, *set);
    return NextTicket(lane);
  }

  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    LaneWork& work = WorkOf(lane);
    Settle(work);
    HAUSTRA_TRY(CheckMatchRequest(request, plan_, *this));
    work.kind = WorkKind::kMatching;
    work.num_matches = request.num_matches;
    work.brute_force.Begin(request);
    return NextTicket(lane);
  }

  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    LaneWork& work = WorkOf(lane);
    Settle(work);
    HAUSTRA_TRY(CheckGuidedMatchRequest(request, plan_, *this));
    work.kind = WorkKind::kGuidedMatching;
    work.num_matches = request.num_matches;
    work.guided.Begin(request);
    return NextTicket(lane);
  }

  Status Wait(Ticket ticket, TimePoint deadline) override {
    LaneWork& work = *lanes_[LaneRequests::LaneIndexOf(ticket)];
    HAUSTRA_TRY(work.requests.Check(ticket));
    if (!IsUnderWay(work, ticket)) return Status::Ok();  // handed over before
    work.is_left = !Finish(work, deadline);
    return work.is_left ? Status(StatusCode::kDeadlineExceeded) : Status::Ok();
  }

  bool Abandon(Ticket ticket) override {
    LaneWork& work = *lanes_[LaneRequests::LaneIndexOf(ticket)];
    return !IsUnderWay(work, ticket) || Drop(work, TimePoint{});
  }

  Status ServeThisThread(Lane lane) override {
    HAUSTRA_TRY(CheckLane(lane));
    if (WorkOf(lane).pool.FollowThisThread()) return Status::Ok();
    return FailedPrecondition(
        "helpers of the vision device: the system refuses the scheduling of the thread they help");
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
  enum class WorkKind { kNone, kExtraction, kMatching, kGuidedMatching };

  // The newest request of a lane, and everything that work on the lane writes to.
  struct LaneWork {
    LaneWork(const VisionPlan& plan, int max_list, const ExtractOptions& options, SimdLevel level, int num_threads,
             Lane lane, const FeatureSetPool& sets)
        : pool(num_threads), brute_force(max_list, sets, level, pool), guided(plan, sets, level, pool) {
      if (Extracts(lane, plan)) extractor.emplace(plan, options, level, pool);
    }
    ~LaneWork() { pool.Drop(kNoDeadline); }  // what helpers work on goes before they do

    LanePool pool;
    std::optional<SiftExtractor> extractor;  // when the lane extracts
    BruteForceMatcher brute_force;
    GuidedMatcher guided;

    WorkKind kind = WorkKind::kNone;
    LaneRequests requests;
    bool is_left = false;  // a wait gave up on the last one: the next request drops it
    ExtractRequest extract;
    FeatureSet* set = nullptr;            // that is extracted into
    std::int32_t* num_matches = nullptr;  // where the caller wants it
  };

  static bool IsUnderWay(const LaneWork& work, Ticket ticket) {
    return LaneRequests::NumberOf(ticket) == work.requests.last() && work.kind != WorkKind::kNone;
  }

  static bool Continue(LaneWork& work, TimePoint deadline) {
    switch (work.kind) {
      case WorkKind::kExtraction: return work.extractor->Continue(deadline);
      case WorkKind::kMatching: return work.brute_force.Continue(deadline);
      case WorkKind::kGuidedMatching: return work.guided.Continue(deadline);
      case WorkKind::kNone: break;
    }
    return true;
  }

  // Does the work and hands its results over. False: the deadline is over before.
  bool Finish(LaneWork& work, TimePoint deadline) {
    if (!Continue(work, deadline)) return false;
    if (work.kind == WorkKind::kExtraction) {
      const int num_features = work.extractor->num_features();
      std::copy_n(work.set->keypoints, num_features, work.extract.keypoints.data());
      *work.extract.num_keypoints = num_features;
      if (work.extract.num_followed != nullptr) *work.extract.num_followed = work.extractor->num_followed();
      DeliverFollowed(work.extractor->followed_to(), work.extract.followed_to);
      sets_.Publish(work.extract.set, num_features);
      sets_.Release(work.extract.set);
    } else if (work.kind != WorkKind::kNone) {
      *work.num_matches = work.kind == WorkKind::kMatching ? work.brute_force.num_matches() : work.guided.num_matches();
    }
    work.kind = WorkKind::kNone;
    return true;
  }

  // False: helpers are still at it when the deadline is over.
  bool Drop(LaneWork& work, TimePoint deadline) {
    if (!work.pool.Drop(deadline)) return false;
    if (work.kind == WorkKind::kExtraction) {
      work.extractor->ForgetPicture();
      sets_.AbandonWrite(work.extract.set);
      sets_.Release(work.extract.set);
    }
    work.kind = WorkKind::kNone;
    work.requests.Drop(work.requests.last());
    return true;
  }

  // Makes the lane free for another request.
  void Settle(LaneWork& work) {
    if (work.is_left && work.kind != WorkKind::kNone) {
      Drop(work, kNoDeadline);
    } else {
      Finish(work, kNoDeadline);
    }
    work.is_left = false;
  }

  std::int32_t NumFeatures(FeatureSetHandle handle) const override {
    const FeatureSet* set = sets_.Get(handle);
    return set != nullptr ? set->num_features : -1;
  }

  static Status WriteRefused(bool is_stale) {
    if (is_stale) return InvalidArgument("feature set to write: stale or invalid handle");
    return FailedPrecondition("feature set to write was written before; a set is written once");
  }

  LaneWork& WorkOf(Lane lane) { return *lanes_[static_cast<int>(lane)]; }
  Ticket NextTicket(Lane lane) { return LaneRequests::TicketOf(lane, WorkOf(lane).requests.Next()); }

  const VisionPlan plan_;
  const int max_list_;
  const std::string name_;
  FeatureSetPool sets_;
  AlignedBuffer<std::uint8_t> static_mask_;
  ImageView static_mask_view_;
  std::optional<LaneWork> lanes_[LaneRequests::kNumLanes];
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
  if (num_threads < 1 || num_threads > kMaxCpuVisionThreads) {
    return InvalidArgument("num_threads = " + std::to_string(num_threads) + " is out of range, must be in [1, " +
                           std::to_string(kMaxCpuVisionThreads) + "]");
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
  } catch (const std::system_error& error) {
    return CapacityExceeded("the system refuses helper threads, of " + std::to_string(num_threads - 1) +
                            " for each lane: " + error.code().message());
  }
}

}  // namespace haustra
