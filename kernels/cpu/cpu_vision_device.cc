#include "kernels/cpu/cpu_vision_device.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <new>
#include <optional>
#include <string>

#include "kernels/cpu/brute_force_matcher.h"
#include "kernels/cpu/feature_set_pool.h"
#include "kernels/cpu/guided_matcher.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/sift_extractor.h"

namespace haustra {
namespace kernels {
namespace {

constexpr int kMaxImageSidePx = 8192;
constexpr int kMaxFeaturesPerSet = 1 << 20;
constexpr int kMaxThreads = 64;

std::string OutOfRange(const char* name, double value, const char* range) {
  return std::string(name) + " = " + std::to_string(value) + " is out of range, must be in " + range;
}

Status CheckPlan(const VisionPlan& plan) {
  if (plan.max_width_px < kMinOctaveSizePx || plan.max_width_px > kMaxImageSidePx) {
    return InvalidArgument(OutOfRange("VisionPlan::max_width_px", plan.max_width_px, "[24, 8192]"));
  }
  if (plan.max_height_px < kMinOctaveSizePx || plan.max_height_px > kMaxImageSidePx) {
    return InvalidArgument(OutOfRange("VisionPlan::max_height_px", plan.max_height_px, "[24, 8192]"));
  }
  if (plan.max_features < 1 || plan.max_features > kMaxFeaturesPerSet) {
    return InvalidArgument(OutOfRange("VisionPlan::max_features", plan.max_features, "[1, 2^20]"));
  }
  if (plan.max_feature_sets < 1 || plan.max_feature_sets > kMaxFeaturesPerSet) {
    return InvalidArgument(OutOfRange("VisionPlan::max_feature_sets", plan.max_feature_sets, "[1, 2^20]"));
  }
  if (plan.max_match_list < 1 || plan.max_match_list > kMaxFeaturesPerSet) {
    return InvalidArgument(OutOfRange("VisionPlan::max_match_list", plan.max_match_list, "[1, 2^20]"));
  }
  return Status::Ok();
}

Status CheckOptions(const ExtractOptions& options, const VisionPlan& plan) {
  if (options.num_features < 1 || options.num_features > plan.max_features) {
    return InvalidArgument(OutOfRange("ExtractOptions::num_features", options.num_features, "[1, plan.max_features]"));
  }
  if (!(options.contrast_threshold >= 0.0f && options.contrast_threshold < 1.0f)) {
    return InvalidArgument(OutOfRange("ExtractOptions::contrast_threshold", options.contrast_threshold, "[0, 1)"));
  }
  if (!(options.edge_threshold >= 1.0f && options.edge_threshold <= 1e6f)) {
    return InvalidArgument(OutOfRange("ExtractOptions::edge_threshold", options.edge_threshold, "[1, 1e6]"));
  }
  if (options.reflection_threshold < 0 || options.reflection_threshold > 256) {
    return InvalidArgument(
        OutOfRange("ExtractOptions::reflection_threshold", options.reflection_threshold, "[0, 256]"));
  }
  if (options.border_threshold < 0 || options.border_threshold > 255) {
    return InvalidArgument(OutOfRange("ExtractOptions::border_threshold", options.border_threshold, "[0, 255]"));
  }
  if (options.mask_dilation_px < 0 || options.mask_dilation_px > 64) {
    return InvalidArgument(OutOfRange("ExtractOptions::mask_dilation_px", options.mask_dilation_px, "[0, 64]"));
  }
  return Status::Ok();
}

class CpuVisionDevice final : public VisionDevice {
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
      if (lane == Lane::kTracking) work.extractor.Prefault();
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
    HAUSTRA_TRY(CheckSize(mask, "static mask"));
    for (int y = 0; y < mask.height; ++y) {
      std::memcpy(static_mask_.data() + static_cast<std::size_t>(y) * mask.width, mask.row(y), mask.width);
    }
    static_mask_view_ = {static_mask_.data(), mask.width, mask.height, mask.width, PixelFormat::kGrey8};
    return Status::Ok();
  }

  Result<FeatureSetHandle> CreateFeatureSet() override {
    const FeatureSetHandle handle = sets_.Create();
    if (!handle.is_valid()) {
      return CapacityExceeded("all " + std::to_string(plan_.max_feature_sets) + " feature sets are in use");
    }
    return handle;
  }

