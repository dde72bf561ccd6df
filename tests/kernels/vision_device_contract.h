// What every vision device has to do (hal/vision_device.h), as a suite that each implementation instantiates:
//
//   INSTANTIATE_TEST_SUITE_P(Cpu, VisionDeviceContract, ::testing::Values(DeviceUnderTest{...}), NameOfDevice);
//
// Truth comes from scenes in closed form and from naive double loops, never from a device.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>
#include <ostream>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "hal/vision_device.h"
#include "tests/kernels/blob_scene.h"
#include "tests/kernels/naive_matcher.h"

namespace haustra::testing {

struct DeviceUnderTest {
  std::string name;
  std::function<Result<std::unique_ptr<VisionDevice>>(const VisionPlan&, const ExtractOptions&)> create;
};

inline void PrintTo(const DeviceUnderTest& device, std::ostream* out) { *out << device.name; }
inline std::string NameOfDevice(const ::testing::TestParamInfo<DeviceUnderTest>& info) { return info.param.name; }

class VisionDeviceContract : public ::testing::TestWithParam<DeviceUnderTest> {
 protected:
  static constexpr int kWidth = 320;
  static constexpr int kHeight = 240;

  static VisionPlan SmallPlan() {
    VisionPlan plan;
    plan.max_width_px = kWidth;
    plan.max_height_px = kHeight;
    plan.max_features = 500;
    plan.max_feature_sets = 6;
    plan.max_match_list = 700;
    return plan;
  }

  static ExtractOptions SmallOptions() {
    ExtractOptions options;
    options.num_features = 500;
    options.border_threshold = 0;
    options.reflection_threshold = 256;
    return options;
  }

  std::unique_ptr<VisionDevice> Create(const VisionPlan& plan = SmallPlan(),
                                       const ExtractOptions& options = SmallOptions()) {
    auto device = GetParam().create(plan, options);
    EXPECT_TRUE(device.ok()) << device.status().ToString();
    return std::move(device).value();
  }

  static FeatureSetHandle NewSet(VisionDevice& device) {
    auto set = device.CreateFeatureSet();
    EXPECT_TRUE(set.ok()) << set.status().ToString();
    return set.value();
  }

  // Extracts into a set of its own, which stays where `handle` asks for it.
  static HostFeatures RunExtract(VisionDevice& device, ExtractRequest request, Lane lane = Lane::kTracking,
                                 FeatureSetHandle* handle = nullptr) {
    const FeatureSetHandle set = NewSet(device);
    HostFeatures features;
    features.keypoints.resize(device.plan().max_features);
    std::int32_t count = -1;
    request.set = set;
    request.keypoints = features.keypoints;
    request.num_keypoints = &count;
    const Status status = ExtractAndWait(device, lane, request);
    EXPECT_TRUE(status.ok()) << status.ToString();
    features.keypoints.resize(std::max(count, 0));
    features.descriptors.resize(features.keypoints.size() * kDescriptorBytes);
    EXPECT_TRUE(device.ReadDescriptors(set, features.descriptors).ok());
    if (handle != nullptr) {
      *handle = set;
    } else {
      device.ReleaseFeatureSet(set);
    }
    return features;
  }

  static HostFeatures Extract(VisionDevice& device, const ImageView& image, FeatureSetHandle* handle = nullptr,
                              Lane lane = Lane::kTracking, int max_features = 0, float min_scale_px = 0.0f) {
    ExtractRequest request;
    request.image = image;
    request.max_features = max_features;
    request.min_scale_px = min_scale_px;
    return RunExtract(device, request, lane, handle);
  }

  // `last`: of the picture that was extracted before.
  static HostFeatures Follow(VisionDevice& device, const Picture& picture, std::span<const Keypoint> last,
                             int max_detected, std::int32_t* num_followed = nullptr, int num_only_followed = 0,
                             std::span<FollowedPoint> followed_to = {}, Lane lane = Lane::kTracking) {
    ExtractRequest request;
    request.image = picture.view();
    request.max_features = max_detected;
    request.follow = last;
    request.num_only_followed = num_only_followed;
    request.followed_to = followed_to;
    request.num_followed = num_followed;
    return RunExtract(device, request, lane);
  }

  // Away from the edges, where patches and coarse levels are cut.
  static bool IsWellInside(double x, double y) {
    return x >= 30.0 && y >= 30.0 && x <= kWidth - 30.0 && y <= kHeight - 30.0;
  }

  // What a caller's buffer may hold from before.
  static std::vector<FollowedPoint> StalePoints(std::size_t count) {
    return std::vector<FollowedPoint>(count, FollowedPoint{-7.0f, -7.0f, true, true});
  }

  static FeatureSetHandle Write(VisionDevice& device, const HostFeatures& features) {
    const FeatureSetHandle set = NewSet(device);
    const Status status = device.WriteFeatures(set, features.keypoints, features.descriptors);
    EXPECT_TRUE(status.ok()) << status.ToString();
    return set;
  }

  // Descriptors of any bytes; about every fifth is a slight change of one in `like`.
  static HostFeatures RandomFeatures(int count, unsigned seed, const HostFeatures* like = nullptr) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> byte(0, 255);
    std::uniform_real_distribution<float> unit(0.0f, 1.0f);
    HostFeatures features;
    for (int i = 0; i < count; ++i) {
      Keypoint k;
      k.x_px = unit(random) * (kWidth - 1);
      k.y_px = unit(random) * (kHeight - 1);
      k.scale_px = 1.0f + 7.0f * unit(random);
      features.keypoints.push_back(k);
      const bool is_copy = like != nullptr && like->size() > 0 && i % 5 == 0;
      const int original = is_copy ? static_cast<int>(random() % like->keypoints.size()) : 0;
      // Sparse, so that similarities differ much.
      const int zeros = 20 + static_cast<int>(random() % 90);
      for (int b = 0; b < kDescriptorBytes; ++b) {
        int value = byte(random) < 2 * zeros ? 0 : byte(random);
        if (is_copy)
          value = std::clamp(static_cast<int>(like->descriptor(original)[b]) + byte(random) / 32 - 4, 0, 255);
        features.descriptors.push_back(static_cast<std::uint8_t>(value));
      }
    }
    return features;
  }

  static std::vector<Match> RunMatch(VisionDevice& device, const DescriptorList& query, const DescriptorList& train,
                                     const MatchOptions& options, const DisparityWindow* disparity = nullptr,
                                     const EpipolarGate* epipolar = nullptr, Lane lane = Lane::kTracking) {
    std::vector<Match> matches(1000);
    std::int32_t count = -1;
    const Status status = MatchAndWait(device, lane, {query, train, options, disparity, epipolar, matches, &count});
    EXPECT_TRUE(status.ok()) << status.ToString();
    matches.resize(std::max(count, 0));
    return matches;
  }

  static std::vector<Match> RunGuided(VisionDevice& device, const std::vector<GuidedQuery>& queries,
                                      FeatureSetHandle train, const MatchOptions& options,
                                      const std::vector<std::uint8_t>& allowed = {}) {
    std::vector<Match> matches(queries.size());
    std::int32_t count = -1;
    const Status status =
        GuidedMatchAndWait(device, Lane::kTracking, {queries, train, allowed, options, matches, &count});
    EXPECT_TRUE(status.ok()) << status.ToString();
    matches.resize(std::max(count, 0));
    return matches;
  }

  // Requests of matching that are queued one after the other, each with buffers of its own. Several of them, since a
  // device that works by itself may be done with one before the first look.
  struct QueuedMatches {
    QueuedMatches(VisionDevice& device, FeatureSetHandle set, Lane lane, int num_requests)
        : matches(num_requests, std::vector<Match>(device.plan().max_features)), counts(num_requests, -7) {
      for (int i = 0; i < num_requests; ++i) {
        const auto ticket =
            device.EnqueueMatch(lane, {DescriptorList::Whole(set), DescriptorList::Whole(set),
                                       MatchOptions{0.3f, 0.95f, true}, nullptr, nullptr, matches[i], &counts[i]});
        EXPECT_TRUE(ticket.ok()) << ticket.status().ToString();
        tickets.push_back(ticket.ok() ? *ticket : Ticket{});
      }
    }
    bool IsLastUntouched() const { return counts.back() == -7 && matches.back()[0].query == -1; }

    std::vector<std::vector<Match>> matches;
    std::vector<std::int32_t> counts;
    std::vector<Ticket> tickets;
  };

  // An extraction that is queued, with a set and buffers of its own, which the device knows by their addresses.
  struct QueuedExtraction {
    QueuedExtraction(VisionDevice& device, const ImageView& image)
        : set(NewSet(device)), keypoints(device.plan().max_features) {
      const auto queued = device.EnqueueExtract(Lane::kTracking, {image, set, keypoints, &count});
      EXPECT_TRUE(queued.ok()) << queued.status().ToString();
      if (queued.ok()) ticket = *queued;
    }
    QueuedExtraction(const QueuedExtraction&) = delete;
    QueuedExtraction& operator=(const QueuedExtraction&) = delete;

    FeatureSetHandle set;
    std::vector<Keypoint> keypoints;
    std::int32_t count = -7;
    Ticket ticket;
  };

  static void ExpectSameMatches(const std::vector<Match>& actual, const std::vector<Match>& expected) {
    ASSERT_EQ(actual.size(), expected.size());
    for (std::size_t i = 0; i < actual.size(); ++i) {
      ASSERT_EQ(actual[i].query, expected[i].query) << "match " << i;
      EXPECT_EQ(actual[i].train, expected[i].train) << "query " << actual[i].query;
      EXPECT_NEAR(actual[i].similarity, expected[i].similarity, 1e-6f) << "query " << actual[i].query;
      EXPECT_NEAR(actual[i].second_similarity, expected[i].second_similarity, 1e-6f) << "query " << actual[i].query;
    }
  }

  static void ExpectSameFeatures(const HostFeatures& a, const HostFeatures& b) {
    ASSERT_EQ(a.size(), b.size());
    for (int i = 0; i < a.size(); ++i) {
      const Keypoint& p = a.keypoints[i];
      const Keypoint& q = b.keypoints[i];
      ASSERT_TRUE(p.x_px == q.x_px && p.y_px == q.y_px && p.scale_px == q.scale_px && p.angle_rad == q.angle_rad &&
                  p.response == q.response && p.octave == q.octave)
          << "keypoint " << i;
    }
    EXPECT_EQ(a.descriptors, b.descriptors);
  }

  static Picture Texture(unsigned seed, double height = 40.0) {
    return Render(RandomBlobs(900, kWidth, kHeight, 20.0, height, seed), kWidth, kHeight, 120.0);
  }

  static double AngleBetween(double a, double b) { return std::abs(std::remainder(a - b, 2 * std::numbers::pi)); }
};

// ---- Feature sets ---------------------------------------------------------------------------------------------------

TEST_P(VisionDeviceContract, CreateFeatureSetWhenAllAreInUseReturnsCapacityExceeded) {
  const auto device = Create();
  EXPECT_EQ(device->num_free_feature_sets(), 6);
  std::vector<FeatureSetHandle> sets;
  for (int i = 0; i < 6; ++i) sets.push_back(NewSet(*device));
  EXPECT_EQ(device->num_free_feature_sets(), 0);
  EXPECT_EQ(device->CreateFeatureSet().code(), StatusCode::kCapacityExceeded);
  EXPECT_EQ(device->CreateFeatureSet().status().message(), "") << "tracking asks on every frame: a message allocates";
  device->ReleaseFeatureSet(sets[3]);
  EXPECT_EQ(device->num_free_feature_sets(), 1);
  EXPECT_TRUE(device->CreateFeatureSet().ok());
}

TEST_P(VisionDeviceContract, ReleaseOfStaleOrInvalidHandleIsIgnored) {
  const auto device = Create();
  const FeatureSetHandle set = NewSet(*device);
  device->ReleaseFeatureSet(set);
  const FeatureSetHandle again = NewSet(*device);
  device->ReleaseFeatureSet(set);
  device->ReleaseFeatureSet({});
  device->ReleaseFeatureSet({12345, 0});
  EXPECT_EQ(device->num_free_feature_sets(), 5);
  EXPECT_NE(again, set);
  std::vector<std::uint8_t> none;
  EXPECT_TRUE(device->ReadDescriptors(again, none).ok());
  EXPECT_EQ(device->ReadDescriptors(set, none).code(), StatusCode::kInvalidArgument);
}

