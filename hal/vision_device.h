// The accelerator as the engine sees it: SIFT extraction into feature sets that stay on the device, brute-force
// matching and guided matching on them. Two implementations, kernels/cpu and kernels/cuda, and a scripted fake in
// hal/fakes.
//
// Asynchronous by contract: Enqueue* checks its arguments, queues the work on a lane and returns a ticket; Wait blocks
// until the work is done or the deadline is over (where there is no accelerator the waiting thread does the work).
// Deadlines are of CLOCK_MONOTONIC. Work on one lane runs in order. Buffers named in a request (inputs and outputs)
// belong to the caller and must stay as they are until Wait has returned ok for its ticket.
//
// A feature set is written once, by the extraction into it, and is immutable from then until its release; so any number
// of matching requests on any lane may read it. Whoever releases a set makes sure that no queued work uses it. A stale
// or invalid handle is refused by Enqueue* (kInvalidArgument); a stale DescriptorRef inside a list never matches.
//
// thread-safe: one thread a lane at a time. rt-safe after construction: no allocation, no blocking but in Wait.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "hal/core/handle.h"
#include "hal/core/status.h"
#include "hal/core/time.h"
#include "hal/core/views.h"

namespace haustra {

inline constexpr int kDescriptorBytes = 128;

struct FeatureSetTag;
using FeatureSetHandle = Handle<FeatureSetTag>;

// A detected point, in pixels of the input image (pixel centres at integers).
struct Keypoint {
  float x_px = 0.0f;
  float y_px = 0.0f;
  float scale_px = 0.0f;    // SIFT scale: standard deviation of the blur at which the point was found, input pixels
  float angle_rad = 0.0f;   // dominant orientation, [0, 2 pi)
  float response = 0.0f;    // |DoG| at the refined extremum
  std::int32_t octave = 0;  // 0: input resolution
};

// One descriptor inside a set.
struct DescriptorRef {
  FeatureSetHandle set;
  std::int32_t feature_idx = -1;
};

// Descriptors to match: a whole set (set), a part of it (set and indices), or any mixture (refs).
// In the results, positions count within the list: feature index for a whole set, position in the span otherwise.
struct DescriptorList {
  FeatureSetHandle set;
  std::span<const std::int32_t> indices;  // empty: the whole set
  std::span<const DescriptorRef> refs;    // not empty: used instead of set and indices
  bool use_indices = false;               // true: `indices` holds even when it is empty

