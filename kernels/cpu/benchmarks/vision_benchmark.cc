// Times of the CPU vision device, and of OpenCV on the same picture in the same run where OpenCV is there. The picture
// is made here: noise of every scale, so that there are more points than wanted, as in well-textured mucosa.
//
//   haustra_vision_benchmark [--benchmark_filter=...]
//
// HAUSTRA_BENCHMARK_IMAGE=FILE takes a picture of yours instead (needs OpenCV).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "kernels/cpu/cpu_vision_device.h"

#ifdef HAUSTRA_HAVE_OPENCV
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#endif

namespace haustra {
namespace {

struct Picture {
  int width = 720;
  int height = 540;
  std::vector<std::uint8_t> pixels;

  ImageView view() const { return {pixels.data(), width, height, width, PixelFormat::kGrey8}; }
};

// Gaussian blobs of many sizes on grey, strong enough for the default threshold of OpenCV to leave 2000 points and
// more.
Picture MakePicture() {
  Picture picture;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  std::vector<float> sum(static_cast<std::size_t>(picture.width) * picture.height, 120.0f);
  for (int i = 0; i < 9000; ++i) {
    const float x = uniform(random) * static_cast<float>(picture.width);
    const float y = uniform(random) * static_cast<float>(picture.height);
    const float sigma = 0.8f * std::exp2(4.0f * uniform(random) * uniform(random));
    const float height = (uniform(random) < 0.5f ? -1.0f : 1.0f) * (10.0f + 50.0f * uniform(random));
    const int reach = static_cast<int>(4.0f * sigma) + 1;
    for (int v = std::max(0, static_cast<int>(y) - reach);
         v <= std::min(picture.height - 1, static_cast<int>(y) + reach); ++v) {
      for (int u = std::max(0, static_cast<int>(x) - reach);
           u <= std::min(picture.width - 1, static_cast<int>(x) + reach); ++u) {
        const float dx = static_cast<float>(u) - x;
        const float dy = static_cast<float>(v) - y;
        sum[static_cast<std::size_t>(v) * picture.width + u] +=
            height * std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
      }
    }
  }
  for (const float value : sum) {
    picture.pixels.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(value), 30L, 230L)));
  }
  return picture;
}

const Picture& TestPicture() {
  static const Picture picture = [] {
#ifdef HAUSTRA_HAVE_OPENCV
    if (const char* path = std::getenv("HAUSTRA_BENCHMARK_IMAGE"); path != nullptr) {
      const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
      if (!image.empty()) return Picture{image.cols, image.rows, {image.datastart, image.dataend}};
    }
#endif
    return MakePicture();
  }();
  return picture;
}

std::unique_ptr<VisionDevice> MakeDevice(int num_threads, kernels::SimdLevel level) {
  VisionPlan plan;
  plan.max_width_px = TestPicture().width;
  plan.max_height_px = TestPicture().height;
  auto device = CreateCpuVisionDevice(plan, ExtractOptions{}, num_threads, level);
  return device.ok() ? std::move(device).value() : nullptr;
}

int Extract(VisionDevice& device, FeatureSetHandle set, std::vector<Keypoint>& keypoints) {
  keypoints.resize(device.plan().max_features);
  std::int32_t count = 0;
  const Status status = ExtractAndWait(device, Lane::kTracking, {TestPicture().view(), set, keypoints, &count});
  return status.ok() ? count : -1;
}

void BM_Extract(benchmark::State& state) {
  const auto level = static_cast<kernels::SimdLevel>(state.range(1));
  const auto device = MakeDevice(static_cast<int>(state.range(0)), level);
  if (device == nullptr) return state.SkipWithError("not on this processor");
  std::vector<Keypoint> keypoints;
  int count = 0;
  for (auto _ : state) {
    const FeatureSetHandle set = device->CreateFeatureSet().value();
    count = Extract(*device, set, keypoints);
    device->ReleaseFeatureSet(set);
  }
  state.counters["features"] = count;
  state.SetLabel(std::string(kernels::ToString(level)));
}