TEST_P(VisionDeviceContract, SetLivesUntilItsLastOwnerReleasesIt) {
  const auto device = Create();
  const HostFeatures features = RandomFeatures(20, 3);
  const FeatureSetHandle set = Write(*device, features);
  ASSERT_TRUE(device->RetainFeatureSet(set));
  const std::int32_t num_free = device->num_free_feature_sets();
  device->ReleaseFeatureSet(set);
  EXPECT_EQ(device->num_free_feature_sets(), num_free);
  std::vector<std::uint8_t> read(features.descriptors.size());
  EXPECT_TRUE(device->ReadDescriptors(set, read).ok());
  EXPECT_EQ(read, features.descriptors);
  device->ReleaseFeatureSet(set);
  EXPECT_EQ(device->num_free_feature_sets(), num_free + 1);
  EXPECT_FALSE(device->RetainFeatureSet(set));
  EXPECT_EQ(device->num_free_feature_sets(), num_free + 1);
}

TEST_P(VisionDeviceContract, CreateAndReleaseFromManyThreadsLosesNoSet) {
  const auto device = Create();
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&device] {
      for (int i = 0; i < 2000; ++i) {
        const auto set = device->CreateFeatureSet();
        if (set.ok()) device->ReleaseFeatureSet(set.value());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(device->num_free_feature_sets(), 6);
}

TEST_P(VisionDeviceContract, WrittenDescriptorsAreReadBack) {
  const auto device = Create();
  const HostFeatures features = RandomFeatures(123, 1);
  const FeatureSetHandle set = Write(*device, features);
  std::vector<std::uint8_t> descriptors(features.descriptors.size());
  ASSERT_TRUE(device->ReadDescriptors(set, descriptors).ok());
  EXPECT_EQ(descriptors, features.descriptors);
  descriptors.pop_back();
  EXPECT_EQ(device->ReadDescriptors(set, descriptors).code(), StatusCode::kInvalidArgument);
}

TEST_P(VisionDeviceContract, SecondWriteIsRefusedAndChangesNothing) {
  const auto device = Create();
  const HostFeatures features = RandomFeatures(10, 1);
  const FeatureSetHandle set = Write(*device, features);
  const HostFeatures other = RandomFeatures(10, 2);
  EXPECT_FALSE(device->WriteFeatures(set, other.keypoints, other.descriptors).ok());
  const Picture picture = Texture(1);
  std::vector<Keypoint> keypoints(500);
  std::int32_t count = -7;
  EXPECT_FALSE(ExtractAndWait(*device, Lane::kTracking, {picture.view(), set, keypoints, &count}).ok());
  EXPECT_EQ(count, -7);
  std::vector<std::uint8_t> descriptors(features.descriptors.size());
  ASSERT_TRUE(device->ReadDescriptors(set, descriptors).ok());
  EXPECT_EQ(descriptors, features.descriptors);
}

TEST_P(VisionDeviceContract, WriteOfWrongShapeIsRefused) {
  const auto device = Create();
  const FeatureSetHandle set = NewSet(*device);
  HostFeatures features = RandomFeatures(501, 1);
  EXPECT_EQ(device->WriteFeatures(set, features.keypoints, features.descriptors).code(), StatusCode::kCapacityExceeded);
  features.keypoints.resize(20);
  EXPECT_EQ(device->WriteFeatures(set, features.keypoints, features.descriptors).code(), StatusCode::kInvalidArgument);
  features.descriptors.resize(20 * kDescriptorBytes);
  features.keypoints[7].x_px = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(device->WriteFeatures(set, features.keypoints, features.descriptors).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(device->WriteFeatures({}, features.keypoints, features.descriptors).code(), StatusCode::kInvalidArgument);
  features.keypoints[7].x_px = 1.0f;
  EXPECT_TRUE(device->WriteFeatures(set, features.keypoints, features.descriptors).ok());
}

// ---- Extraction -----------------------------------------------------------------------------------------------------

TEST_P(VisionDeviceContract, ExtractFindsBlobsAtTheirPositionAndScale) {
  ExtractOptions options = SmallOptions();
  options.contrast_threshold = 0.01f;
  const auto device = Create(SmallPlan(), options);
  for (const double sigma : {1.6, 2.3, 3.1, 4.4, 6.5, 9.0}) {
    for (const double height : {90.0, -90.0}) {
      const double x = 160.3;
      const double y = 118.7;
      const HostFeatures features = Extract(*device, Render({{x, y, sigma, height}}, kWidth, kHeight, 120.0).view());
      ASSERT_GE(features.size(), 1) << "sigma " << sigma;
      const auto strongest =
          std::max_element(features.keypoints.begin(), features.keypoints.end(),
                           [](const Keypoint& a, const Keypoint& b) { return a.response < b.response; });
      EXPECT_NEAR(strongest->x_px, x, 0.05 + 0.02 * sigma) << "sigma " << sigma;
      EXPECT_NEAR(strongest->y_px, y, 0.05 + 0.02 * sigma) << "sigma " << sigma;
      // G(k s) - G(s) of a blob is extremal where k s^2 = sigma^2; k = 2^(1/S) lies between 1.15 (S = 5) and 1.26 (S =
      // 3), and s counts the blur that the picture is taken to come with.
      EXPECT_GT(strongest->scale_px, 0.85 * sigma);
      EXPECT_LT(strongest->scale_px, 1.02 * sigma + 0.1);
    }
  }
}

TEST_P(VisionDeviceContract, ExtractScalesGrowInProportionToTheScene) {
  const auto device = Create();
  const auto scale_of = [&](double sigma) {
    const HostFeatures f = Extract(*device, Render({{150.0, 120.0, sigma, 90.0}}, kWidth, kHeight, 120.0).view());
    EXPECT_GE(f.size(), 1);
    return std::max_element(f.keypoints.begin(), f.keypoints.end(),
                            [](const Keypoint& a, const Keypoint& b) { return a.response < b.response; })
        ->scale_px;
  };
  const float base = scale_of(2.5);
  EXPECT_NEAR(scale_of(5.0) / base, 2.0, 0.06);
  EXPECT_NEAR(scale_of(10.0) / base, 4.0, 0.15);
}

TEST_P(VisionDeviceContract, ExtractReturnsSortedKeypointsInsideTheImage) {
  const auto device = Create();
  const HostFeatures features = Extract(*device, Texture(3).view());
  EXPECT_GT(features.size(), 300);
  EXPECT_LE(features.size(), 500);
  const auto key = [](const Keypoint& k) { return std::tuple(k.octave, k.y_px, k.x_px, k.angle_rad); };
  for (int i = 0; i < features.size(); ++i) {
    const Keypoint& k = features.keypoints[i];
    EXPECT_GE(k.x_px, 0.0f);
    EXPECT_LE(k.x_px, kWidth - 1.0f);
    EXPECT_GE(k.y_px, 0.0f);
    EXPECT_LE(k.y_px, kHeight - 1.0f);
    EXPECT_GE(k.angle_rad, 0.0f);
    EXPECT_LT(k.angle_rad, 2 * std::numbers::pi_v<float>);
    EXPECT_GT(k.scale_px, 0.0f);
    EXPECT_GT(k.response, 0.0f);
    if (i > 0) {
      EXPECT_LT(key(features.keypoints[i - 1]), key(k)) << "keypoint " << i;
    }
  }
}

TEST_P(VisionDeviceContract, ExtractGivesDescriptorsOfEqualLength) {
  for (const bool root_sift : {false, true}) {
    ExtractOptions options = SmallOptions();
    options.root_sift = root_sift;
    const auto device = Create(SmallPlan(), options);
    const HostFeatures features = Extract(*device, Texture(3).view());
    ASSERT_GT(features.size(), 300);
    const auto length = [&](int i) {
      double squares = 0.0;
      for (int b = 0; b < kDescriptorBytes; ++b) squares += features.descriptor(i)[b] * features.descriptor(i)[b];
      return std::sqrt(squares);
    };
    const double expected = length(0);
    EXPECT_GT(expected, 250.0);
    for (int i = 0; i < features.size(); ++i) EXPECT_NEAR(length(i), expected, 0.03 * expected) << "feature " << i;
  }
}

TEST_P(VisionDeviceContract, ExtractSeesTheSameFeaturesAfterRotationAndScaling) {
  const std::vector<Blob> blobs = RandomBlobs(1600, kWidth, kHeight, 160.0, 40.0, 5);
  const Picture reference = Render(blobs, kWidth, kHeight, 120.0);
  VisionPlan plan = SmallPlan();
  const auto device = Create(plan);
  FeatureSetHandle reference_set;
  const HostFeatures features = Extract(*device, reference.view(), &reference_set);
  for (const auto& [scale, degrees] : {std::pair{1.0, 0.0}, {1.0, 37.0}, {1.0, 180.0}, {1.3, -70.0}, {0.7, 110.0}}) {
    const ViewOfScene view{scale, degrees * std::numbers::pi / 180, 160.0, 120.0, 160.0, 120.0};
    FeatureSetHandle set;
    const HostFeatures seen = Extract(*device, Render(blobs, kWidth, kHeight, 120.0, view).view(), &set);
    const std::vector<Match> matches =
        RunMatch(*device, DescriptorList::Whole(reference_set), DescriptorList::Whole(set), {0.8f, 0.85f, true});
    int visible = 0;
    for (const Keypoint& k : features.keypoints) {
      double u = 0.0, v = 0.0;
      view.Map(k.x_px, k.y_px, &u, &v);
      visible += u > 8 && v > 8 && u < kWidth - 9 && v < kHeight - 9 ? 1 : 0;
    }
    int right = 0;
    std::vector<double> position_errors, angle_errors, scale_ratios;
    for (const Match& m : matches) {
      const Keypoint& from = features.keypoints[m.query];
      const Keypoint& to = seen.keypoints[m.train];
      double u = 0.0, v = 0.0;
      view.Map(from.x_px, from.y_px, &u, &v);
      const double error = std::hypot(to.x_px - u, to.y_px - v);
      if (error > 1.5) continue;
      ++right;
      position_errors.push_back(error);
      angle_errors.push_back(AngleBetween(to.angle_rad - from.angle_rad, view.angle_rad));
      scale_ratios.push_back(to.scale_px / from.scale_px / scale);
    }
    const auto median = [](std::vector<double>& values) {
      std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
      return values[values.size() / 2];
    };
    ASSERT_GT(visible, 150);
    const std::string what = "scale " + std::to_string(scale) + ", " + std::to_string(degrees) + " degrees";
    EXPECT_GT(right, (scale == 1.0 ? 0.6 : 0.3) * visible) << what;
    // The CUDA device has 153 right ones of 171 in the smaller picture.
    EXPECT_GT(right, (scale < 1.0 ? 0.85 : 0.9) * static_cast<double>(matches.size())) << what;
    ASSERT_FALSE(position_errors.empty());
    EXPECT_LT(median(position_errors), 0.15) << what;
    EXPECT_LT(median(angle_errors), 0.04) << what;
    EXPECT_NEAR(median(scale_ratios), 1.0, 0.03) << what;
    device->ReleaseFeatureSet(set);
  }
}

TEST_P(VisionDeviceContract, ExtractDescribesDarkBlobsUprightWhenAsked) {
  // Blobs in pairs of unlike size, so that each has a direction; the left half is dark, the right one bright.
  std::vector<Blob> blobs;
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 8; ++column) {
      const double height = column < 4 ? -60.0 : 60.0;
      const double x = 20.0 + 40.0 * column, y = 24.0 + 48.0 * row, angle = 0.7 + 0.5 * row + 0.9 * column;
      blobs.push_back({x, y, 3.0, height});
      blobs.push_back({x + 9.0 * std::cos(angle), y + 9.0 * std::sin(angle), 2.0, 0.6 * height});
    }
  }
  const Picture picture = Render(blobs, kWidth, kHeight, 120.0);
  ExtractOptions options = SmallOptions();
  const HostFeatures oriented = Extract(*Create(SmallPlan(), options), picture.view());
  options.upright_dark = true;
  const HostFeatures features = Extract(*Create(SmallPlan(), options), picture.view());
  const auto near_blob = [&](const Keypoint& k, bool is_dark) {
    return std::any_of(blobs.begin(), blobs.end(), [&](const Blob& b) {
      return (b.height < 0.0) == is_dark && std::hypot(b.x_px - k.x_px, b.y_px - k.y_px) < 1.0;
    });
  };
  int num_dark = 0, num_bright = 0;
  for (const Keypoint& k : features.keypoints) {
    if (near_blob(k, true)) {
      ++num_dark;
      EXPECT_EQ(k.angle_rad, 0.0f);
    } else if (near_blob(k, false)) {
      ++num_bright;
      EXPECT_TRUE(std::any_of(
          oriented.keypoints.begin(), oriented.keypoints.end(),
          [&](const Keypoint& o) { return o.x_px == k.x_px && o.y_px == k.y_px && o.angle_rad == k.angle_rad; }))
          << k.x_px << ", " << k.y_px;
      EXPECT_NE(k.angle_rad, 0.0f);
    }
  }
  EXPECT_GE(num_dark, 20);
  EXPECT_GE(num_bright, 20);
}

