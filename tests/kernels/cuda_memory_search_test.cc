// What a CUDA device leaves behind: nothing of pictures and descriptors in the GPU's memory. The service's memory is
// searched by tests/end_to_end/daemon_test.cc.
#include "tests/kernels/cuda_memory_search.h"

#include <cuda.h>
#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include <bitset>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "kernels/cuda/cuda_vision_device.h"
#include "tests/kernels/blob_scene.h"
#include "tests/kernels/cuda_device_present.h"

namespace haustra::testing {
namespace {

constexpr int kSearchedWidth = 640;
constexpr int kSearchedHeight = 480;
constexpr int kNumWords = 32;

// Words of `bytes` at multiples of eight that are hardly anywhere by chance: eight values that differ.
std::vector<std::uint64_t> TellingWords(const std::vector<std::uint8_t>& bytes) {
  std::mt19937 random(3);
  std::vector<std::uint64_t> words;
  for (int i = 0; i < 100000 && static_cast<int>(words.size()) < kNumWords; ++i) {
    const std::uint8_t* at = bytes.data() + random() % (bytes.size() / 8) * 8;
    std::bitset<256> values;
    for (int k = 0; k < 8; ++k) values.set(at[k]);
    if (values.count() < 7) continue;
    std::uint64_t word = 0;
    std::memcpy(&word, at, 8);
    words.push_back(word);
  }
  return words;
}

std::uint64_t NumFound(const std::vector<std::uint64_t>& words) {
  const Result<FreeMemorySearch> search = SearchFreeDeviceMemory(words);
  EXPECT_TRUE(search.ok()) << search.status().ToString();
  EXPECT_GT(search->num_searched_bytes, std::uint64_t{1} << 28);
  return search->num_found;
}

TEST(CudaMemorySearch, NothingOfPicturesAndDescriptorsIsLeftOnTheDevice) {
  if (!IsCudaDevicePresent()) GTEST_SKIP() << NoCudaDeviceReason();
  std::mt19937 random(1);
  std::vector<std::uint64_t> control(kNumWords);
  for (std::uint64_t& word : control) word = std::uint64_t{random()} << 32 | random();
  ASSERT_TRUE(LeaveInDeviceMemory(control).ok());
  if (NumFound(control) == 0) GTEST_SKIP() << "this driver clears what is given back: nothing can be found";

  VisionPlan plan;
  plan.max_width_px = kSearchedWidth;
  plan.max_height_px = kSearchedHeight;
  plan.max_features = 1000;
  plan.max_feature_sets = 8;
  ExtractOptions options;
  options.num_features = plan.max_features;
  Picture picture =
      Render(RandomBlobs(3000, kSearchedWidth, kSearchedHeight, 20.0, 40.0, 9), kSearchedWidth, kSearchedHeight, 120.0);
  for (std::uint8_t& pixel : picture.pixels) pixel = static_cast<std::uint8_t>(pixel + random() % 24);
  std::vector<Keypoint> keypoints(1000);
  std::vector<std::uint8_t> descriptors(1000 * kDescriptorBytes);
  std::int32_t count = 0;
  {
    const auto device = CreateCudaVisionDevice(plan, options).value();
    const FeatureSetHandle set = device->CreateFeatureSet().value();
    ASSERT_TRUE(ExtractAndWait(*device, Lane::kTracking, {picture.view(), set, keypoints, &count}).ok());
    ASSERT_GT(count, 200);
    descriptors.resize(static_cast<std::size_t>(count) * kDescriptorBytes);
    ASSERT_TRUE(device->ReadDescriptors(set, descriptors).ok());
    std::vector<Match> matches(1000);
    std::int32_t num_matches = 0;
    MatchRequest match;
    match.query = match.train = DescriptorList::Whole(set);
    match.matches = matches;
    match.num_matches = &num_matches;
    ASSERT_TRUE(MatchAndWait(*device, Lane::kBackground, match).ok());
    // As an atlas is loaded: by way of memory of the driver's own.
    const FeatureSetHandle loaded = device->CreateFeatureSet().value();
    ASSERT_TRUE(
        device->WriteFeatures(loaded, std::span(keypoints).first(static_cast<std::size_t>(count)), descriptors).ok());
  }
  EXPECT_EQ(NumFound(TellingWords(picture.pixels)), 0u) << "of the picture";
  EXPECT_EQ(NumFound(TellingWords(descriptors)), 0u) << "of its descriptors";
}

// All kernels are there before the first request: none is loaded in the middle of a frame.
TEST(CudaModuleLoading, IsEager) {
  if (!IsCudaDevicePresent()) GTEST_SKIP() << NoCudaDeviceReason();
  void* function = nullptr;
  cudaDriverEntryPointQueryResult found{};
  ASSERT_EQ(cudaGetDriverEntryPointByVersion("cuModuleGetLoadingMode", &function, 11070, cudaEnableDefault, &found),
            cudaSuccess);
  ASSERT_EQ(found, cudaDriverEntryPointSuccess);
  CUmoduleLoadingMode mode{};
  ASSERT_EQ(reinterpret_cast<CUresult (*)(CUmoduleLoadingMode*)>(function)(&mode), CUDA_SUCCESS);
  EXPECT_EQ(mode, CU_MODULE_EAGER_LOADING);
}

}  // namespace
}  // namespace haustra::testing