void BM_MatchBruteForce(benchmark::State& state) {
  const auto level = static_cast<kernels::SimdLevel>(state.range(1));
  const auto device = MakeDevice(static_cast<int>(state.range(0)), level);
  if (device == nullptr) return state.SkipWithError("not on this processor");
  const bool is_mutual = state.range(2) != 0;
  std::vector<Keypoint> keypoints;
  const FeatureSetHandle set = device->CreateFeatureSet().value();
  const int count = Extract(*device, set, keypoints);
  std::vector<Match> matches(count);
  std::int32_t num_matches = 0;
  MatchRequest request{DescriptorList::Whole(set),
                       DescriptorList::Whole(set),
                       {0.0f, 0.9f, is_mutual},
                       nullptr,
                       nullptr,
                       matches,
                       &num_matches};
  for (auto _ : state) {
    if (!MatchAndWait(*device, Lane::kTracking, request).ok()) state.SkipWithError("matching failed");
  }
  state.counters["features"] = count;
  state.SetLabel(std::string(kernels::ToString(level)) + (is_mutual ? " mutual" : ""));
}

void BM_MatchGuided(benchmark::State& state) {
  const auto level = static_cast<kernels::SimdLevel>(state.range(1));
  const auto device = MakeDevice(static_cast<int>(state.range(0)), level);
  if (device == nullptr) return state.SkipWithError("not on this processor");
  std::vector<Keypoint> keypoints;
  const FeatureSetHandle set = device->CreateFeatureSet().value();
  const int count = Extract(*device, set, keypoints);
  std::vector<GuidedQuery> queries;
  for (int i = 0; i < count; ++i) {
    const Keypoint& k = keypoints[i];
    queries.push_back({{set, i}, k.x_px + 3.0f, k.y_px - 2.0f, 15.0f, 0.7f * k.scale_px, 1.4f * k.scale_px});
  }
  std::vector<Match> matches(count);
  std::int32_t num_matches = 0;
  GuidedMatchRequest request{queries, set, {}, {0.0f, 0.9f, false}, matches, &num_matches};
  for (auto _ : state) {
    if (!GuidedMatchAndWait(*device, Lane::kTracking, request).ok()) state.SkipWithError("matching failed");
  }
  state.counters["queries"] = count;
  state.SetLabel(std::string(kernels::ToString(level)));
}

constexpr int kPortable = static_cast<int>(kernels::SimdLevel::kPortable);
constexpr int kAvx2 = static_cast<int>(kernels::SimdLevel::kAvx2);
constexpr int kAvx512 = static_cast<int>(kernels::SimdLevel::kAvx512);

BENCHMARK(BM_Extract)
    ->Args({1, kAvx512})
    ->Args({2, kAvx512})
    ->Args({1, kAvx2})
    ->Args({1, kPortable})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(BM_MatchBruteForce)
    ->Args({1, kAvx512, 0})
    ->Args({1, kAvx512, 1})
    ->Args({2, kAvx512, 1})
    ->Args({1, kAvx2, 0})
    ->Args({1, kPortable, 0})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(BM_MatchGuided)
    ->Args({1, kAvx512})
    ->Args({1, kAvx2})
    ->Args({1, kPortable})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

#ifdef HAUSTRA_HAVE_OPENCV
cv::Mat PictureMat() {
  const Picture& picture = TestPicture();
  return cv::Mat(picture.height, picture.width, CV_8U, const_cast<std::uint8_t*>(picture.pixels.data()));
}

void BM_OpenCvSift(benchmark::State& state) {
  cv::setNumThreads(static_cast<int>(state.range(0)));
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create(2000);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  for (auto _ : state) sift->detectAndCompute(PictureMat(), cv::noArray(), keypoints, descriptors);
  state.counters["features"] = static_cast<double>(keypoints.size());
}

void BM_OpenCvBruteForceKnn2(benchmark::State& state) {
  cv::setNumThreads(static_cast<int>(state.range(0)));
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  cv::SIFT::create(2000)->detectAndCompute(PictureMat(), cv::noArray(), keypoints, descriptors);
  const cv::BFMatcher matcher(cv::NORM_L2);
  std::vector<std::vector<cv::DMatch>> matches;
  for (auto _ : state) matcher.knnMatch(descriptors, descriptors, matches, 2);
  state.counters["features"] = descriptors.rows;
}

BENCHMARK(BM_OpenCvSift)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_OpenCvBruteForceKnn2)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
#endif

}  // namespace
}  // namespace haustra

BENCHMARK_MAIN();