TEST_P(VisionDeviceContract, ExtractKeepsTheMarginOfTheMaskAtEveryOctave) {
  ExtractOptions options = SmallOptions();
  options.reflection_threshold = 250;
  options.border_threshold = 12;
  options.mask_dilation_px = 4;
  VisionPlan plan = SmallPlan();
  plan.max_width_px = 2 * kWidth;
  plan.max_height_px = 2 * kHeight;
  const auto device = Create(plan, options);
  std::vector<Blob> blobs = RandomBlobs(3600, 2 * kWidth, 2 * kHeight, 20.0, 35.0, 9);
  Picture picture = Render(blobs, 2 * kWidth, 2 * kHeight, 110.0);
  Picture excluded{picture.width, picture.height, std::vector<std::uint8_t>(picture.pixels.size(), 0)};
  Picture static_mask{picture.width, picture.height, std::vector<std::uint8_t>(picture.pixels.size(), 255)};
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const bool is_reflection = std::hypot(x - 200, y - 150) < 9 || std::hypot(x - 450.5, y - 300.5) < 2;
      const bool is_surround = x + y < 90 || x > picture.width - 30;  // a cut corner, and a side
      const bool is_static = y > picture.height - 41;
      if (is_reflection) picture.at(x, y) = 255;
      if (is_surround) picture.at(x, y) = 3;
      if (is_static) static_mask.at(x, y) = 0;
      excluded.at(x, y) = is_reflection || is_surround || is_static ? 1 : 0;
    }
  }
  ASSERT_TRUE(device->SetStaticMask(static_mask.view()).ok());
  const HostFeatures features = Extract(*device, picture.view());
  ASSERT_GT(features.size(), 300);
  int num_coarse = 0;
  for (const Keypoint& k : features.keypoints) {
    num_coarse += k.octave >= 1 ? 1 : 0;
    const double margin = options.mask_dilation_px * std::exp2(k.octave);
    for (int y = static_cast<int>(std::ceil(k.y_px - margin)); y <= k.y_px + margin; ++y) {
      for (int x = static_cast<int>(std::ceil(k.x_px - margin)); x <= k.x_px + margin; ++x) {
        if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) continue;
        ASSERT_EQ(excluded.at(x, y), 0) << "keypoint at " << k.x_px << ", " << k.y_px << " in octave " << k.octave
                                        << ", excluded pixel " << x << ", " << y;
      }
    }
  }
  EXPECT_GT(num_coarse, 3);
}

TEST_P(VisionDeviceContract, ExtractLeavesDarkPlacesInsideTheSceneAlone) {
  ExtractOptions options = SmallOptions();
  options.border_threshold = 12;
  const auto device = Create(SmallPlan(), options);
  // A dark lumen in the middle, with faint structure in it; bright walls all around.
  std::vector<Blob> blobs = {{160, 120, 30, -110}};
  for (int i = 0; i < 9; ++i) blobs.push_back({140.0 + 20 * (i % 3), 100.0 + 20 * (i / 3), 2.5, 9});
  const HostFeatures features = Extract(*device, Render(blobs, kWidth, kHeight, 115.0).view());
  int found = 0;
  for (int i = 0; i < 9; ++i) {
    found += std::any_of(features.keypoints.begin(), features.keypoints.end(), [&](const Keypoint& k) {
      return std::hypot(k.x_px - blobs[i + 1].x_px, k.y_px - blobs[i + 1].y_px) < 1.5;
    });
  }
  EXPECT_GE(found, 7);
}

TEST_P(VisionDeviceContract, ExtractTakesAnImageOfAnotherSizeOnlyWithoutAStaticMask) {
  const auto device = Create();
  const Picture small = Render(RandomBlobs(300, 160, 120, 10, 40, 3), 160, 120, 120.0);
  EXPECT_GT(Extract(*device, small.view()).size(), 20);
  const Picture mask{kWidth, kHeight, std::vector<std::uint8_t>(static_cast<std::size_t>(kWidth) * kHeight, 255)};
  ASSERT_TRUE(device->SetStaticMask(mask.view()).ok());
  const FeatureSetHandle set = NewSet(*device);
  std::vector<Keypoint> keypoints(500);
  std::int32_t count = 0;
  EXPECT_EQ(device->EnqueueExtract(Lane::kTracking, {small.view(), set, keypoints, &count}).code(),
            StatusCode::kInvalidArgument);
  ASSERT_TRUE(device->SetStaticMask({}).ok());
  EXPECT_TRUE(device->EnqueueExtract(Lane::kTracking, {small.view(), set, keypoints, &count}).ok());
}

TEST_P(VisionDeviceContract, ExtractIsTheSameOnEveryRunAndAfterOtherImages) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures first = Extract(*device, picture.view());
  ASSERT_GT(first.size(), 300);
  Extract(*device, Texture(8).view());
  Extract(*device, Render(RandomBlobs(300, 160, 121, 10, 40, 3), 160, 121, 120.0).view());
  ExpectSameFeatures(Extract(*device, picture.view()), first);
  ExpectSameFeatures(Extract(*device, picture.view(), nullptr, Lane::kBackground), first);
  ExpectSameFeatures(Extract(*Create(), picture.view()), first);
}

TEST_P(VisionDeviceContract, BackgroundThatDoesNotExtractMatchesAllTheSame) {
  VisionPlan plan = SmallPlan();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*Create(plan), picture.view());
  plan.extracts_in_background = false;
  const auto device = Create(plan);
  FeatureSetHandle set;
  ExpectSameFeatures(Extract(*device, picture.view(), &set), expected);
  std::vector<Keypoint> keypoints(plan.max_features);
  std::int32_t count = 0;
  const FeatureSetHandle other = NewSet(*device);
  const ExtractRequest request = {picture.view(), other, keypoints, &count};
  const Result<Ticket> refused = device->EnqueueExtract(Lane::kBackground, request);
  EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument);
  EXPECT_NE(refused.status().message().find("extracts_in_background"), std::string::npos);
  EXPECT_TRUE(ExtractAndWait(*device, Lane::kTracking, request).ok()) << "the set was not touched";
  std::vector<Match> matches(plan.max_features);
  const DescriptorList list = DescriptorList::Whole(set);
  ASSERT_TRUE(MatchAndWait(*device, Lane::kBackground, {list, list, {}, nullptr, nullptr, matches, &count}).ok());
  EXPECT_GT(count, 0);
}

TEST_P(VisionDeviceContract, ExtractDoesNotDependOnPitchOrColourFormat) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  const int pitch = kWidth + 13;
  std::vector<std::uint8_t> padded(static_cast<std::size_t>(pitch) * kHeight, 77);
  std::vector<std::uint8_t> bgr;
  for (int y = 0; y < kHeight; ++y) {
    std::copy_n(picture.view().row(y), kWidth, padded.data() + static_cast<std::size_t>(y) * pitch);
    for (int x = 0; x < kWidth; ++x) bgr.insert(bgr.end(), 3, picture.view().row(y)[x]);
  }
  ExpectSameFeatures(Extract(*device, {padded.data(), kWidth, kHeight, pitch, PixelFormat::kGrey8}), expected);
  ExpectSameFeatures(Extract(*device, {bgr.data(), kWidth, kHeight, 3 * kWidth, PixelFormat::kBgr8}), expected);
}

// The luma of a YUV picture is the grey picture; what the colour bytes hold does not matter.
TEST_P(VisionDeviceContract, ExtractTakesTheLumaOfYuvFormats) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  ASSERT_GT(expected.size(), 300);
  std::mt19937 random(7);
  for (const int padding : {0, 6, 32}) {
    const int pitch = kWidth + padding;
    const int pitch_of_pairs = 2 * kWidth + padding;
    // Noise everywhere but in the luma.
    std::vector<std::uint8_t> nv12(static_cast<std::size_t>(pitch) * MemoryRows(PixelFormat::kNv12, kHeight));
    std::vector<std::uint8_t> yuyv(static_cast<std::size_t>(pitch_of_pairs) * kHeight);
    for (auto* bytes : {&nv12, &yuyv}) {
      for (std::uint8_t& byte : *bytes) byte = static_cast<std::uint8_t>(random());
    }
    std::vector<std::uint8_t> uyvy = yuyv;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const std::uint8_t grey = picture.view().row(y)[x];
        nv12[static_cast<std::size_t>(y) * pitch + x] = grey;
        yuyv[static_cast<std::size_t>(y) * pitch_of_pairs + 2 * x] = grey;
        uyvy[static_cast<std::size_t>(y) * pitch_of_pairs + 2 * x + 1] = grey;
      }
    }
    SCOPED_TRACE(padding);
    ExpectSameFeatures(Extract(*device, {nv12.data(), kWidth, kHeight, pitch, PixelFormat::kNv12}), expected);
    ExpectSameFeatures(Extract(*device, {yuyv.data(), kWidth, kHeight, pitch_of_pairs, PixelFormat::kYuyv}), expected);
    ExpectSameFeatures(Extract(*device, {uyvy.data(), kWidth, kHeight, pitch_of_pairs, PixelFormat::kUyvy}), expected);
  }
}

TEST_P(VisionDeviceContract, ExtractRefusesOddSidesOfPicturesWithHalvedColour) {
  const auto device = Create();
  const FeatureSetHandle set = NewSet(*device);
  std::vector<Keypoint> keypoints(device->plan().max_features);
  std::int32_t count = 0;
  const std::vector<std::uint8_t> bytes(2 * kWidth * kHeight);
  const auto code = [&](int width, int height, PixelFormat format) {
    const ImageView image{bytes.data(), width, height, 2 * kWidth, format};
    return device->EnqueueExtract(Lane::kTracking, {image, set, keypoints, &count}).code();
  };
  EXPECT_EQ(code(kWidth - 1, kHeight, PixelFormat::kNv12), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(kWidth, kHeight - 1, PixelFormat::kNv12), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(kWidth - 1, kHeight, PixelFormat::kYuyv), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(kWidth - 1, kHeight, PixelFormat::kUyvy), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(kWidth, kHeight - 1, PixelFormat::kUyvy), StatusCode::kOk);
}

TEST_P(VisionDeviceContract, ExtractOfUniformImageFindsNothing) {
  const auto device = Create();
  for (const std::uint8_t grey : {0, 100, 255}) {
    const Picture picture{kWidth, kHeight, std::vector<std::uint8_t>(static_cast<std::size_t>(kWidth) * kHeight, grey)};
    EXPECT_EQ(Extract(*device, picture.view()).size(), 0);
  }
}

TEST_P(VisionDeviceContract, ExtractOverTheLimitKeepsStrongPoints) {
  ExtractOptions options = SmallOptions();
  options.num_features = 125;  // a round blob may have several orientations
  const auto device = Create(SmallPlan(), options);
  std::vector<Blob> strong;
  for (int i = 0; i < 40; ++i) strong.push_back({20.0 + 38 * (i % 8), 24.0 + 46 * (i / 8), 3.0, 60});
  std::vector<Blob> all = strong;
  const std::vector<Blob> weak = RandomBlobs(700, kWidth, kHeight, 0.0, 6.0, 11);
  all.insert(all.end(), weak.begin(), weak.end());
  const HostFeatures features = Extract(*device, Render(all, kWidth, kHeight, 100.0).view());
  EXPECT_LE(features.size(), 125);
  for (const Blob& blob : strong) {
    EXPECT_TRUE(
        std::any_of(features.keypoints.begin(), features.keypoints.end(),
                    [&](const Keypoint& k) { return std::hypot(k.x_px - blob.x_px, k.y_px - blob.y_px) < 1.0; }))
        << "blob at " << blob.x_px << ", " << blob.y_px;
  }
}

