// Gathers what a vocabulary is learnt from: the strongest descriptors of pictures, taken by the same extractor and with
// the same settings as in a run. thread-bound(its owner).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/config.h"
#include "engine/place/vocabulary.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

class TrainingSample {
 public:
  // config.features says how features are found; of each picture the `max_per_picture` strongest are kept. num_threads:
  // of the extractor, 0: one for each core.
  TrainingSample(const EngineConfig& config, int max_per_picture, int num_threads)
      : config_(config), max_per_picture_(max_per_picture), num_threads_(num_threads) {}

  // The pictures from here on are of this size, with this mask (255 inside; empty: none). Errors: as the device's.
  Status BeginSource(const CameraCalibration& calibration, ImageView mask);
  // After BeginSource. A picture without features counts as a picture all the same.
  Status AddPicture(ImageView picture);
  // Every n-th frame of a recorded sequence (capture/open_sequence.h); damaged ones are left out.
  Status AddSequence(const std::string& path, int every_nth);

  const VocabularySample& sample() const { return sample_; }
  std::size_t num_pictures() const { return sample_.picture_ends.size(); }

 private:
  const EngineConfig& config_;
  int max_per_picture_;
  int num_threads_;
  std::unique_ptr<VisionDevice> device_;
  VocabularySample sample_;
  FrameFeatures features_;
  std::vector<std::uint8_t> descriptors_;
  std::vector<std::int32_t> strongest_;
};

}  // namespace haustra
