// A short piece of a clip as self-calibration sees it: some of its frames, far enough apart, and points followed
// through them. Plain data.
#pragma once

#include <cstdint>
#include <vector>

namespace haustra::calibration {

struct TrackObservation {
  std::int32_t view = 0;  // [0, num_views), ascending within a track
  float x_px = 0.0f;      // pixel centres at integers
  float y_px = 0.0f;
  float scale_px = 1.0f;  // of the feature (hal/vision_device.h); its place is known in proportion to it
};

struct FeatureWindow {
  std::uint32_t first_frame = 0;  // of the clip, as the frames were numbered when they came
  std::uint32_t last_frame = 0;
  int num_views = 0;
  std::vector<TrackObservation> observations;  // track after track
  std::vector<std::int32_t> track_begins;      // first observation of each track, and the number of observations

  int num_tracks() const { return track_begins.empty() ? 0 : static_cast<int>(track_begins.size()) - 1; }
};

}  // namespace haustra::calibration