TEST_P(VisionDeviceContract, ExtractOfFewerFeaturesIsThatOfADevicePlannedForFewer) {
  const auto device = Create();
  const Picture picture = Texture(3);
  const HostFeatures many = Extract(*device, picture.view());
  for (const int max_features : {1, 60, 10'000}) {
    ExtractOptions options = SmallOptions();
    options.num_features = std::min(max_features, options.num_features);
    const HostFeatures expected = Extract(*Create(SmallPlan(), options), picture.view());
    const HostFeatures fewer = Extract(*device, picture.view(), nullptr, Lane::kTracking, max_features);
    EXPECT_GT(fewer.size(), 0);
    EXPECT_LE(fewer.size(), max_features);
    ASSERT_EQ(fewer.size(), expected.size()) << max_features;
    EXPECT_EQ(fewer.descriptors, expected.descriptors) << max_features;
    for (int i = 0; i < fewer.size(); ++i) EXPECT_EQ(fewer.keypoints[i].x_px, expected.keypoints[i].x_px);
  }
  EXPECT_EQ(Extract(*device, picture.view()).descriptors, many.descriptors) << "not for the next request";
}

TEST_P(VisionDeviceContract, ExtractWithoutFineScalesFindsTheOthersAsBefore) {
  const auto device = Create();
  // So few that the limit leaves none out.
  const Picture picture = Render(RandomBlobs(250, kWidth, kHeight, 20.0, 40.0, 3), kWidth, kHeight, 120.0);
  const HostFeatures all = Extract(*device, picture.view());
  ASSERT_LT(all.size(), 500);
  for (const float min_scale_px : {0.5f, 1.8f, 3.6f}) {
    const HostFeatures coarse = Extract(*device, picture.view(), nullptr, Lane::kTracking, 0, min_scale_px);
    EXPECT_LE(coarse.size(), 500);
    int num_wanted = 0, num_found = 0;
    for (int i = 0; i < all.size(); ++i) {
      const Keypoint& k = all.keypoints[i];
      if (k.scale_px < min_scale_px) continue;
      ++num_wanted;
      for (int j = 0; j < coarse.size(); ++j) {
        const Keypoint& c = coarse.keypoints[j];
        const float turn = std::abs(std::remainder(c.angle_rad - k.angle_rad, 2 * std::numbers::pi_v<float>));
        if (std::hypot(c.x_px - k.x_px, c.y_px - k.y_px) > 0.1f * k.scale_px || turn > 0.1f) continue;
        if (std::abs(c.scale_px - k.scale_px) > 0.05f * k.scale_px) continue;
        if (Similarity(all.descriptor(i), coarse.descriptor(j)) < 0.99) continue;
        ++num_found;
        break;
      }
    }
    EXPECT_GT(num_wanted, 20) << min_scale_px;
    EXPECT_GE(num_found, 0.95 * num_wanted) << min_scale_px;
  }
  EXPECT_EQ(Extract(*device, picture.view()).descriptors, all.descriptors) << "not for the next request";
}

TEST_P(VisionDeviceContract, FollowFindsFeaturesWhereTheSceneHasMovedThem) {
  VisionPlan plan = SmallPlan();
  ExtractOptions options = SmallOptions();
  options.num_features = 200;
  const auto device = Create(plan, options);
  const std::vector<Blob> blobs = RandomBlobs(900, kWidth, kHeight, 40.0, 45.0, 7);
  // Moved, turned a little, and in a dimmer light.
  ViewOfScene moved;
  moved.angle_rad = 0.02;
  moved.picture_x = 6.3;
  moved.picture_y = -4.6;
  Picture now = Render(blobs, kWidth, kHeight, 120.0, moved);
  for (std::uint8_t& pixel : now.pixels) pixel = static_cast<std::uint8_t>(10 + pixel * 7 / 10);

  const HostFeatures last = Extract(*device, Render(blobs, kWidth, kHeight, 120.0).view());
  const std::vector<Keypoint>& before = last.keypoints;
  ASSERT_GT(before.size(), 150u);
  // Detection is to find one.
  const HostFeatures current = Follow(*device, now, before, 1);
  const std::vector<Keypoint>& found = current.keypoints;
  int num_inside = 0, num_followed = 0;
  std::vector<double> errors;
  for (std::size_t i = 0; i < before.size(); ++i) {
    double x = 0.0, y = 0.0;
    moved.Map(before[i].x_px, before[i].y_px, &x, &y);
    if (x < 30.0 || y < 30.0 || x > kWidth - 30.0 || y > kHeight - 30.0) continue;
    ++num_inside;
    for (std::size_t k = 1; k < found.size(); ++k) {
      if (found[k].scale_px != before[i].scale_px || found[k].angle_rad != before[i].angle_rad ||
          found[k].octave != before[i].octave || found[k].response != before[i].response) {
        continue;
      }
      ++num_followed;
      errors.push_back(std::hypot(found[k].x_px - x, found[k].y_px - y));
      EXPECT_GT(Similarity(last.descriptor(static_cast<int>(i)), current.descriptor(static_cast<int>(k))), 0.9);
      break;
    }
  }
  ASSERT_GT(num_inside, 80);
  EXPECT_GT(num_followed, 0.8 * num_inside);
  ASSERT_FALSE(errors.empty());
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.6);
}

TEST_P(VisionDeviceContract, FollowLeavesOutWhatDetectionHasFoundAndWhatIsGone) {
  VisionPlan plan = SmallPlan();
  ExtractOptions options = SmallOptions();
  options.num_features = 250;
  const auto device = Create(plan, options);
  const Picture picture = Render(RandomBlobs(250, kWidth, kHeight, 20.0, 45.0, 7), kWidth, kHeight, 120.0);
  const Picture other = Render(RandomBlobs(900, kWidth, kHeight, 20.0, 45.0, 8), kWidth, kHeight, 120.0);
  const std::vector<Keypoint> before = Extract(*device, picture.view()).keypoints;
  ASSERT_GT(before.size(), 100u);
  // The same picture again: all are detected.
  EXPECT_EQ(Follow(*device, picture, before, 0).keypoints.size(), before.size());
  // Another scene: a feature may look like what happens to be in its place, few do.
  EXPECT_LT(Follow(*device, other, before, 1).keypoints.size(), 1 + before.size() / 20);
  // After a picture of another size nothing is known.
  const Picture small = Render({{60.0, 60.0, 3.0, 60.0}}, kWidth / 2, kHeight / 2, 120.0);
  (void)Extract(*device, small.view());
  std::int32_t num_followed = -1;
  EXPECT_EQ(Follow(*device, picture, before, 1, &num_followed).keypoints.size(), 1u);
  EXPECT_EQ(num_followed, 0);
}

TEST_P(VisionDeviceContract, FollowStopsWhereTheSetIsFullAndRepeatsToTheBit) {
  VisionPlan plan = SmallPlan();
  plan.max_features = 120;
  ExtractOptions options = SmallOptions();
  options.num_features = 100;
  const auto device = Create(plan, options);
  const Picture picture = Texture(3);
  const std::vector<Keypoint> before = Extract(*device, picture.view()).keypoints;
  ASSERT_EQ(before.size(), 100u);
  std::int32_t num_followed = -1;
  const HostFeatures once = Follow(*device, picture, before, 10, &num_followed);
  EXPECT_GT(once.keypoints.size(), 60u);
  EXPECT_EQ(num_followed, once.size() - 10);
  std::vector<Keypoint> many = before;
  many.insert(many.end(), before.begin(), before.begin() + 20);
  EXPECT_LE(Follow(*device, picture, many, 50, &num_followed).keypoints.size(), 120u);
  EXPECT_LE(num_followed, 70);
  EXPECT_EQ(Follow(*device, picture, before, 10).descriptors, once.descriptors);
}

TEST_P(VisionDeviceContract, FollowRefusesFeaturesOutsideThePicture) {
  const auto device = Create();
  std::vector<Keypoint> keypoints(device->plan().max_features);
  std::int32_t count = 0;
  const Picture picture = Texture(3);
  const Keypoint good{100.0f, 80.0f, 2.0f, 0.0f, 0.1f, 0};
  Keypoint left = good, nan = good, coarse = good, flat = good;
  left.x_px = -1.0f;
  nan.y_px = std::numeric_limits<float>::quiet_NaN();
  coarse.octave = 9;
  flat.scale_px = 0.0f;
  const FeatureSetHandle set = NewSet(*device);
  for (const Keypoint& bad : {left, nan, coarse, flat}) {
    ExtractRequest request{picture.view(), set, keypoints, &count};
    request.follow = {&bad, 1};
    for (const int num_only_followed : {0, 1}) {
      request.num_only_followed = num_only_followed;
      EXPECT_EQ(device->EnqueueExtract(Lane::kTracking, request).status().code(), StatusCode::kInvalidArgument);
    }
  }
}

// None are followed into a picture of another size, and none are refused.
TEST_P(VisionDeviceContract, FollowTakesFeaturesOfALargerPictureAndFollowsNone) {
  const auto device = Create();
  const Picture picture = Texture(3);
  const std::vector<Keypoint> before = Extract(*device, picture.view()).keypoints;
  Picture small{kWidth / 4, kHeight / 4, {}};
  small.pixels.resize(static_cast<std::size_t>(small.width) * small.height);
  for (int y = 0; y < small.height; ++y) std::copy_n(picture.view().row(y), small.width, &small.at(0, y));
  std::vector<FollowedPoint> followed_to = StalePoints(before.size());
  std::int32_t num_followed = -1;
  const HostFeatures seen = Follow(*device, small, before, 0, &num_followed, 0, followed_to);
  EXPECT_EQ(num_followed, 0);
  EXPECT_FALSE(std::any_of(followed_to.begin(), followed_to.end(), [](const FollowedPoint& p) { return p.is_found; }));
  ExpectSameFeatures(seen, Extract(*Create(), small.view()));
  // Into a second one of that size some would be followed from outside.
  std::vector<Keypoint> keypoints(device->plan().max_features);
  std::int32_t count = -7;
  ExtractRequest request{small.view(), NewSet(*device), keypoints, &count};
  request.follow = before;
  EXPECT_EQ(device->EnqueueExtract(Lane::kTracking, request).status().code(), StatusCode::kInvalidArgument);
}