  bool RetainFeatureSet(FeatureSetHandle set) override { return sets_.Retain(set); }
  void ReleaseFeatureSet(FeatureSetHandle set) override { sets_.Release(set); }
  std::int32_t num_free_feature_sets() const override { return sets_.num_free(); }

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    const ImageView& image = request.image;
    if (image.is_empty()) return InvalidArgument("image to extract from is empty");
    HAUSTRA_TRY(CheckSize(image, "image"));
    if (image.width < kMinOctaveSizePx || image.height < kMinOctaveSizePx) {
      return InvalidArgument("image of " + SizeText(image) + " is too small, each side must have at least " +
                             std::to_string(kMinOctaveSizePx) + " pixels");
    }
    if (image.pitch_bytes < static_cast<std::ptrdiff_t>(image.width) * BytesPerPixel(image.format)) {
      return InvalidArgument("pitch of " + std::to_string(image.pitch_bytes) + " bytes is too small for rows of " +
                             std::to_string(image.width) + " pixels");
    }
    if (!static_mask_view_.is_empty() &&
        (image.width != static_mask_view_.width || image.height != static_mask_view_.height)) {
      return InvalidArgument("image of " + SizeText(image) + " does not fit the static mask of " +
                             SizeText(static_mask_view_));
    }
    if (request.num_keypoints == nullptr || request.keypoints.size() < static_cast<std::size_t>(plan_.max_features)) {
      return InvalidArgument("room for " + std::to_string(request.keypoints.size()) + " keypoints, " +
                             std::to_string(plan_.max_features) + " and their number are needed");
    }
    bool is_stale = false;
    FeatureSet* set = sets_.BeginWrite(request.set, &is_stale);
    if (set == nullptr) return WriteRefused(is_stale);