  static DescriptorList Whole(FeatureSetHandle set) { return {set, {}, {}, false}; }
  static DescriptorList Subset(FeatureSetHandle set, std::span<const std::int32_t> indices) {
    return {set, indices, {}, true};
  }
  static DescriptorList Gather(std::span<const DescriptorRef> refs) { return {{}, {}, refs, false}; }
};

// Similarity is the cosine of the two descriptors, in [0, 1]. The ratio test is on angles:
// acos(best) <= max_angle_ratio * acos(second), so one threshold means the same at every similarity.
struct MatchOptions {
  float min_similarity = 0.0f;
  float max_angle_ratio = 1.0f;  // 1: no ratio test
  bool mutual = false;           // keep only pairs that are each other's best (ties: lowest position)
};

// Only pairs whose keypoints are at most this far apart. Both lists must come from whole sets or subsets.
struct DisparityWindow {
  float max_dx_px = 0.0f;
  float max_dy_px = 0.0f;
};

// Only pairs that satisfy the epipolar constraint, on unit bearings (x, y, z) of both lists, indexed by feature (not by
// position in the list): |b_train . (E b_query)| / |E b_query| <= train_tolerance[train feature], and likewise for the
// query with E^T and query_tolerance. Tolerances are sines of angles. E row-major. |E b| = 0 passes no tolerance.
struct EpipolarGate {
  std::array<float, 9> train_from_query_essential{};
  std::span<const std::array<float, 3>> query_bearings;
  std::span<const std::array<float, 3>> train_bearings;
  std::span<const float> query_tolerance;
  std::span<const float> train_tolerance;
};

struct Match {
  std::int32_t query = -1;  // position in the query list
  std::int32_t train = -1;  // position in the train list
  float similarity = 0.0f;
  float second_similarity = 0.0f;  // best similarity of any other admissible train descriptor, 0 if none
};

enum class Lane : std::uint8_t {
  kTracking = 0,    // high priority
  kBackground = 1,  // mapping and merging, in turn
  kNumLanes = 2,
};

struct Ticket {
  std::uint64_t value = 0;
};

// A lane knows the tickets of so many requests, the newest ones.
inline constexpr int kKnownTickets = 64;

// Where a feature that was to be followed is now, input pixels.
struct FollowedPoint {
  float x_px = 0.0f;
  float y_px = 0.0f;
  bool is_found = false;  // to a pixel or two, most of the time
  bool is_sure = false;   // well enough to become a feature
};

struct ExtractRequest {
  ImageView image;       // any PixelFormat; size at most the plan's
  FeatureSetHandle set;  // receives keypoints and descriptors
  // Host copy of the keypoints, at least max_features long; sorted by (octave, y, x, angle), followed ones behind all
  // that were detected.
  std::span<Keypoint> keypoints;
  std::int32_t* num_keypoints = nullptr;
  // Hints of a caller that is short of time; a device may give more than is asked for.
  int max_features = 0;       // the strongest so many are enough; 0: as planned
  float min_scale_px = 0.0f;  // finer ones are not needed: the octaves that hold no others may be left out; 0: all are
  // Features of the picture that was extracted before on this lane, to be followed into this one by optical flow
  // (kernels/common/flow_parameters.h), where the set has room for more than ExtractOptions::num_features. Those that
  // are surely found, and that detection has not found, become features like any other: scale, angle, octave and
  // response as before, a descriptor of their own. None are followed after a picture of another size, a request that
  // failed or was given up, or by a device that cannot. Each lies in this picture, after one of another size in
  // any of the plan. At most twice the plan's max_features.
  std::span<const Keypoint> follow = {};
  // Of the first so many of them no features come: the caller only asks where they are. They need no room in the set.
  int num_only_followed = 0;
  // Optional, one for each of `follow`: where it is now, whether it became a feature or not.
  std::span<FollowedPoint> followed_to = {};
  std::int32_t* num_followed = nullptr;  // optional: how many of the keypoints, the last ones, were followed
};

struct MatchRequest {
  DescriptorList query;
  DescriptorList train;
  MatchOptions options;
  const DisparityWindow* disparity = nullptr;  // optional
  const EpipolarGate* epipolar = nullptr;      // optional
  // Accepted matches in order of query position; at least as long as the query list.
  std::span<Match> matches;
  std::int32_t* num_matches = nullptr;
};

// A projected map point: where in the image it should be, and what it should look like.
struct GuidedQuery {
  DescriptorRef descriptor;
  float x_px = 0.0f;
  float y_px = 0.0f;
  float radius_px = 0.0f;
  float min_scale_px = 0.0f;  // only keypoints with min <= scale <= max
  float max_scale_px = 0.0f;
};

// Each query against the keypoints of `train` inside its window. The ratio test compares with the second best inside
// the window. When several queries choose one keypoint, the most similar keeps it (ties: lowest query).
struct GuidedMatchRequest {
  std::span<const GuidedQuery> queries;
  FeatureSetHandle train;
  // Optional, indexed by feature of `train`: keypoints with a zero are left out.
  std::span<const std::uint8_t> train_allowed;
  MatchOptions options;  // mutual is ignored
  std::span<Match> matches;
  std::int32_t* num_matches = nullptr;
};

struct VisionPlan {
  int max_width_px = 0;
  int max_height_px = 0;
  int max_features = 2000;  // per set
  int max_feature_sets = 64;
  int max_match_list = 8192;  // longest query or train list of refs, longest guided query list
  // Off: only the tracking lane extracts features; the other one takes no memory for it and answers kInvalidArgument.
  bool extracts_in_background = true;
};

// What the extractor does; one for the life of the device. Lowe 2004.
struct ExtractOptions {
  int num_features = 2000;          // [1, plan.max_features]
  float contrast_threshold = 0.0f;  // minimum |DoG| response on intensities in [0, 1]; 0: the device's default
  float edge_threshold = 10.0f;     // ratio of principal curvatures
  int reflection_threshold = 245;   // grey values at or above are reflections; 256: none
  int border_threshold = 12;        // the dark surround of the scope's window; 0: none
  int mask_dilation_px = 4;         // at octave 0, doubled at each coarser octave
  bool root_sift = false;           // Arandjelovic 2012
  // Dark blobs (DoG above 0) are described upright, with angle 0 and once; bright ones as ever, by their orientation.
  bool upright_dark = false;
};

// thread-safe: one thread a lane at a time (see above).
class VisionDevice {
 public:
  virtual ~VisionDevice() = default;