TEST_P(VisionDeviceContract, FollowRefusesListsOfWrongLength) {
  const auto device = Create();
  const std::size_t max_features = device->plan().max_features;
  const Picture picture = Texture(3);
  const FeatureSetHandle set = NewSet(*device);
  std::vector<Keypoint> keypoints(max_features);
  std::int32_t count = -7, num_followed = -7;
  const std::vector<Keypoint> many(2 * max_features + 1, Keypoint{100.0f, 80.0f, 2.0f, 0.0f, 0.1f, 0});
  std::vector<FollowedPoint> followed_to = StalePoints(many.size());
  const auto run = [&](std::size_t num_follow, int num_only_followed, std::size_t num_followed_to) {
    ExtractRequest request{picture.view(), set, keypoints, &count};
    request.follow = std::span(many).first(num_follow);
    request.num_only_followed = num_only_followed;
    request.followed_to = std::span(followed_to).first(num_followed_to);
    request.num_followed = &num_followed;
    return ExtractAndWait(*device, Lane::kTracking, request).code();
  };
  EXPECT_EQ(run(2 * max_features + 1, 0, 0), StatusCode::kInvalidArgument);
  EXPECT_EQ(run(2 * max_features + 1, static_cast<int>(max_features) + 1, 2 * max_features + 1),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(run(10, -1, 10), StatusCode::kInvalidArgument);
  EXPECT_EQ(run(10, 11, 10), StatusCode::kInvalidArgument);
  EXPECT_EQ(run(0, 1, 0), StatusCode::kInvalidArgument);
  EXPECT_EQ(run(10, 5, 9), StatusCode::kInvalidArgument);
  EXPECT_EQ(run(10, 5, 11), StatusCode::kInvalidArgument);
  EXPECT_EQ(run(0, 0, 1), StatusCode::kInvalidArgument);
  EXPECT_EQ(count, -7);
  EXPECT_EQ(num_followed, -7);
  EXPECT_TRUE(std::all_of(followed_to.begin(), followed_to.end(), [](const FollowedPoint& p) { return p.is_sure; }))
      << "a refused request touches no buffer";
  // The set was not touched either.
  EXPECT_EQ(run(10, 10, 10), StatusCode::kOk);
  device->ReleaseFeatureSet(set);
  for (const std::size_t num_follow : {max_features + 1, 2 * max_features}) {
    followed_to = StalePoints(num_follow);
    (void)Follow(*device, picture, std::span(many).first(num_follow), 1, &num_followed, static_cast<int>(num_follow),
                 followed_to);
    EXPECT_EQ(num_followed, 0);
    EXPECT_TRUE(std::all_of(followed_to.begin(), followed_to.end(), [](const FollowedPoint& p) {
      return p.is_found && std::hypot(p.x_px - 100.0f, p.y_px - 80.0f) < 0.1f;
    })) << num_follow;
    (void)Follow(*device, picture, std::span(many).first(num_follow), 1);
  }
}

TEST_P(VisionDeviceContract, FollowTellsOfAllWhereTheyAreAndMakesNoFeaturesOfTheFirst) {
  ExtractOptions options = SmallOptions();
  options.num_features = 200;
  const auto device = Create(SmallPlan(), options);
  const std::vector<Blob> blobs = RandomBlobs(900, kWidth, kHeight, 40.0, 45.0, 7);
  const Picture last = Render(blobs, kWidth, kHeight, 120.0);
  ViewOfScene moved;
  moved.angle_rad = 0.02;
  moved.picture_x = 6.3;
  moved.picture_y = -4.6;
  const Picture now = Render(blobs, kWidth, kHeight, 120.0, moved);
  std::vector<Keypoint> before = Extract(*device, last.view()).keypoints;
  ASSERT_GT(before.size(), 150u);
  // Sorted they are: both parts are to hold some of every octave, from all over the picture.
  std::shuffle(before.begin(), before.end(), std::mt19937(5));
  const std::size_t num_only_followed = before.size() / 2;
  const std::span<const Keypoint> others = std::span<const Keypoint>(before).subspan(num_only_followed);

  std::int32_t expected_num_followed = -1, num_followed = -1;
  const HostFeatures expected = Follow(*device, now, others, 20, &expected_num_followed);
  ASSERT_GT(expected_num_followed, 30);
  (void)Extract(*device, last.view());
  std::vector<FollowedPoint> followed_to = StalePoints(before.size());
  const HostFeatures current =
      Follow(*device, now, before, 20, &num_followed, static_cast<int>(num_only_followed), followed_to);
  EXPECT_EQ(num_followed, expected_num_followed);
  ExpectSameFeatures(current, expected);

  // By part: those that are only followed, and the others.
  std::array<int, 2> num_inside{}, num_sure{};
  std::vector<double> errors;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const FollowedPoint& point = followed_to[i];
    EXPECT_TRUE(point.is_found || !point.is_sure) << "point " << i;
    double x = 0.0, y = 0.0;
    moved.Map(before[i].x_px, before[i].y_px, &x, &y);
    if (!IsWellInside(x, y)) continue;
    const int part = i < num_only_followed ? 0 : 1;
    ++num_inside[part];
    if (!point.is_sure) continue;
    ++num_sure[part];
    errors.push_back(std::hypot(point.x_px - x, point.y_px - y));
    EXPECT_LT(errors.back(), 0.5) << "point " << i << " at " << x << ", " << y;
  }
  for (const int part : {0, 1}) {
    ASSERT_GT(num_inside[part], 40) << part;
    EXPECT_GT(num_sure[part], 0.8 * num_inside[part]) << part;
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1);
  // What became a feature lies where followed_to says.
  for (int k = current.size() - num_followed; k < current.size(); ++k) {
    const Keypoint& feature = current.keypoints[k];
    EXPECT_TRUE(std::any_of(
        followed_to.begin() + num_only_followed, followed_to.end(),
        [&](const FollowedPoint& p) { return p.is_sure && p.x_px == feature.x_px && p.y_px == feature.y_px; }))
        << "feature " << k;
  }
}

TEST_P(VisionDeviceContract, FollowNeedsNoRoomInTheSetToTellWherePointsAre) {
  VisionPlan plan = SmallPlan();
  plan.max_features = 100;
  ExtractOptions options = SmallOptions();
  options.num_features = 100;
  const auto device = Create(plan, options);
  const std::vector<Blob> blobs = RandomBlobs(900, kWidth, kHeight, 40.0, 45.0, 7);
  const Picture last = Render(blobs, kWidth, kHeight, 120.0);
  ViewOfScene moved;
  moved.picture_x = -3.4;
  moved.picture_y = 2.7;
  const Picture now = Render(blobs, kWidth, kHeight, 120.0, moved);
  const HostFeatures detected = Extract(*device, now.view());
  ASSERT_EQ(detected.size(), 100) << "the set is full";
  const std::vector<Keypoint> before = Extract(*device, last.view()).keypoints;
  // As many as are possible: the first half only followed, the others without room.
  std::vector<Keypoint> twice = before;
  twice.insert(twice.end(), before.begin(), before.end());
  std::vector<FollowedPoint> followed_to(twice.size());
  std::int32_t num_followed = -1;
  ExpectSameFeatures(Follow(*device, now, twice, 0, &num_followed, static_cast<int>(before.size()), followed_to),
                     detected);
  EXPECT_EQ(num_followed, 0);
  int num_inside = 0, num_right = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const FollowedPoint& point = followed_to[i];
    const FollowedPoint& again = followed_to[i + before.size()];
    EXPECT_EQ(point.is_found, again.is_found) << "point " << i;
    EXPECT_EQ(point.is_sure, again.is_sure) << "point " << i;
    double x = 0.0, y = 0.0;
    moved.Map(before[i].x_px, before[i].y_px, &x, &y);
    if (point.is_found) {
      EXPECT_EQ(point.x_px, again.x_px) << "point " << i;
      EXPECT_EQ(point.y_px, again.y_px) << "point " << i;
    }
    if (!IsWellInside(x, y)) continue;
    ++num_inside;
    num_right += point.is_found && std::hypot(point.x_px - x, point.y_px - y) < 0.5;
  }
  ASSERT_GT(num_inside, 40);
  EXPECT_GT(num_right, 0.8 * num_inside);
}

TEST_P(VisionDeviceContract, FollowTellsOfNoneFoundWhereNothingWasFollowed) {
  const auto device = Create();
  const Picture picture = Texture(3);
  // A part of it: what is followed all the same would be found.
  Picture small{kWidth / 2, kHeight / 2, {}};
  small.pixels.resize(static_cast<std::size_t>(small.width) * small.height);
  for (int y = 0; y < small.height; ++y) std::copy_n(picture.view().row(y), small.width, &small.at(0, y));
  const std::vector<Keypoint> of_picture = Extract(*Create(), picture.view()).keypoints;
  const std::vector<Keypoint> of_small = Extract(*Create(), small.view()).keypoints;
  ASSERT_GT(of_picture.size(), 300u);
  ASSERT_GT(of_small.size(), 60u);
  std::int32_t num_followed = -1;
  const auto num_found = [&](const Picture& now, const std::vector<Keypoint>& keypoints, Lane lane = Lane::kTracking) {
    std::vector<FollowedPoint> followed_to = StalePoints(keypoints.size());
    num_followed = -1;
    (void)Follow(*device, now, keypoints, 1, &num_followed, static_cast<int>(keypoints.size()) / 2, followed_to, lane);
    return std::count_if(followed_to.begin(), followed_to.end(),
                         [](const FollowedPoint& p) { return p.is_found || p.is_sure; });
  };
  EXPECT_EQ(num_found(picture, of_picture), 0) << "the first picture";
  EXPECT_EQ(num_followed, 0);
  EXPECT_GT(num_found(picture, of_picture), 150);
  EXPECT_GT(num_followed, 0);
  EXPECT_EQ(num_found(picture, of_picture, Lane::kBackground), 0) << "the first picture of the other lane";
  EXPECT_EQ(num_followed, 0);
  EXPECT_EQ(num_found(small, of_small), 0) << "after a larger picture";
  EXPECT_EQ(num_followed, 0);
  EXPECT_GT(num_found(small, of_small), 30);
  EXPECT_EQ(num_found(picture, of_small), 0) << "after a smaller picture";
  EXPECT_EQ(num_followed, 0);
  EXPECT_GT(num_found(picture, of_picture), 150);
}

// The caller gave the picture up and knows of no features in it.
TEST_P(VisionDeviceContract, FollowTellsOfNoneFoundAfterAPictureThatWasGivenUp) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures features = Extract(*device, picture.view());
  std::vector<FollowedPoint> to(features.keypoints.size());
  for (const int wait_us : {0, 300, 1000, 2000, 4000, 8000, 16000}) {
    QueuedExtraction left(*device, picture.view());
    const TimePoint deadline =
        TimePoint{std::chrono::steady_clock::now().time_since_epoch()} + std::chrono::microseconds(wait_us);
    const bool is_given_up = device->Wait(left.ticket, deadline).code() == StatusCode::kDeadlineExceeded;
    device->ReleaseFeatureSet(left.set);
    (void)Follow(*device, picture, features.keypoints, 0, nullptr, 0, to);
    const auto num_found = std::count_if(to.begin(), to.end(), [](const FollowedPoint& p) { return p.is_found; });
    if (is_given_up) {
      EXPECT_EQ(num_found, 0) << wait_us << " us";
    } else {
      EXPECT_GT(num_found, 0) << wait_us << " us";
    }
  }
}

TEST_P(VisionDeviceContract, FollowFindsNoPointWhosePlaceHoldsOtherContent) {
  const auto device = Create();
  const Picture last = Render(RandomBlobs(900, kWidth, kHeight, 20.0, 45.0, 7), kWidth, kHeight, 120.0);
  const Picture other = Render(RandomBlobs(900, kWidth, kHeight, 20.0, 45.0, 8), kWidth, kHeight, 120.0);
  // The left half of another scene.
  Picture mixed = last;
  for (int y = 0; y < kHeight; ++y) std::copy_n(other.view().row(y), kWidth / 2, &mixed.at(0, y));
  const std::vector<Keypoint> before = Extract(*device, last.view()).keypoints;
  std::vector<FollowedPoint> followed_to = StalePoints(before.size());
  const int num_points = static_cast<int>(before.size());
  (void)Follow(*device, mixed, before, 1, nullptr, num_points, followed_to);
  int num_gone = 0, num_gone_found = 0, num_gone_sure = 0, num_left = 0, num_left_sure = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (!IsWellInside(before[i].x_px, before[i].y_px)) continue;
    if (before[i].x_px < kWidth / 2 - 20) {
      ++num_gone;
      num_gone_found += followed_to[i].is_found;
      num_gone_sure += followed_to[i].is_sure;
    } else if (before[i].x_px > kWidth / 2 + 20) {
      ++num_left;
      num_left_sure += followed_to[i].is_sure;
    }
  }
  ASSERT_GT(num_gone, 60);
  ASSERT_GT(num_left, 60);
  // A place may look like another by chance.
  EXPECT_LT(num_gone_found, 0.15 * num_gone);
  EXPECT_LT(num_gone_sure, 0.05 * num_gone);
  EXPECT_GT(num_left_sure, 0.8 * num_left);

  const Picture flat{kWidth, kHeight, std::vector<std::uint8_t>(last.pixels.size(), 120)};
  (void)Extract(*device, last.view());
  followed_to = StalePoints(before.size());
  (void)Follow(*device, flat, before, 1, nullptr, num_points, followed_to);
  EXPECT_TRUE(std::none_of(followed_to.begin(), followed_to.end(), [](const FollowedPoint& p) {
    return p.is_found || p.is_sure;
  })) << "no texture, no point";
}

TEST_P(VisionDeviceContract, ExtractOverTheLimitSpreadsOverTheImage) {
  VisionPlan plan = SmallPlan();
  plan.max_width_px = 640;
  plan.max_height_px = 480;
  const auto device = Create(plan);
  // Everywhere more than there is room for; the left half has twice the contrast.
  std::vector<Blob> blobs = RandomBlobs(6000, 640, 480, 0.0, 20.0, 12);
  for (Blob& blob : blobs) blob.height *= blob.x_px < 320 ? 2.0 : 1.0;
  const HostFeatures features = Extract(*device, Render(blobs, 640, 480, 120.0).view());
  EXPECT_GE(features.size(), 480);
  int num_right = 0;
  std::array<int, 16> parts{};
  for (const Keypoint& k : features.keypoints) {
    num_right += k.x_px >= 320 ? 1 : 0;
    ++parts[static_cast<int>(k.y_px / 120) * 4 + static_cast<int>(k.x_px / 160)];
  }
  EXPECT_GT(num_right, features.size() / 8);
  for (const int count : parts) EXPECT_GT(count, 4);
}