    const int num_features = WorkOf(lane).extractor.Extract(image, static_mask_view_, *set);
    std::copy_n(set->keypoints, num_features, request.keypoints.data());
    *request.num_keypoints = num_features;
    sets_.Publish(request.set, num_features);
    return NextTicket();
  }

  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    HAUSTRA_TRY(CheckList(request.query, "query list"));
    HAUSTRA_TRY(CheckList(request.train, "train list"));
    HAUSTRA_TRY(CheckMatchOptions(request.options));
    HAUSTRA_TRY(CheckGates(request));
    const std::size_t num_queries = BruteForceMatcher::ListSize(request.query, sets_);
    if (request.num_matches == nullptr || request.matches.size() < num_queries) {
      return InvalidArgument("room for " + std::to_string(request.matches.size()) + " matches, " +
                             std::to_string(num_queries) + " and their number are needed");
    }
    *request.num_matches = WorkOf(lane).brute_force.Match(request);
    return NextTicket();
  }

  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    HAUSTRA_TRY(CheckMatchOptions(request.options));
    if (request.queries.size() > static_cast<std::size_t>(plan_.max_match_list)) {
      return CapacityExceeded(std::to_string(request.queries.size()) + " guided queries, at most " +
                              std::to_string(plan_.max_match_list) + " are possible");
    }
    const FeatureSet* train = sets_.Get(request.train);
    if (train == nullptr) return InvalidArgument("train set of guided matching: stale or invalid handle");
    if (!request.train_allowed.empty() &&
        request.train_allowed.size() < static_cast<std::size_t>(train->num_features)) {
      return InvalidArgument("train_allowed has " + std::to_string(request.train_allowed.size()) +
                             " entries, the set " + std::to_string(train->num_features) + " features");
    }
    if (request.num_matches == nullptr || request.matches.size() < request.queries.size()) {
      return InvalidArgument("room for " + std::to_string(request.matches.size()) + " matches, " +
                             std::to_string(request.queries.size()) + " and their number are needed");
    }
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
    if (keypoints.size() > static_cast<std::size_t>(plan_.max_features)) {
      return CapacityExceeded(std::to_string(keypoints.size()) + " features to write, a set holds " +
                              std::to_string(plan_.max_features));
    }
    if (descriptors.size() != keypoints.size() * kDescriptorBytes) {
      return InvalidArgument(std::to_string(descriptors.size()) + " bytes of descriptors for " +
                             std::to_string(keypoints.size()) + " keypoints");
    }
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      if (!std::isfinite(keypoints[i].x_px) || !std::isfinite(keypoints[i].y_px) ||
          !std::isfinite(keypoints[i].scale_px)) {
        return InvalidArgument("keypoint " + std::to_string(i) + " to write is not finite");
      }
    }
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
        : extractor(plan, options, level, pool, lane),
          brute_force(max_list, sets, level, pool, lane),
          guided(plan, sets, level, pool, lane) {}

    SiftExtractor extractor;
    BruteForceMatcher brute_force;
    GuidedMatcher guided;
  };

  static std::string SizeText(const ImageView& image) {
    return std::to_string(image.width) + "x" + std::to_string(image.height);
  }

  static Status WriteRefused(bool is_stale) {
    if (is_stale) return InvalidArgument("feature set to write: stale or invalid handle");
    return FailedPrecondition("feature set to write was written before; a set is written once");
  }

  static Status CheckLane(Lane lane) {
    if (static_cast<int>(lane) < static_cast<int>(Lane::kNumLanes)) return Status::Ok();
    return InvalidArgument("no lane " + std::to_string(static_cast<int>(lane)));
  }

  static Status CheckMatchOptions(const MatchOptions& options) {
    if (!std::isfinite(options.min_similarity) || !(options.max_angle_ratio >= 0.0f)) {
      return InvalidArgument("MatchOptions: min_similarity " + std::to_string(options.min_similarity) +
                             ", max_angle_ratio " + std::to_string(options.max_angle_ratio));
    }
    return Status::Ok();
  }

  Status CheckSize(const ImageView& image, const char* what) const {
    if (image.width <= plan_.max_width_px && image.height <= plan_.max_height_px) return Status::Ok();
    return InvalidArgument(std::string(what) + " of " + SizeText(image) + " is larger than the plan's " +
                           std::to_string(plan_.max_width_px) + "x" + std::to_string(plan_.max_height_px));
  }

  Status CheckList(const DescriptorList& list, const char* what) const {
    if (!list.refs.empty()) {
      if (list.refs.size() <= static_cast<std::size_t>(plan_.max_match_list)) return Status::Ok();
      return CapacityExceeded(std::string(what) + " of " + std::to_string(list.refs.size()) + " descriptors, at most " +
                              std::to_string(plan_.max_match_list) + " are possible");
    }
    const FeatureSet* set = sets_.Get(list.set);
    if (set == nullptr) return InvalidArgument(std::string(what) + ": stale or invalid feature set");
    if (list.indices.size() > static_cast<std::size_t>(max_list_)) {
      return CapacityExceeded(std::string(what) + " of " + std::to_string(list.indices.size()) +
                              " descriptors, at most " + std::to_string(max_list_) + " are possible");
    }
    for (std::size_t i = 0; i < list.indices.size(); ++i) {
      if (list.indices[i] >= 0 && list.indices[i] < set->num_features) continue;
      return InvalidArgument(std::string(what) + ": index " + std::to_string(list.indices[i]) + " at position " +
                             std::to_string(i) + ", the set has " + std::to_string(set->num_features) + " features");
    }
    return Status::Ok();
  }

  Status CheckGates(const MatchRequest& request) const {
    if (request.disparity == nullptr && request.epipolar == nullptr) return Status::Ok();
    if (!request.query.refs.empty() || !request.train.refs.empty()) {
      return InvalidArgument("disparity window and epipolar gate need whole sets or subsets, not gathered descriptors");
    }
    if (request.epipolar == nullptr) return Status::Ok();
    const EpipolarGate& gate = *request.epipolar;
    const std::size_t num_query = sets_.Get(request.query.set)->num_features;
    const std::size_t num_train = sets_.Get(request.train.set)->num_features;
    if (gate.query_bearings.size() < num_query || gate.query_tolerance.size() < num_query ||
        gate.train_bearings.size() < num_train || gate.train_tolerance.size() < num_train) {
      return InvalidArgument("epipolar gate has " + std::to_string(gate.query_bearings.size()) + " and " +
                             std::to_string(gate.train_bearings.size()) + " bearings, " +
                             std::to_string(gate.query_tolerance.size()) + " and " +
                             std::to_string(gate.train_tolerance.size()) + " tolerances; the sets have " +
                             std::to_string(num_query) + " and " + std::to_string(num_train) + " features");
    }
    return Status::Ok();
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

Result<std::unique_ptr<VisionDevice>> CreateCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                            int num_threads) {
  return CreateCpuVisionDevice(plan, options, num_threads, kernels::BestSimdLevel());
}

Result<std::unique_ptr<VisionDevice>> CreateCpuVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                            int num_threads, kernels::SimdLevel level) {
  HAUSTRA_TRY(kernels::CheckPlan(plan));
  HAUSTRA_TRY(kernels::CheckOptions(options, plan));
  if (num_threads < 1 || num_threads > kernels::kMaxThreads) {
    return InvalidArgument(kernels::OutOfRange("num_threads", num_threads, "[1, 64]"));
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