  virtual std::string_view name() const = 0;
  // Works beside the processor, on requests that cannot be interrupted: background work in the wrong moment makes
  // tracking wait. Otherwise the threads' priorities see to that.
  virtual bool is_accelerator() const { return false; }
  virtual const VisionPlan& plan() const = 0;

  // 255: scene, 0: outside; kept by the device and joined with the masks of each frame. Empty view: none.
  // Not rt-safe; call before the first extraction. kInvalidArgument: larger than the plan.
  virtual Status SetStaticMask(ImageView mask) = 0;

  // An empty set with one owner. kCapacityExceeded when all are in use. thread-safe.
  virtual Result<FeatureSetHandle> CreateFeatureSet() = 0;
  // One owner more (another thread that works on the set). False when the handle is stale. thread-safe.
  virtual bool RetainFeatureSet(FeatureSetHandle set) = 0;
  // One owner less; the set goes with the last. Stale handles are ignored. thread-safe.
  virtual void ReleaseFeatureSet(FeatureSetHandle set) = 0;
  virtual std::int32_t num_free_feature_sets() const = 0;

  // kInvalidArgument: shape, size, stale handle. kCapacityExceeded: list too long. kUnavailable: device lost.
  virtual Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) = 0;
  virtual Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) = 0;
  virtual Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) = 0;

  // kDeadlineExceeded: not done yet. Wait again for the results; or leave it: the next request on the lane then drops
  // them, touches no buffer but the image's, and leaves the set empty. kFailedPrecondition: dropped so.
  // kInvalidArgument: never given out, or no longer one of kKnownTickets. kUnavailable: device lost.
  virtual Status Wait(Ticket ticket, TimePoint deadline) = 0;

  // Gives up, without a wait, a request whose Wait came to its deadline. True: it is dropped as above, or was done
  // before; none of its buffers is touched any more. False: the device is still at it.
  virtual bool Abandon(Ticket ticket);

  // The calling thread is the one that will use the lane: threads of the device that work for it take on its policy and
  // priority, and what the device keeps for each thread that calls it is taken now. Not rt-safe. kFailedPrecondition:
  // the system refuses. kUnavailable: device lost.
  virtual Status ServeThisThread(Lane lane);

  // Copies descriptors to the host (indexing a keyframe for retrieval, saving an atlas). Blocks; not rt-safe. out:
  // N x 128 u8, row-major.
  virtual Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) = 0;
  // Fills an empty set from the host (loading an atlas, tests): N keypoints, N x 128 u8. Blocks; not rt-safe.
  virtual Status WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                               std::span<const std::uint8_t> descriptors) = 0;
};

// Shorthand for callers that have nothing to do meanwhile.
Status ExtractAndWait(VisionDevice& device, Lane lane, const ExtractRequest& request, TimePoint deadline = kNoDeadline);
Status MatchAndWait(VisionDevice& device, Lane lane, const MatchRequest& request, TimePoint deadline = kNoDeadline);
Status GuidedMatchAndWait(VisionDevice& device, Lane lane, const GuidedMatchRequest& request,
                          TimePoint deadline = kNoDeadline);

}  // namespace haustra