TEST_P(VisionDeviceContract, ExtractWithHigherContrastThresholdGivesASubset) {
  const Picture picture = Texture(6, 25.0);
  ExtractOptions options = SmallOptions();
  options.contrast_threshold = 0.008f;
  const HostFeatures many = Extract(*Create(SmallPlan(), options), picture.view());
  options.contrast_threshold = 0.014f;
  const HostFeatures few = Extract(*Create(SmallPlan(), options), picture.view());
  ASSERT_LT(many.size(), 500);
  EXPECT_LT(few.size(), many.size());
  EXPECT_GT(few.size(), 0);
  for (const Keypoint& k : few.keypoints) {
    EXPECT_GE(k.response, 0.014f);
    EXPECT_TRUE(std::any_of(many.keypoints.begin(), many.keypoints.end(),
                            [&](const Keypoint& m) { return m.x_px == k.x_px && m.y_px == k.y_px; }));
  }
}

TEST_P(VisionDeviceContract, ExtractSuppressesEdges) {
  ExtractOptions options = SmallOptions();
  options.edge_threshold = 5.0f;
  const auto device = Create(SmallPlan(), options);
  Picture picture = Render({}, kWidth, kHeight, 80.0);
  // A soft slanted edge, and nothing else.
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      picture.at(x, y) = static_cast<std::uint8_t>(std::lround(120 + 60 * std::tanh((x - 160 + 0.3 * (y - 120)) / 3)));
    }
  }
  EXPECT_LE(Extract(*device, picture.view()).size(), 10);
}

