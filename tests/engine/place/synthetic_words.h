// Vocabularies for tests: of descriptors around some centres, and of the landmarks of a synthetic colon.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/place/vocabulary.h"
#include "hal/fakes/scripted_vision_device.h"
#include "hal/vision_device.h"

namespace haustra::test {

// `num_centres` random descriptors, and in each picture `per_centre` copies of each with a little noise.
inline VocabularySample ClusteredSample(std::uint64_t seed, int num_centres, int num_pictures, int per_centre) {
  Rng rng(seed);
  std::vector<std::uint8_t> centres(static_cast<std::size_t>(num_centres) * kDescriptorBytes);
  for (std::uint8_t& byte : centres) byte = static_cast<std::uint8_t>(10 + rng.UniformInt(200));
  VocabularySample sample;
  for (int picture = 0; picture < num_pictures; ++picture) {
    for (int i = 0; i < num_centres * per_centre; ++i) {
      const std::size_t centre = static_cast<std::size_t>(i % num_centres) * kDescriptorBytes;
      for (int k = 0; k < kDescriptorBytes; ++k) {
        sample.descriptors.push_back(static_cast<std::uint8_t>(centres[centre + k] + rng.UniformInt(9) - 4));
      }
    }
    sample.picture_ends.push_back(sample.num_descriptors());
  }
  return sample;
}

// Words for the landmarks [1, num_landmarks] of a SyntheticColon; each picture shows 200 of them.
inline Vocabulary LandmarkVocabulary(int num_landmarks) {
  VocabularySample sample;
  for (int id = 1; id <= num_landmarks; ++id) {
    const auto landmark = static_cast<std::uint32_t>(id);
    const auto bytes = EncodeAppearance({landmark, landmark});
    sample.descriptors.insert(sample.descriptors.end(), bytes.begin(), bytes.end());
    if (id % 200 == 0 || id == num_landmarks) sample.picture_ends.push_back(sample.num_descriptors());
  }
  VocabularyOptions options;
  options.branching = 8;
  options.depth = 5;
  return Vocabulary::Train(sample, options).value();
}

}  // namespace haustra::test
