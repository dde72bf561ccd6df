// Has the device find the features of the current frame, and follow those of the last one and of the chain in it. By
// the rung of the ladder on which the frame stands: all features, or fewer and nothing followed. What the device does
// not answer by the frame's deadline is left for the next frame to collect. Full: without a feature set nothing is
// extracted, and the refusal is counted. thread-bound(tracking); rt-safe after construction: no allocation, no wait but
// for the vision device.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/scheduler/frame_budget.h"
#include "engine/scheduler/lane_wait.h"
#include "engine/tracking/flow_chain.h"
#include "engine/tracking/keyframe_proposal.h"
#include "engine/tracking/overlay_watch.h"
#include "engine/tracking/pose_search.h"
#include "hal/vision_device.h"

namespace haustra {

class FrameExtractor {
 public:
  // All of them outlive it and are those of the tracker; `frame` is the current one.
  struct Parts {
    const EngineConfig& config;
    const CameraModel& camera;
    VisionDevice& device;
    LaneWait& lane;
    FrameBudget& budget;
    const OverlayWatch& overlay;
    ProposedView& frame;
    const LastFrame& last;
    FlowChain& chain;
  };
  explicit FrameExtractor(const Parts& parts);
  // Of its workspaces, on the heap.
  static std::size_t BytesFor(int max_features);

  // Fills the features of the current frame from the picture. False: there are none, or the device is still at it.
  bool Extract(const ImageView& image);
  // The frame extracted last has become the last one: what it showed may be followed.
  void KeepLast() { is_last_extracted_ = true; }
  // Nothing is followed into the next frame.
  void ForgetLast() { is_last_extracted_ = false; }
  // Frames for which the device had no feature set left. Any thread.
  std::uint64_t num_sets_refused() const { return num_sets_refused_.load(std::memory_order_relaxed); }

 private:
  void ListFeaturesToFollow();

  const Parts parts_;
  std::atomic<std::uint64_t> num_sets_refused_{0};
  bool is_last_extracted_ = false;  // the last frame is what the device saw last
  // Workspaces.
  std::vector<Keypoint> follow_;  // those of the chain, which are only followed, then those of the last frame
  std::vector<FollowedPoint> followed_to_;
  std::vector<std::uint8_t> shows_point_;
  std::vector<std::int32_t> order_;
};

}  // namespace haustra
