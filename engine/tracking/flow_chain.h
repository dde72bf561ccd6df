// What optical flow knows of a motion, beside the map: the features of one frame with a certain pose, the anchor,
// followed from picture to picture, through a loss as well. It bears witness against poses: where the map has another
// wall that looks alike, or the points of an instrument, a false pose has as many inliers as a true one, and the flow
// disagrees (decisions/2026-11-24-a-witness-by-flow.md). It says nothing of poses in other maps, and makes none.
// thread-bound(tracking); rt-safe after construction. Full: no more points than features.max.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/atlas/reframing.h"
#include "engine/camera/camera_model.h"
#include "engine/geometry/se3.h"
#include "engine/tracking/pose_search.h"
#include "hal/core/time.h"
#include "hal/vision_device.h"

namespace haustra {

// The features that a frame had, those that show map points first.
void ListFeatures(const LastFrame& frame, std::vector<std::uint8_t>* shows_point, std::vector<std::int32_t>* order);

class FlowChain {
 public:
  FlowChain(const CameraModel& camera, int max_features);
  // Of its workspaces, on the heap.
  static std::size_t BytesFor(int max_features);

  // The frame that was extracted last is the anchor, in the order of ListFeatures.
  void Begin(const LastFrame& frame, MapId map_id, const SE3& cam_from_map, TimePoint now);
  void Break();
  // The next picture: where each of points() is.
  void Advance(std::span<const FollowedPoint> to);
  // An anchor in a map of another shape is no witness any more.
  void Hear(const Reframing& reframing);

  // Where the features of the anchor are in the picture that was extracted last. Empty: there is no chain.
  std::span<const Keypoint> points() const { return points_; }
  // No picture came after the anchor.
  bool is_fresh() const { return is_fresh_; }
  MapId map_id() const { return map_id_; }
  double AgeMs(TimePoint now) const { return ToMilliseconds(Apart(now, begun_)); }
  // Young enough, and with points enough, to judge a pose in its map at that time.
  bool CanJudge(TimePoint now) const;
  // What the points say of a pose.
  struct Witness {
    bool denies = false;  // the picture moved in another way than it; false as well when they cannot judge it
    int num_for = 0;      // points that agree with it
    int num_against = 0;  // points that do not
    // A pose with a prediction and so many inliers falls only where more speaks against it than for it.
    bool DeniesTracked(int num_inliers) const { return denies && num_against > std::max(num_for, num_inliers); }
  };
  Witness Judge(MapId map_id, const SE3& cam_from_map, TimePoint now) const;

 private:
  struct Count {
    int num = 0;
    int num_agreeing = 0;
  };
  // Of the points from `begin` on, up to `end`.
  Count CountAgreeing(const SE3& now_from_anchor, std::size_t begin, std::size_t end) const;

  const CameraModel& camera_;
  MapId map_id_ = kNoId;
  SE3 anchor_from_map_;
  TimePoint begun_;
  bool is_fresh_ = false;
  std::size_t num_of_map_ = 0;  // of the points, the first ones: they showed map points at the anchor
  std::vector<Keypoint> points_;
  std::vector<Eigen::Vector3f> anchor_bearings_;  // of each
  // Workspaces.
  std::vector<std::uint8_t> shows_point_;
  std::vector<std::int32_t> order_;
};

}  // namespace haustra
