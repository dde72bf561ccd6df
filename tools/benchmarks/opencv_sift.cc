#include "tools/benchmarks/opencv_sift.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <tuple>

namespace haustra::benchmarks {
namespace {

// Its own default (0.04) finds a few dozen points on mucosa.
constexpr double kContrastThreshold = 0.004;

cv::Mat ToGrey(const ImageView& image) {
  cv::Mat grey(image.height, image.width, CV_8U);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const std::uint8_t* p = image.row(y) + static_cast<std::ptrdiff_t>(x) * BytesPerPixel(image.format);
      grey.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(
          image.format == PixelFormat::kBgr8 ? (29 * p[0] + 150 * p[1] + 77 * p[2] + 128) >> 8 : p[0]);
    }
  }
  return grey;
}

// 255 where features may lie: no reflections, nothing beyond the static mask, and a margin around both.
cv::Mat ToMask(const cv::Mat& grey, const ImageView& mask, const FeatureConfig& config) {
  cv::Mat excluded = grey >= config.reflection_threshold;
  for (int y = 0; !mask.is_empty() && y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      if (mask.row(y)[x] == 0) excluded.at<std::uint8_t>(y, x) = 255;
    }
  }
  const int side = 2 * config.mask_dilation_px + 1;
  cv::dilate(excluded, excluded, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  return 255 - excluded;
}

}  // namespace

Status ExtractOpenCvSift(const ImageView& image, const ImageView& mask, const FeatureConfig& config,
                         FrameFeatures* features, std::vector<std::uint8_t>* descriptors) {
  try {
    const cv::Mat grey = ToGrey(image);
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat values;
    cv::SIFT::create(config.max, 3, kContrastThreshold)
        ->detectAndCompute(grey, ToMask(grey, mask, config), keypoints, values);
    // In the order that sets have. OpenCV keeps the octave in the lowest byte, signed.
    const auto octave = [](const cv::KeyPoint& k) {
      return static_cast<int>(static_cast<signed char>(k.octave & 255));
    };
    std::vector<int> order;
    for (int i = 0; i < std::min(static_cast<int>(keypoints.size()), config.max); ++i) order.push_back(i);
    std::sort(order.begin(), order.end(), [&](int a, int b) {
      const cv::KeyPoint &p = keypoints[static_cast<std::size_t>(a)], &q = keypoints[static_cast<std::size_t>(b)];
      return std::tuple(octave(p), p.pt.y, p.pt.x, p.angle, a) < std::tuple(octave(q), q.pt.y, q.pt.x, q.angle, b);
    });
    features->num = static_cast<std::int32_t>(order.size());
    descriptors->resize(order.size() * kDescriptorBytes);
    for (std::size_t i = 0; i < order.size(); ++i) {
      const cv::KeyPoint& k = keypoints[static_cast<std::size_t>(order[i])];
      const float angle = k.angle * std::numbers::pi_v<float> / 180.0f;
      features->keypoints[i] = {k.pt.x, k.pt.y, 0.5f * k.size, angle, k.response, octave(k)};
      for (int b = 0; b < kDescriptorBytes; ++b) {
        (*descriptors)[i * kDescriptorBytes + static_cast<std::size_t>(b)] =
            static_cast<std::uint8_t>(std::clamp(std::lround(values.at<float>(order[i], b)), 0L, 255L));
      }
    }
  } catch (const cv::Exception& error) {
    return Internal(std::string("OpenCV: ") + error.what());
  }
  return Status::Ok();
}

}  // namespace haustra::benchmarks
