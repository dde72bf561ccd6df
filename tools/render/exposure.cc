#include "tools/render/exposure.h"

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

constexpr float kTargetBrightness = 0.48f;
constexpr double kLagS = 0.22;
constexpr float kMinGain = 0.02f, kMaxGain = 60.0f;
constexpr int kMeterStride = 2;

}  // namespace

float ToneCurve(float exposed) { return std::pow(1.0f - std::exp(-std::max(exposed, 0.0f)), 1.0f / 2.2f); }

Metering Meter(const LinearImage& image, const WindowMask& window) {
  Metering metering;
  for (int y = 0; y < image.height; y += kMeterStride) {
    for (int x = 0; x < image.width; x += kMeterStride) {
      if (window.coverage(x, y) < 1.0f) continue;
      const float* rgb = image.pixel(x, y);
      const float luma = 0.30f * rgb[0] + 0.59f * rgb[1] + 0.11f * rgb[2];
      const float doublings = std::log2(std::max(luma, Metering::kLowest) / Metering::kLowest);
      ++metering.count[std::min(static_cast<int>(4.0f * doublings), Metering::kBins - 1)];
    }
  }
  return metering;
}

float AutoExposure::MeanBrightness(const Metering& metering, float gain) {
  double sum = 0.0, count = 0.0;
  for (int i = 0; i < Metering::kBins; ++i) {
    const float luma = Metering::kLowest * std::exp2((static_cast<float>(i) + 0.5f) / 4.0f);
    sum += metering.count[i] * static_cast<double>(ToneCurve(gain * luma));
    count += metering.count[i];
  }
  return count > 0.0 ? static_cast<float>(sum / count) : kTargetBrightness;
}

void AutoExposure::Start(const Metering& first) {
  gain_ = 1.0f;
  for (int i = 0; i < 60; ++i) Update(first, 10.0);
}

void AutoExposure::Update(const Metering& metering, double interval_s) {
  const float brightness = std::max(MeanBrightness(metering, gain_), 0.02f);
  // Brightness goes with a power of the gain below one, so this step is a little cautious and never overshoots.
  const float wanted = std::pow(kTargetBrightness / brightness, 1.6f);
  const auto share = static_cast<float>(1.0 - std::exp(-interval_s / kLagS));
  gain_ = std::clamp(gain_ * std::pow(wanted, share), kMinGain, kMaxGain);
}

}  // namespace haustra::render
