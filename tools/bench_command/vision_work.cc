#include "tools/bench_command/vision_work.h"

#include "hal/vision_device.h"
#include "kernels/common/gaussian_kernel.h"

namespace haustra {

ExtractionWork CountExtraction(int width_px, int height_px, int num_features) {
  using namespace kernels;  // NOLINT: constants of the extractor
  ExtractionWork work;
  work.picture_bytes = static_cast<std::int64_t>(width_px) * height_px;
  std::int64_t taps = 0;
  for (int level = 0; level < kNumLevels; ++level) taps += 2 * (2 * KernelOfLevel(level).radius + 1);
  for (int i = 0; i < CountOctaves(width_px, height_px); ++i) {
    work.plane_pixels +=
        static_cast<std::int64_t>(OctaveSize(width_px, kFirstOctave + i)) * OctaveSize(height_px, kFirstOctave + i);
  }
  work.plane_bytes = work.plane_pixels * 2 * kNumLevels * 2;
  work.blur_multiply_adds = work.plane_pixels * taps;
  constexpr std::int64_t kOrientationSamples = 4 * kOrientationReachPx * kOrientationReachPx;
  constexpr std::int64_t kSide = (kDescriptorCells + 1) * kDescriptorSamplesPerCell;
  work.patch_samples = num_features * (kOrientationSamples + kSide * kSide);
  return work;
}

MatchingWork CountMatching(std::int64_t num_query, std::int64_t num_train) {
  return {num_query * num_train * kDescriptorBytes, (num_query + num_train) * kDescriptorBytes};
}

}  // namespace haustra
