#include "kernels/common/request_checks.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "kernels/common/gaussian_kernel.h"
#include "kernels/common/sift_parameters.h"

namespace haustra::kernels {
namespace {

constexpr int kMaxImageSidePx = 8192;
constexpr int kMaxFeaturesPerSet = 1 << 20;

std::string OutOfRange(const char* name, double value, const char* range) {
  return std::string(name) + " = " + std::to_string(value) + " is out of range, must be in " + range;
}

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

Status CheckMatchOptions(const MatchOptions& options) {
  if (!std::isfinite(options.min_similarity) || !(options.max_angle_ratio >= 0.0f)) {
    return InvalidArgument("MatchOptions: min_similarity " + std::to_string(options.min_similarity) +
                           ", max_angle_ratio " + std::to_string(options.max_angle_ratio));
  }
  return Status::Ok();
}

Status CheckRoom(std::size_t num_matches, const std::int32_t* count, std::size_t needed) {
  if (count != nullptr && num_matches >= needed) return Status::Ok();
  return InvalidArgument("room for " + std::to_string(num_matches) + " matches, " + std::to_string(needed) +
                         " and their number are needed");
}

Status CheckList(const DescriptorList& list, const VisionPlan& plan, const FeatureCounts& counts, const char* what) {
  if (!list.refs.empty()) {
    if (list.refs.size() <= static_cast<std::size_t>(plan.max_match_list)) return Status::Ok();
    return CapacityExceeded(std::string(what) + " of " + std::to_string(list.refs.size()) + " descriptors, at most " +
                            std::to_string(plan.max_match_list) + " are possible");
  }
  const std::int32_t num_features = counts.NumFeatures(list.set);
  if (num_features < 0) return InvalidArgument(std::string(what) + ": stale or invalid feature set");
  const std::size_t max_list = std::max(plan.max_features, plan.max_match_list);
  if (list.indices.size() > max_list) {
    return CapacityExceeded(std::string(what) + " of " + std::to_string(list.indices.size()) +
                            " descriptors, at most " + std::to_string(max_list) + " are possible");
  }
  for (std::size_t i = 0; i < list.indices.size(); ++i) {
    if (list.indices[i] >= 0 && list.indices[i] < num_features) continue;
    return InvalidArgument(std::string(what) + ": index " + std::to_string(list.indices[i]) + " at position " +
                           std::to_string(i) + ", the set has " + std::to_string(num_features) + " features");
  }
  return Status::Ok();
}

Status CheckGates(const MatchRequest& request, const FeatureCounts& counts) {
  if (request.disparity == nullptr && request.epipolar == nullptr) return Status::Ok();
  if (!request.query.refs.empty() || !request.train.refs.empty()) {
    return InvalidArgument("disparity window and epipolar gate need whole sets or subsets, not gathered descriptors");
  }
  if (request.epipolar == nullptr) return Status::Ok();
  const EpipolarGate& gate = *request.epipolar;
  const std::size_t num_query = counts.NumFeatures(request.query.set);
  const std::size_t num_train = counts.NumFeatures(request.train.set);
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

}  // namespace

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

Status CheckExtractOptions(const ExtractOptions& options, const VisionPlan& plan) {
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

Status CheckLane(Lane lane) {
  if (static_cast<int>(lane) < static_cast<int>(Lane::kNumLanes)) return Status::Ok();
  return InvalidArgument("no lane " + std::to_string(static_cast<int>(lane)));
}

Status CheckImageSize(const ImageView& image, const VisionPlan& plan, const char* what) {
  if (image.width <= plan.max_width_px && image.height <= plan.max_height_px) return Status::Ok();
  return InvalidArgument(std::string(what) + " of " + SizeText(image.width, image.height) +
                         " is larger than the plan's " + SizeText(plan.max_width_px, plan.max_height_px));
}

bool Extracts(Lane lane, const VisionPlan& plan) { return lane == Lane::kTracking || plan.extracts_in_background; }

int NumExtractingLanes(const VisionPlan& plan) {
  int count = 0;
  for (int lane = 0; lane < static_cast<int>(Lane::kNumLanes); ++lane) count += Extracts(static_cast<Lane>(lane), plan);
  return count;
}

Status CheckExtractRequest(Lane lane, const ExtractRequest& request, const VisionPlan& plan, int static_mask_width,
                           int static_mask_height) {
  HAUSTRA_TRY(CheckLane(lane));
  if (!Extracts(lane, plan)) return InvalidArgument("VisionPlan::extracts_in_background is off");
  const ImageView& image = request.image;
  if (image.is_empty()) return InvalidArgument("image to extract from is empty");
  HAUSTRA_TRY(CheckImageSize(image, plan, "image"));
  if (image.width < kMinOctaveSizePx || image.height < kMinOctaveSizePx) {
    return InvalidArgument("image of " + SizeText(image.width, image.height) +
                           " is too small, each side must have at least " + std::to_string(kMinOctaveSizePx) +
                           " pixels");
  }
  if (image.pitch_bytes < static_cast<std::ptrdiff_t>(image.width) * BytesPerPixel(image.format)) {
    return InvalidArgument("pitch of " + std::to_string(image.pitch_bytes) + " bytes is too small for rows of " +
                           std::to_string(image.width) + " pixels");
  }
  const bool has_even_width = image.format != PixelFormat::kGrey8 && image.format != PixelFormat::kBgr8;
  const bool has_even_height = image.format == PixelFormat::kNv12;
  if ((has_even_width && image.width % 2 != 0) || (has_even_height && image.height % 2 != 0)) {
    return InvalidArgument("image of " + SizeText(image.width, image.height) +
                           ": the sides of a picture with halved colour are even");
  }
  if (static_mask_width > 0 && (image.width != static_mask_width || image.height != static_mask_height)) {
    return InvalidArgument("image of " + SizeText(image.width, image.height) + " does not fit the static mask of " +
                           SizeText(static_mask_width, static_mask_height));
  }
  const std::size_t num_follow = request.follow.size();
  if (num_follow > static_cast<std::size_t>(MaxFollowed(plan))) {
    return InvalidArgument(std::to_string(num_follow) + " features to follow, at most " +
                           std::to_string(MaxFollowed(plan)) + " can be");
  }
  if (request.num_only_followed < 0 || static_cast<std::size_t>(request.num_only_followed) > num_follow) {
    return InvalidArgument(std::to_string(request.num_only_followed) + " of " + std::to_string(num_follow) +
                           " features are only to be followed");
  }
  if (!request.followed_to.empty() && request.followed_to.size() != num_follow) {
    return InvalidArgument("room for " + std::to_string(request.followed_to.size()) + " followed features, " +
                           std::to_string(num_follow) + " are to be followed");
  }
  if (request.num_keypoints == nullptr || request.keypoints.size() < static_cast<std::size_t>(plan.max_features)) {
    return InvalidArgument("room for " + std::to_string(request.keypoints.size()) + " keypoints, " +
                           std::to_string(plan.max_features) + " and their number are needed");
  }
  return Status::Ok();
}

Status CheckPlacesToFollow(const ExtractRequest& request, const VisionPlan& plan, int last_width_px,
                           int last_height_px) {
  const bool is_same_size = request.image.width == last_width_px && request.image.height == last_height_px;
  const int width = is_same_size ? request.image.width : plan.max_width_px;
  const int height = is_same_size ? request.image.height : plan.max_height_px;
  for (const Keypoint& keypoint : request.follow) {
    // Negated to catch NaN.
    if (keypoint.octave < kFirstOctave || keypoint.octave >= kFirstOctave + CountOctaves(width, height) ||
        !(keypoint.x_px >= 0.0f && keypoint.x_px < static_cast<float>(width)) ||
        !(keypoint.y_px >= 0.0f && keypoint.y_px < static_cast<float>(height)) || !(keypoint.scale_px > 0.0f)) {
      return InvalidArgument("a feature to follow lies outside the picture or its octaves");
    }
  }
  return Status::Ok();
}

void DeliverFollowed(std::span<const FollowedPoint> followed, std::span<FollowedPoint> wanted) {
  if (followed.empty()) {
    std::fill(wanted.begin(), wanted.end(), FollowedPoint{});
  } else {
    std::copy_n(followed.begin(), wanted.size(), wanted.begin());
  }
}

std::int32_t ListSize(const DescriptorList& list, const FeatureCounts& counts) {
  if (!list.refs.empty()) return static_cast<std::int32_t>(list.refs.size());
  if (list.use_indices || !list.indices.empty()) return static_cast<std::int32_t>(list.indices.size());
  return counts.NumFeatures(list.set);
}

Status CheckMatchRequest(const MatchRequest& request, const VisionPlan& plan, const FeatureCounts& counts) {
  HAUSTRA_TRY(CheckList(request.query, plan, counts, "query list"));
  HAUSTRA_TRY(CheckList(request.train, plan, counts, "train list"));
  HAUSTRA_TRY(CheckMatchOptions(request.options));
  HAUSTRA_TRY(CheckGates(request, counts));
  return CheckRoom(request.matches.size(), request.num_matches, ListSize(request.query, counts));
}

Status CheckGuidedMatchRequest(const GuidedMatchRequest& request, const VisionPlan& plan, const FeatureCounts& counts) {
  HAUSTRA_TRY(CheckMatchOptions(request.options));
  if (request.queries.size() > static_cast<std::size_t>(plan.max_match_list)) {
    return CapacityExceeded(std::to_string(request.queries.size()) + " guided queries, at most " +
                            std::to_string(plan.max_match_list) + " are possible");
  }
  const std::int32_t num_train = counts.NumFeatures(request.train);
  if (num_train < 0) return InvalidArgument("train set of guided matching: stale or invalid handle");
  if (!request.train_allowed.empty() && request.train_allowed.size() < static_cast<std::size_t>(num_train)) {
    return InvalidArgument("train_allowed has " + std::to_string(request.train_allowed.size()) + " entries, the set " +
                           std::to_string(num_train) + " features");
  }
  return CheckRoom(request.matches.size(), request.num_matches, request.queries.size());
}

Status CheckFeaturesToWrite(std::span<const Keypoint> keypoints, std::span<const std::uint8_t> descriptors,
                            const VisionPlan& plan) {
  if (keypoints.size() > static_cast<std::size_t>(plan.max_features)) {
    return CapacityExceeded(std::to_string(keypoints.size()) + " features to write, a set holds " +
                            std::to_string(plan.max_features));
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
  return Status::Ok();
}

}  // namespace haustra::kernels
