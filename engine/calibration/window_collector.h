// Cuts a clip into short windows of views and follows points through each (FeatureWindow). A frame becomes a view when
// the picture has moved far enough since the last one; a window ends when it has views enough, and the next one begins
// in its middle, or when the picture is lost. Blurred and empty frames, which have far fewer features than usual, are
// left out. thread-bound(its owner). Allocates. Repeats to the bit for the same frames on one device.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/calibration/feature_window.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra::calibration {

struct CollectorOptions {
  int max_views = 10;              // of a window
  int min_views = 4;               // fewer: the window is dropped
  double view_motion = 0.025;      // median motion of the matches that makes a frame a view, share of the image width
  int min_matches = 40;            // fewer with the last view: the frame cannot go on with the window
  int max_frames_lost = 3;         // in a row: the window ends
  int max_frames_of_window = 80;   // frames looked at; living tissue does not hold still for longer
  int min_features = 80;           // fewer: nothing to see
  double min_feature_share = 0.4;  // of the usual number (median of the last ones): fewer are a blurred frame
};

struct CollectorCounters {
  int num_frames = 0;       // looked at
  int num_poor = 0;         // left out: too few features
  int num_unmatched = 0;    // did not go on with the window they came in
  double max_motion = 0.0;  // largest median motion against the last view, share of the width
};

class WindowCollector {
 public:
  // `device` has at least max_views + 4 free feature sets, the static mask if there is one, and outlives this.
  WindowCollector(VisionDevice& device, int width_px, const CollectorOptions& options);
  ~WindowCollector();
  WindowCollector(const WindowCollector&) = delete;
  WindowCollector& operator=(const WindowCollector&) = delete;

  // The next frame. Errors of the device.
  Status Add(std::uint32_t frame_index, const ImageView& image);
  // What comes next does not follow what came last.
  void Interrupt();
  const std::vector<FeatureWindow>& windows() const { return windows_; }
  const CollectorCounters& counters() const { return counters_; }

 private:
  struct Link {  // one feature in an earlier view and in this one
    std::int32_t earlier_feature = 0;
    std::int32_t feature = 0;
  };
  struct View {
    std::uint32_t frame_index = 0;
    int looked_at = 0;  // frames looked at before
    FeatureSetHandle set;
    std::vector<Keypoint> keypoints;
    std::vector<std::vector<Link>> links;  // to the view before, the one before that, ...
  };

  Status Extract(const ImageView& image, View* view);
  Status MatchTo(const View& earlier, const View& view, std::vector<Link>* links);
  // Share of the width; 0 without links.
  double MedianMotion(const View& earlier, const View& view, const std::vector<Link>& links) const;
  bool IsPoor(int num_features);
  Status Promote(View view, std::vector<Link> links_to_last);
  // Makes a window of the views that are open, if they are enough and not all of them in the last one.
  void EmitWindow();
  // The first so many of the open views are done with.
  void DropViews(std::size_t count);
  // Emits; the later half of the views goes on.
  void Overlap();
  FeatureWindow JoinTracks() const;

  VisionDevice& device_;
  int width_px_;
  CollectorOptions options_;
  CollectorCounters counters_;
  std::vector<View> views_;  // of the window that is open
  std::vector<FeatureWindow> windows_;
  std::vector<int> recent_features_;  // numbers of features of the last frames
  std::vector<Match> matches_;
  int num_lost_ = 0;
  bool has_new_view_ = false;  // since the last window
};

}  // namespace haustra::calibration