TEST_P(VisionDeviceContract, ExtractRefusesBadRequests) {
  const auto device = Create();
  const Picture picture = Texture(1);
  const FeatureSetHandle set = NewSet(*device);
  std::vector<Keypoint> keypoints(500);
  std::int32_t count = -7;
  const auto code = [&](const ExtractRequest& request) {
    return device->EnqueueExtract(Lane::kTracking, request).code();
  };
  EXPECT_EQ(code({{}, set, keypoints, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({picture.view(), {}, keypoints, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({picture.view(), {set.index, set.generation + 1}, keypoints, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({picture.view(), set, {keypoints.data(), 499}, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({picture.view(), set, keypoints, nullptr}), StatusCode::kInvalidArgument);
  const Picture large{kWidth + 1, kHeight, std::vector<std::uint8_t>(static_cast<std::size_t>(kWidth + 1) * kHeight)};
  EXPECT_EQ(code({large.view(), set, keypoints, &count}), StatusCode::kInvalidArgument);
  ImageView narrow = picture.view();
  narrow.pitch_bytes = kWidth - 1;
  EXPECT_EQ(code({narrow, set, keypoints, &count}), StatusCode::kInvalidArgument);
  ImageView tiny = picture.view();
  tiny.width = 8;
  EXPECT_EQ(code({tiny, set, keypoints, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(count, -7);
  EXPECT_EQ(device->SetStaticMask(large.view()).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({picture.view(), set, keypoints, &count}), StatusCode::kOk);
}

// ---- Brute-force matching -------------------------------------------------------------------------------------------

TEST_P(VisionDeviceContract, MatchAgreesWithDoubleLoop) {
  const auto device = Create();
  for (const auto& [num_query, num_train] : {std::pair{200, 300}, {1, 1}, {7, 16}, {17, 15}, {33, 500}, {500, 2}}) {
    const HostFeatures train = RandomFeatures(num_train, 100 + num_train);
    const HostFeatures query = RandomFeatures(num_query, 200 + num_query, &train);
    const FeatureSetHandle query_set = Write(*device, query);
    const FeatureSetHandle train_set = Write(*device, train);
    for (const MatchOptions& options :
         {MatchOptions{}, MatchOptions{0.9f, 1.0f, false}, MatchOptions{0.0f, 0.8f, false},
          MatchOptions{0.0f, 1.0f, true}, MatchOptions{0.5f, 0.9f, true}}) {
      ExpectSameMatches(RunMatch(*device, DescriptorList::Whole(query_set), DescriptorList::Whole(train_set), options),
                        NaiveMatch(AllOf(query), AllOf(train), options));
    }
    device->ReleaseFeatureSet(query_set);
    device->ReleaseFeatureSet(train_set);
  }
}

TEST_P(VisionDeviceContract, MatchIsExactForTheLargestBytes) {
  const auto device = Create();
  HostFeatures features = RandomFeatures(3, 1);
  std::fill(features.descriptors.begin(), features.descriptors.end(), std::uint8_t{255});
  features.descriptors[0] = 254;                     // first: nearly the same as the others
  features.descriptors[2 * kDescriptorBytes] = 253;  // third: a little farther
  const FeatureSetHandle set = Write(*device, features);
  const std::vector<Match> matches = RunMatch(*device, DescriptorList::Whole(set), DescriptorList::Whole(set), {});
  ASSERT_EQ(matches.size(), 3u);
  for (const Match& m : matches) EXPECT_NEAR(m.similarity, 1.0f, 1e-6f);
}

TEST_P(VisionDeviceContract, MatchOfEqualDescriptorsTakesTheLowestPosition) {
  const auto device = Create();
  HostFeatures features = RandomFeatures(40, 1);
  for (int i = 0; i < 40; ++i) {
    std::copy_n(features.descriptor(0), kDescriptorBytes,
                features.descriptors.data() + static_cast<std::size_t>(i) * kDescriptorBytes);
  }
  const FeatureSetHandle set = Write(*device, features);
  const std::vector<Match> matches = RunMatch(*device, DescriptorList::Whole(set), DescriptorList::Whole(set), {});
  ASSERT_EQ(matches.size(), 40u);
  for (const Match& m : matches) {
    EXPECT_EQ(m.train, 0);
    EXPECT_NEAR(m.second_similarity, 1.0f, 1e-6f);
  }
  const std::vector<Match> mutual =
      RunMatch(*device, DescriptorList::Whole(set), DescriptorList::Whole(set), {0.0f, 1.0f, true});
  ASSERT_EQ(mutual.size(), 1u);
  EXPECT_EQ(mutual[0].query, 0);
  EXPECT_EQ(mutual[0].train, 0);
}

TEST_P(VisionDeviceContract, MatchOfEmptyListsFindsNothing) {
  const auto device = Create();
  const FeatureSetHandle empty = NewSet(*device);
  const FeatureSetHandle full = Write(*device, RandomFeatures(20, 1));
  const DescriptorList whole = DescriptorList::Whole(full);
  EXPECT_TRUE(RunMatch(*device, DescriptorList::Whole(empty), whole, {}).empty());
  EXPECT_TRUE(RunMatch(*device, whole, DescriptorList::Whole(empty), {}).empty());
  EXPECT_TRUE(RunMatch(*device, DescriptorList::Subset(full, {}), whole, {}).empty());
  EXPECT_TRUE(RunMatch(*device, whole, DescriptorList::Subset(full, {}), {}).empty());
  const FeatureSetHandle no_features = Write(*device, {});
  EXPECT_TRUE(RunMatch(*device, whole, DescriptorList::Whole(no_features), {}).empty());
}

TEST_P(VisionDeviceContract, MatchOfSubsetsCountsPositionsInTheSpans) {
  const auto device = Create();
  const HostFeatures train = RandomFeatures(300, 1);
  const HostFeatures query = RandomFeatures(200, 2, &train);
  const FeatureSetHandle query_set = Write(*device, query);
  const FeatureSetHandle train_set = Write(*device, train);
  std::vector<std::int32_t> query_indices, train_indices;
  Entries query_entries, train_entries;
  for (int i = 199; i >= 0; i -= 2) query_indices.push_back(i);
  for (int i = 0; i < 300; i += 3) train_indices.push_back((7 * i) % 300);
  for (const int i : query_indices) query_entries.push_back(query.descriptor(i));
  for (const int i : train_indices) train_entries.push_back(train.descriptor(i));
  const MatchOptions options{0.3f, 0.95f, true};
  ExpectSameMatches(RunMatch(*device, DescriptorList::Subset(query_set, query_indices),
                             DescriptorList::Subset(train_set, train_indices), options),
                    NaiveMatch(query_entries, train_entries, options));
}

TEST_P(VisionDeviceContract, MatchOfGatheredRefsSkipsStaleOnes) {
  const auto device = Create();
  const HostFeatures a = RandomFeatures(150, 1);
  const HostFeatures b = RandomFeatures(150, 2, &a);
  const HostFeatures c = RandomFeatures(150, 3, &a);
  const FeatureSetHandle sets[] = {Write(*device, a), Write(*device, b), Write(*device, c)};
  const FeatureSetHandle gone = Write(*device, a);
  device->ReleaseFeatureSet(gone);
  const HostFeatures* hosts[] = {&a, &b, &c};
  std::mt19937 random(4);
  const auto gather = [&](int count, std::vector<DescriptorRef>* refs, Entries* entries) {
    for (int i = 0; i < count; ++i) {
      const int which = static_cast<int>(random() % 3);
      const int feature = static_cast<int>(random() % 150);
      switch (random() % 8) {
        case 0:
          refs->push_back({gone, feature});
          entries->push_back(nullptr);
          break;
        case 1:
          refs->push_back({sets[which], random() % 2 == 0 ? -1 : 150});
          entries->push_back(nullptr);
          break;
        default: refs->push_back({sets[which], feature}); entries->push_back(hosts[which]->descriptor(feature));
      }
    }
  };
  std::vector<DescriptorRef> query_refs, train_refs;
  Entries query_entries, train_entries;
  gather(220, &query_refs, &query_entries);
  gather(700, &train_refs, &train_entries);
  for (const bool mutual : {false, true}) {
    const MatchOptions options{0.2f, 1.0f, mutual};
    ExpectSameMatches(
        RunMatch(*device, DescriptorList::Gather(query_refs), DescriptorList::Gather(train_refs), options),
        NaiveMatch(query_entries, train_entries, options));
  }
  // All stale.
  const std::vector<DescriptorRef> stale(20, DescriptorRef{gone, 0});
  EXPECT_TRUE(RunMatch(*device, DescriptorList::Gather(query_refs), DescriptorList::Gather(stale), {}).empty());
  EXPECT_TRUE(RunMatch(*device, DescriptorList::Gather(stale), DescriptorList::Gather(train_refs), {}).empty());
}

TEST_P(VisionDeviceContract, MatchInsideDisparityWindowAgreesWithDoubleLoop) {
  const auto device = Create();
  const HostFeatures train = RandomFeatures(400, 1);
  const HostFeatures query = RandomFeatures(300, 2, &train);
  const FeatureSetHandle query_set = Write(*device, query);
  const FeatureSetHandle train_set = Write(*device, train);
  const DisparityWindow window{40.0f, 25.0f};
  for (const bool mutual : {false, true}) {
    const MatchOptions options{0.0f, 0.97f, mutual};
    ExpectSameMatches(
        RunMatch(*device, DescriptorList::Whole(query_set), DescriptorList::Whole(train_set), options, &window),
        NaiveMatch(AllOf(query), AllOf(train), options, [&](int q, int t) {
          return std::abs(query.keypoints[q].x_px - train.keypoints[t].x_px) <= window.max_dx_px &&
                 std::abs(query.keypoints[q].y_px - train.keypoints[t].y_px) <= window.max_dy_px;
        }));
  }
}

TEST_P(VisionDeviceContract, MatchThroughEpipolarGateAgreesWithDoubleLoop) {
  const auto device = Create();
  const HostFeatures train = RandomFeatures(400, 1);
  const HostFeatures query = RandomFeatures(300, 2, &train);
  const FeatureSetHandle query_set = Write(*device, query);
  const FeatureSetHandle train_set = Write(*device, train);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
  const auto bearings_of = [&](const HostFeatures& features) {
    std::vector<std::array<float, 3>> bearings;
    for (const Keypoint& k : features.keypoints) {
      const float x = (k.x_px - kWidth / 2) / 150, y = (k.y_px - kHeight / 2) / 150;
      const float norm = std::sqrt(x * x + y * y + 1);
      bearings.push_back({x / norm, y / norm, 1 / norm});
    }
    return bearings;
  };
  const auto tolerances_of = [&](const HostFeatures& features) {
    std::vector<float> tolerances;
    for (int i = 0; i < features.size(); ++i) tolerances.push_back(0.03f + 0.02f * unit(random));
    return tolerances;
  };
  const auto query_bearings = bearings_of(query);
  const auto train_bearings = bearings_of(train);
  const auto query_tolerances = tolerances_of(query);
  const auto train_tolerances = tolerances_of(train);
  // [t]x R for t = (0.8, -0.3, 0.5) and a small rotation about y.
  const double c = std::cos(0.2), s = std::sin(0.2);
  const double t[3] = {0.8, -0.3, 0.5};
  const double rotation[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
  const double skew[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
  EpipolarGate gate{{}, query_bearings, train_bearings, query_tolerances, train_tolerances};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double sum = 0.0;
      for (int k = 0; k < 3; ++k) sum += skew[3 * i + k] * rotation[3 * k + j];
      gate.train_from_query_essential[3 * i + j] = static_cast<float>(sum);
    }
  }
  int num_admissible = 0;
  const auto admissible = [&](int q, int tr) {
    const auto& e = gate.train_from_query_essential;
    const auto& bq = query_bearings[q];
    const auto& bt = train_bearings[tr];
    double line_t[3], line_q[3];
    for (int i = 0; i < 3; ++i) {
      line_t[i] = double{e[3 * i]} * bq[0] + double{e[3 * i + 1]} * bq[1] + double{e[3 * i + 2]} * bq[2];
      line_q[i] = double{e[i]} * bt[0] + double{e[3 + i]} * bt[1] + double{e[6 + i]} * bt[2];
    }
    const double product = bt[0] * line_t[0] + bt[1] * line_t[1] + bt[2] * line_t[2];
    const double norm_t = std::hypot(line_t[0], line_t[1], line_t[2]);
    const double norm_q = std::hypot(line_q[0], line_q[1], line_q[2]);
    const bool is_admissible =
        std::abs(product) / norm_t <= train_tolerances[tr] && std::abs(product) / norm_q <= query_tolerances[q];
    num_admissible += is_admissible ? 1 : 0;
    return is_admissible;
  };
  const MatchOptions options{0.0f, 0.97f, true};
  const DisparityWindow window{100.0f, 80.0f};
  ExpectSameMatches(
      RunMatch(*device, DescriptorList::Whole(query_set), DescriptorList::Whole(train_set), options, nullptr, &gate),
      NaiveMatch(AllOf(query), AllOf(train), options, admissible));
  EXPECT_GT(num_admissible, 1000);
  // Both gates together, on subsets: bearings go by feature, not by position.
  std::vector<std::int32_t> query_indices(150), train_indices(200);
  for (int i = 0; i < 150; ++i) query_indices[i] = 299 - i;
  for (int i = 0; i < 200; ++i) train_indices[i] = (i * 3) % 400;
  Entries query_entries, train_entries;
  for (const int i : query_indices) query_entries.push_back(query.descriptor(i));
  for (const int i : train_indices) train_entries.push_back(train.descriptor(i));
  ExpectSameMatches(RunMatch(*device, DescriptorList::Subset(query_set, query_indices),
                             DescriptorList::Subset(train_set, train_indices), options, &window, &gate),
                    NaiveMatch(query_entries, train_entries, options, [&](int q, int tr) {
                      const Keypoint& a = query.keypoints[query_indices[q]];
                      const Keypoint& b = train.keypoints[train_indices[tr]];
                      return admissible(query_indices[q], train_indices[tr]) &&
                             std::abs(a.x_px - b.x_px) <= window.max_dx_px &&
                             std::abs(a.y_px - b.y_px) <= window.max_dy_px;
                    }));
}

TEST_P(VisionDeviceContract, MatchOfBearingsWithoutAnEpipolarPlaneFindsNothing) {
  const auto device = Create();
  const FeatureSetHandle set = Write(*device, RandomFeatures(50, 1));
  const std::vector<std::array<float, 3>> bearings(50, {0.0f, 0.6f, 0.8f});
  const std::vector<float> tolerance(50, 1.0f);
  const EpipolarGate gate{{}, bearings, bearings, tolerance, tolerance};
  EXPECT_TRUE(
      RunMatch(*device, DescriptorList::Whole(set), DescriptorList::Whole(set), {0.0f, 1.0f, false}, nullptr, &gate)
          .empty());
}

TEST_P(VisionDeviceContract, MatchCountsOnlyAdmissibleDescriptorsAsSecondBest) {
  const auto device = Create();
  HostFeatures train = RandomFeatures(2, 1);
  std::copy_n(train.descriptor(0), kDescriptorBytes, train.descriptors.data() + kDescriptorBytes);
  train.keypoints[0].x_px = 100.0f;
  train.keypoints[1].x_px = 200.0f;  // the same descriptor far away
  train.keypoints[0].y_px = train.keypoints[1].y_px = 50.0f;
  HostFeatures query;
  query.keypoints.push_back(train.keypoints[0]);
  query.descriptors.assign(train.descriptor(0), train.descriptor(1));
  const FeatureSetHandle query_set = Write(*device, query);
  const FeatureSetHandle train_set = Write(*device, train);
  const MatchOptions options{0.5f, 0.8f, false};
  const DisparityWindow window{10.0f, 10.0f};
  const auto query_list = DescriptorList::Whole(query_set);
  const auto train_list = DescriptorList::Whole(train_set);
  const std::vector<Match> free = RunMatch(*device, query_list, train_list, {});
  ASSERT_EQ(free.size(), 1u);
  EXPECT_NEAR(free[0].second_similarity, 1.0f, 1e-6f);
  const std::vector<Match> matches = RunMatch(*device, query_list, train_list, options, &window);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].train, 0);
  EXPECT_EQ(matches[0].second_similarity, 0.0f);
}

TEST_P(VisionDeviceContract, MatchRefusesBadRequests) {
  const auto device = Create();
  const FeatureSetHandle set = Write(*device, RandomFeatures(20, 1));
  const FeatureSetHandle gone = Write(*device, RandomFeatures(20, 1));
  device->ReleaseFeatureSet(gone);
  const DescriptorList whole = DescriptorList::Whole(set);
  std::vector<Match> matches(1000);
  std::int32_t count = -7;
  const auto code = [&](const MatchRequest& request) { return device->EnqueueMatch(Lane::kTracking, request).code(); };
  EXPECT_EQ(code({DescriptorList::Whole(gone), whole, {}, nullptr, nullptr, matches, &count}),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(code({whole, DescriptorList::Whole({}), {}, nullptr, nullptr, matches, &count}),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(code({whole, whole, {}, nullptr, nullptr, {matches.data(), 19}, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({whole, whole, {}, nullptr, nullptr, matches, nullptr}), StatusCode::kInvalidArgument);
  const std::vector<std::int32_t> outside = {3, 20};
  EXPECT_EQ(code({DescriptorList::Subset(set, outside), whole, {}, nullptr, nullptr, matches, &count}),
            StatusCode::kInvalidArgument);
  const std::vector<DescriptorRef> refs(701, DescriptorRef{set, 0});
  EXPECT_EQ(code({whole, DescriptorList::Gather(refs), {}, nullptr, nullptr, matches, &count}),
            StatusCode::kCapacityExceeded);
  const DisparityWindow window{5.0f, 5.0f};
  EXPECT_EQ(code({whole, DescriptorList::Gather({refs.data(), 5}), {}, &window, nullptr, matches, &count}),
            StatusCode::kInvalidArgument);
  const std::vector<std::array<float, 3>> bearings(19);
  const std::vector<float> tolerances(20);
  const EpipolarGate gate{{}, bearings, bearings, tolerances, tolerances};
  EXPECT_EQ(code({whole, whole, {}, nullptr, &gate, matches, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(count, -7);
}

// ---- Guided matching ------------------------------------------------------------------------------------------------

TEST_P(VisionDeviceContract, GuidedMatchAgreesWithDoubleLoop) {
  const auto device = Create();
  const HostFeatures train = RandomFeatures(400, 1);
  const HostFeatures points = RandomFeatures(400, 2, &train);
  const FeatureSetHandle train_set = Write(*device, train);
  const FeatureSetHandle point_set = Write(*device, points);
  const FeatureSetHandle gone = Write(*device, points);
  device->ReleaseFeatureSet(gone);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::vector<GuidedQuery> queries;
  Entries descriptors;
  for (int i = 0; i < 700; ++i) {
    GuidedQuery query;
    const int feature = static_cast<int>(random() % 400);
    const bool is_stale = random() % 10 == 0;
    query.descriptor = {is_stale ? gone : point_set, feature};
    descriptors.push_back(is_stale ? nullptr : points.descriptor(feature));
    query.x_px = -30 + unit(random) * (kWidth + 60);
    query.y_px = -30 + unit(random) * (kHeight + 60);
    query.radius_px = i % 50 == 0 ? 1000.0f : 60.0f * unit(random);
    query.min_scale_px = 1.0f + 3.0f * unit(random);
    query.max_scale_px = query.min_scale_px + 4.0f * unit(random);
    queries.push_back(query);
  }
  std::vector<std::uint8_t> allowed;
  for (int i = 0; i < 400; ++i) allowed.push_back(random() % 4 != 0 ? 1 : 0);
  for (const MatchOptions& options :
       {MatchOptions{}, MatchOptions{0.4f, 0.95f, false}, MatchOptions{0.0f, 1.0f, true}}) {
    ExpectSameMatches(RunGuided(*device, queries, train_set, options),
                      NaiveGuidedMatch(queries, descriptors, train, {}, options));
    ExpectSameMatches(RunGuided(*device, queries, train_set, options, allowed),
                      NaiveGuidedMatch(queries, descriptors, train, allowed, options));
  }
}

TEST_P(VisionDeviceContract, GuidedMatchGivesAKeypointToTheMostSimilarQuery) {
  const auto device = Create();
  HostFeatures train = RandomFeatures(1, 1);
  train.keypoints[0] = {50.0f, 60.0f, 2.0f, 0.0f, 0.1f, 0};
  HostFeatures points = RandomFeatures(3, 2);
  for (int i = 0; i < 3; ++i) {
    std::copy_n(train.descriptor(0), kDescriptorBytes,
                points.descriptors.data() + static_cast<std::size_t>(i) * kDescriptorBytes);
  }
  for (int b = 0; b < 40; ++b) points.descriptors[b] ^= 0x1f;  // the first is less like it; the others are equal
  const FeatureSetHandle train_set = Write(*device, train);
  const FeatureSetHandle point_set = Write(*device, points);
  std::vector<GuidedQuery> queries;
  for (int i = 0; i < 3; ++i) queries.push_back({{point_set, i}, 51.0f, 60.0f, 5.0f, 1.0f, 3.0f});
  const std::vector<Match> matches = RunGuided(*device, queries, train_set, {});
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].query, 1);
  EXPECT_EQ(matches[0].train, 0);
}

TEST_P(VisionDeviceContract, GuidedMatchOfUselessWindowsFindsNothing) {
  const auto device = Create();
  const FeatureSetHandle set = Write(*device, RandomFeatures(100, 1));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const std::vector<GuidedQuery> queries = {
      {{set, 0}, nan, 50.0f, 20.0f, 0.0f, 100.0f},   {{set, 0}, 50.0f, infinity, 20.0f, 0.0f, 100.0f},
      {{set, 0}, 50.0f, 50.0f, nan, 0.0f, 100.0f},   {{set, 0}, 50.0f, 50.0f, -5.0f, 0.0f, 100.0f},
      {{set, 0}, -5e8f, 50.0f, 20.0f, 0.0f, 100.0f}, {{set, 0}, 50.0f, 50.0f, 20.0f, 50.0f, 100.0f},
      {{set, 100}, 50.0f, 50.0f, 99.0f, 0.0f, 9.0f}, {{{}, 0}, 50.0f, 50.0f, 99.0f, 0.0f, 9.0f}};
  EXPECT_TRUE(RunGuided(*device, queries, set, {}).empty());
  EXPECT_TRUE(RunGuided(*device, {}, set, {}).empty());
  EXPECT_TRUE(RunGuided(*device, queries, NewSet(*device), {}).empty());
}

TEST_P(VisionDeviceContract, GuidedMatchRefusesBadRequests) {
  const auto device = Create();
  const FeatureSetHandle set = Write(*device, RandomFeatures(20, 1));
  const std::vector<GuidedQuery> queries(701, GuidedQuery{{set, 0}, 1.0f, 1.0f, 1.0f, 0.0f, 1.0f});
  const std::span<const GuidedQuery> some(queries.data(), 10);
  const std::vector<std::uint8_t> allowed(19, 1);
  std::vector<Match> matches(1000);
  std::int32_t count = -7;
  const auto code = [&](const GuidedMatchRequest& request) {
    return device->EnqueueGuidedMatch(Lane::kBackground, request).code();
  };
  EXPECT_EQ(code({queries, set, {}, {}, matches, &count}), StatusCode::kCapacityExceeded);
  EXPECT_EQ(code({some, {}, {}, {}, matches, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({some, set, allowed, {}, matches, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({some, set, {}, {}, {matches.data(), 9}, &count}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({some, set, {}, {}, matches, nullptr}), StatusCode::kInvalidArgument);
  EXPECT_EQ(count, -7);
}

// ---- Lanes ----------------------------------------------------------------------------------------------------------

TEST_P(VisionDeviceContract, LanesWorkAtTheSameTimeWithoutDisturbingEachOther) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  const HostFeatures train = RandomFeatures(400, 1);
  const HostFeatures query = RandomFeatures(300, 2, &train);
  const FeatureSetHandle query_set = Write(*device, query);
  const FeatureSetHandle train_set = Write(*device, train);
  const MatchOptions options{0.3f, 0.95f, true};
  const std::vector<Match> expected_matches = NaiveMatch(AllOf(query), AllOf(train), options);
  std::thread background([&] {
    for (int i = 0; i < 30; ++i) {
      ExpectSameMatches(RunMatch(*device, DescriptorList::Whole(query_set), DescriptorList::Whole(train_set), options,
                                 nullptr, nullptr, Lane::kBackground),
                        expected_matches);
    }
  });
  for (int i = 0; i < 6; ++i) ExpectSameFeatures(Extract(*device, picture.view()), expected);
  background.join();
}

TEST_P(VisionDeviceContract, WaitForATicketThatWasNeverGivenOutIsRefused) {
  const auto device = Create();
  EXPECT_EQ(device->Wait(Ticket{}, kNoDeadline).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(device->Wait(Ticket{99}, kNoDeadline).code(), StatusCode::kInvalidArgument);
}

// A device that works by itself may be done before the first look.
TEST_P(VisionDeviceContract, WaitWithoutTimeGivesNothingAndAnotherOneTheSameAsEver) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  QueuedExtraction queued(*device, picture.view());
  for (int i = 0; i < 3; ++i) {
    const Status status = device->Wait(queued.ticket, TimePoint{});
    if (status.ok()) break;
    EXPECT_EQ(status.code(), StatusCode::kDeadlineExceeded);
    EXPECT_EQ(queued.count, -7);
  }
  EXPECT_TRUE(device->Wait(queued.ticket, kNoDeadline).ok());
  EXPECT_TRUE(device->Wait(queued.ticket, kNoDeadline).ok()) << "handed over before";
  ASSERT_EQ(queued.count, expected.size());
  HostFeatures features{queued.keypoints, std::vector<std::uint8_t>(expected.descriptors.size())};
  features.keypoints.resize(static_cast<std::size_t>(queued.count));
  EXPECT_TRUE(device->ReadDescriptors(queued.set, features.descriptors).ok());
  ExpectSameFeatures(features, expected);
}

TEST_P(VisionDeviceContract, RequestThatAWaitHasLeftIsDroppedByTheNext) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  const std::int32_t num_free = device->num_free_feature_sets();
  QueuedExtraction left(*device, picture.view());
  if (device->Wait(left.ticket, TimePoint{}).ok()) GTEST_SKIP() << "the device was done before the wait looked";
  device->ReleaseFeatureSet(left.set);
  EXPECT_EQ(device->num_free_feature_sets(), num_free - 1) << "the device may still write to it";
  ExpectSameFeatures(Extract(*device, picture.view()), expected);
  EXPECT_EQ(left.count, -7);
  EXPECT_EQ(left.keypoints[0].scale_px, 0.0f);
  EXPECT_EQ(device->Wait(left.ticket, kNoDeadline).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(device->num_free_feature_sets(), num_free);
}

TEST_P(VisionDeviceContract, AbandonedRequestIsTouchedNoMore) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  QueuedExtraction left(*device, picture.view());
  if (device->Wait(left.ticket, TimePoint{}).ok()) {
    EXPECT_TRUE(device->Abandon(left.ticket) || left.count == expected.size());
    return;
  }
  if (!device->Abandon(left.ticket)) {
    EXPECT_TRUE(device->Wait(left.ticket, kNoDeadline).ok());
    GTEST_SKIP() << "the device was still at it: it has to be waited for";
  }
  EXPECT_EQ(device->Wait(left.ticket, kNoDeadline).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(left.count, -7);
  // Empty as it was: it can be written.
  EXPECT_TRUE(device->WriteFeatures(left.set, expected.keypoints, expected.descriptors).ok());
  ExpectSameFeatures(Extract(*device, picture.view()), expected);
}

TEST_P(VisionDeviceContract, MatchingThatAWaitHasLeftIsDroppedByTheNextRequestOfAnyKind) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures features = RandomFeatures(500, 1);
  const FeatureSetHandle set = Write(*device, features);
  const MatchOptions options{0.3f, 0.95f, true};
  const std::vector<Match> expected = NaiveMatch(AllOf(features), AllOf(features), options);
  const std::vector<GuidedQuery> queries{{{set, 0}, 100.0f, 100.0f, 50.0f, 0.0f, 20.0f}};
  int num_left = 0;
  for (int kind = 0; kind < 3; ++kind) {
    QueuedMatches queued(*device, set, Lane::kTracking, 12);
    if (device->Wait(queued.tickets.back(), TimePoint{}).ok()) continue;
    ++num_left;
    if (kind == 0) {
      ExpectSameMatches(RunMatch(*device, DescriptorList::Whole(set), DescriptorList::Whole(set), options), expected);
    } else if (kind == 1) {
      (void)RunGuided(*device, queries, set, options);
    } else {
      (void)Extract(*device, picture.view());
    }
    EXPECT_EQ(device->Wait(queued.tickets.back(), kNoDeadline).code(), StatusCode::kFailedPrecondition) << kind;
    EXPECT_TRUE(queued.IsLastUntouched()) << kind;
    // Those before it that no wait has left are served all the same.
    for (int i = 0; i < 11; ++i) {
      EXPECT_TRUE(device->Wait(queued.tickets[i], kNoDeadline).ok());
      EXPECT_EQ(queued.counts[i], static_cast<std::int32_t>(expected.size()));
    }
  }
  if (num_left == 0) GTEST_SKIP() << "the device was done before the wait looked";
}

TEST_P(VisionDeviceContract, EachDroppedRequestIsKnownAsDropped) {
  const auto device = Create();
  const FeatureSetHandle set = Write(*device, RandomFeatures(500, 1));
  QueuedMatches first(*device, set, Lane::kTracking, 12);
  const bool is_first_left = !device->Wait(first.tickets.back(), TimePoint{}).ok();
  QueuedMatches second(*device, set, Lane::kTracking, 12);
  const bool is_second_left = !device->Wait(second.tickets.back(), TimePoint{}).ok();
  if (!is_first_left || !is_second_left) GTEST_SKIP() << "the device was done before the wait looked";
  const QueuedMatches third(*device, set, Lane::kTracking, 1);
  EXPECT_EQ(device->Wait(first.tickets.back(), kNoDeadline).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(device->Wait(second.tickets.back(), kNoDeadline).code(), StatusCode::kFailedPrecondition);
  EXPECT_TRUE(device->Wait(third.tickets.back(), kNoDeadline).ok());
  EXPECT_EQ(device->Wait(first.tickets.back(), kNoDeadline).code(), StatusCode::kFailedPrecondition);
  EXPECT_TRUE(first.IsLastUntouched());
  EXPECT_TRUE(second.IsLastUntouched());
}

TEST_P(VisionDeviceContract, TicketsOfLongAgoAreKnownNoMore) {
  const auto device = Create();
  const FeatureSetHandle set = Write(*device, RandomFeatures(20, 1));
  const QueuedMatches queued(*device, set, Lane::kTracking, kKnownTickets);
  EXPECT_TRUE(device->Wait(queued.tickets.back(), kNoDeadline).ok());
  EXPECT_TRUE(device->Wait(queued.tickets.front(), kNoDeadline).ok());
  const QueuedMatches another(*device, set, Lane::kTracking, 1);
  EXPECT_EQ(device->Wait(queued.tickets.front(), kNoDeadline).code(), StatusCode::kInvalidArgument);
  EXPECT_TRUE(device->Wait(queued.tickets[1], kNoDeadline).ok());
  EXPECT_TRUE(device->Wait(another.tickets.back(), kNoDeadline).ok());
}

// What matching reads of the caller's it has read when it is queued, or reads no more: it can be given up at any time.
TEST_P(VisionDeviceContract, AbandonedMatchingIsTouchedNoMore) {
  const auto device = Create();
  const HostFeatures features = RandomFeatures(500, 1);
  const FeatureSetHandle set = Write(*device, features);
  const MatchOptions options{0.3f, 0.95f, true};
  QueuedMatches queued(*device, set, Lane::kTracking, 12);
  if (device->Wait(queued.tickets.back(), TimePoint{}).ok()) {
    EXPECT_TRUE(device->Abandon(queued.tickets.back()));
    GTEST_SKIP() << "the device was done before the wait looked";
  }
  ASSERT_TRUE(device->Abandon(queued.tickets.back()));
  EXPECT_TRUE(device->Abandon(queued.tickets.back())) << "dropped before";
  EXPECT_EQ(device->Wait(queued.tickets.back(), kNoDeadline).code(), StatusCode::kFailedPrecondition);
  ExpectSameMatches(RunMatch(*device, DescriptorList::Whole(set), DescriptorList::Whole(set), options),
                    NaiveMatch(AllOf(features), AllOf(features), options));
  EXPECT_TRUE(queued.IsLastUntouched());
}

TEST_P(VisionDeviceContract, AbandonIsTrueWhenTheDeviceIsDone) {
  const auto device = Create();
  const Picture picture = Texture(4);
  const HostFeatures expected = Extract(*device, picture.view());
  QueuedExtraction queued(*device, picture.view());
  const bool is_left = !device->Wait(queued.ticket, TimePoint{}).ok();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // a device that works by itself needs a few
  EXPECT_TRUE(device->Abandon(queued.ticket));
  EXPECT_EQ(queued.count, is_left ? -7 : expected.size());
  if (is_left) {
    EXPECT_EQ(device->Wait(queued.ticket, kNoDeadline).code(), StatusCode::kFailedPrecondition);
    EXPECT_TRUE(device->WriteFeatures(queued.set, expected.keypoints, expected.descriptors).ok()) << "empty as it was";
  }
  ExpectSameFeatures(Extract(*device, picture.view()), expected);
}

TEST_P(VisionDeviceContract, CreateRefusesOptionsOutOfRange) {
  const auto code = [&](const VisionPlan& plan, const ExtractOptions& options) {
    return GetParam().create(plan, options).code();
  };
  VisionPlan plan = SmallPlan();
  plan.max_width_px = 0;
  EXPECT_EQ(code(plan, SmallOptions()), StatusCode::kInvalidArgument);
  plan = SmallPlan();
  plan.max_feature_sets = 0;
  EXPECT_EQ(code(plan, SmallOptions()), StatusCode::kInvalidArgument);
  ExtractOptions options = SmallOptions();
  options.num_features = 501;
  EXPECT_EQ(code(SmallPlan(), options), StatusCode::kInvalidArgument);
  options = SmallOptions();
  options.contrast_threshold = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(code(SmallPlan(), options), StatusCode::kInvalidArgument);
  options = SmallOptions();
  options.edge_threshold = 0.5f;
  EXPECT_EQ(code(SmallPlan(), options), StatusCode::kInvalidArgument);
  options = SmallOptions();
  options.mask_dilation_px = -1;
  EXPECT_EQ(code(SmallPlan(), options), StatusCode::kInvalidArgument);
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(VisionDeviceContract);

}  // namespace haustra::testing
