#include "tools/latency/stress.h"

#include <cstdint>
#include <cstring>

namespace haustra {
namespace {

constexpr std::size_t kCopyBytes = std::size_t{64} << 20;

void Calculate(const std::atomic<bool>& stop) {
  volatile double sink = 0.0;
  double x = 1.0;
  while (!stop.load(std::memory_order_relaxed)) {
    for (int i = 0; i < 10000; ++i) x = x * 1.0000001 + 1e-9;
    sink = x;
  }
  (void)sink;
}

void CopyMemory(const std::atomic<bool>& stop) {
  std::vector<std::uint8_t> a(kCopyBytes, 1), b(kCopyBytes, 2);
  while (!stop.load(std::memory_order_relaxed)) {
    std::memcpy(a.data(), b.data(), kCopyBytes);
    std::memcpy(b.data(), a.data(), kCopyBytes);
  }
}

// Extraction from a picture of noise, and everything against everything, one after the other without a pause.
void OccupyDevice(VisionDevice& device, const std::atomic<bool>& stop) {
  const VisionPlan& plan = device.plan();
  std::vector<std::uint8_t> noise(static_cast<std::size_t>(plan.max_width_px) * plan.max_height_px);
  std::uint32_t state = 1;
  for (std::uint8_t& value : noise) value = static_cast<std::uint8_t>((state = state * 1664525u + 1013904223u) >> 24);
  std::vector<Keypoint> keypoints(static_cast<std::size_t>(plan.max_features));
  std::vector<Match> matches(static_cast<std::size_t>(plan.max_features));
  std::int32_t num_keypoints = 0, num_matches = 0;
  while (!stop.load(std::memory_order_relaxed)) {
    const Result<FeatureSetHandle> set = device.CreateFeatureSet();
    if (!set.ok()) return;
    ExtractRequest extract;
    extract.image = {noise.data(), plan.max_width_px, plan.max_height_px, plan.max_width_px, PixelFormat::kGrey8};
    extract.set = *set;
    extract.keypoints = keypoints;
    extract.num_keypoints = &num_keypoints;
    MatchRequest match;
    match.query = match.train = DescriptorList::Whole(*set);
    match.options.mutual = true;
    match.matches = matches;
    match.num_matches = &num_matches;
    const bool is_done =
        ExtractAndWait(device, Lane::kBackground, extract).ok() && MatchAndWait(device, Lane::kBackground, match).ok();
    device.ReleaseFeatureSet(*set);
    if (!is_done) return;
  }
}

}  // namespace

Stress::Stress(const StressOptions& options, std::unique_ptr<VisionDevice> device) : device_(std::move(device)) {
  for (int i = 0; i < options.cpu_threads; ++i) threads_.emplace_back([this] { Calculate(stop_); });
  for (int i = 0; i < options.memory_threads; ++i) threads_.emplace_back([this] { CopyMemory(stop_); });
  if (device_ != nullptr) threads_.emplace_back([this] { OccupyDevice(*device_, stop_); });
}

Stress::~Stress() {
  stop_ = true;
  for (std::thread& thread : threads_) thread.join();
}

}  // namespace haustra
