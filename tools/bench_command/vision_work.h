// Bytes and operations that extraction and matching cannot do without, counted from their parameters.
#pragma once

#include <cstdint>

namespace haustra {

// Of extraction from a grey picture: what each step reads and writes once, when planes are kept in 16 bits.
struct ExtractionWork {
  std::int64_t picture_bytes = 0;
  std::int64_t plane_pixels = 0;        // of one level of all octaves
  std::int64_t plane_bytes = 0;         // all levels written once, and read once by the next step
  std::int64_t blur_multiply_adds = 0;  // separable, without margins
  std::int64_t patch_samples = 0;       // gradients of orientations (at most) and descriptors
};
ExtractionWork CountExtraction(int width_px, int height_px, int num_features);

struct MatchingWork {
  std::int64_t multiply_adds = 0;
  std::int64_t bytes = 0;  // each descriptor once
};
MatchingWork CountMatching(std::int64_t num_query, std::int64_t num_train);

}  // namespace haustra
