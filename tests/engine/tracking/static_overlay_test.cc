#include "engine/tracking/static_overlay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/tracking/overlay_watch.h"

namespace haustra::test {
namespace {

constexpr int kWidth = 720;
constexpr int kHeight = 540;
constexpr int kMaxFeatures = 2000;
using Motion = StaticOverlay::Motion;

// A scene that flows out of the middle of the picture: `share` is the motion over the distance from there. With noise
// of a third of a pixel. Text stands in `text_columns` columns of the left upper corner.
struct Scene {
  double share = 0.1;
  int num_text = 60;
  int num_scene = 400;
};

Eigen::Vector2f TextPlace(int i) {
  return {20.0f + 6.0f * static_cast<float>(i % 12), 20.0f + 7.0f * static_cast<float>(i / 12)};
}

std::vector<Motion> Show(const Scene& scene, std::uint64_t seed) {
  Rng rng(seed, 1);
  const auto noise = [&] { return static_cast<float>(rng.Uniform(-0.3, 0.3)); };
  std::vector<Motion> motions;
  for (int i = 0; i < scene.num_text; ++i) {
    const Eigen::Vector2f at = TextPlace(i);
    motions.push_back({at, at + Eigen::Vector2f(noise(), noise()), 1.0f});
  }
  for (int i = 0; i < scene.num_scene; ++i) {
    const Eigen::Vector2f at(static_cast<float>(rng.Uniform(0.0, kWidth)),
                             static_cast<float>(rng.Uniform(0.0, kHeight)));
    const Eigen::Vector2f from_middle = at - Eigen::Vector2f(0.5f * kWidth, 0.5f * kHeight);
    motions.push_back(
        {at, at + static_cast<float>(scene.share) * from_middle + Eigen::Vector2f(noise(), noise()), 1.0f});
  }
  return motions;
}

int CountStill(const std::vector<std::uint8_t>& flags, std::size_t begin, std::size_t end) {
  return static_cast<int>(std::count(flags.begin() + static_cast<std::ptrdiff_t>(begin),
                                     flags.begin() + static_cast<std::ptrdiff_t>(end), 1));
}

int ShowFor(StaticOverlay* overlay, const Scene& scene, double seconds, double step) {
  int num = 0;
  for (double t = 0.0; t < seconds; t += step, ++num) {
    const std::vector<Motion> motions = Show(scene, 100 + static_cast<std::uint64_t>(num));
    std::vector<std::uint8_t> flags(motions.size());
    overlay->Observe(motions, step, flags);
  }
  return num;
}

int NumTextFound(const StaticOverlay& overlay) {
  int num = 0;
  for (int i = 0; i < 60; ++i) num += overlay.IsStatic(TextPlace(i).x(), TextPlace(i).y()) ? 1 : 0;
  return num;
}

TEST(StaticOverlay, NothingSeenGivesNothingStatic) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  EXPECT_FALSE(overlay.IsStatic(10.0f, 10.0f));
  overlay.Observe({}, 0.1, {});
  EXPECT_EQ(overlay.num_static(), 0);
}

TEST(StaticOverlay, TextBeforeAMovingSceneIsToldAtOnce) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  const Scene scene;
  const std::vector<Motion> motions = Show(scene, 1);
  std::vector<std::uint8_t> flags(motions.size());
  overlay.Observe(motions, 0.04, flags);
  EXPECT_EQ(CountStill(flags, 0, 60), 60);
  EXPECT_LE(CountStill(flags, 60, motions.size()), 4);  // the very middle of the flow
  EXPECT_EQ(overlay.num_static(), 0);                   // once is no evidence
}

TEST(StaticOverlay, EvidenceRisesWithTimeNotWithFrames) {
  for (const double rate_hz : {10.0, 25.0, 60.0}) {
    StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
    ShowFor(&overlay, Scene{}, 0.1, 1.0 / rate_hz);
    EXPECT_EQ(NumTextFound(overlay), 0) << rate_hz;
    ShowFor(&overlay, Scene{}, 0.3, 1.0 / rate_hz);
    EXPECT_GE(NumTextFound(overlay), 57) << rate_hz;
  }
}

TEST(StaticOverlay, WhatIsUncoveredAgainIsForgotten) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  ShowFor(&overlay, Scene{}, 1.0, 0.1);
  ASSERT_GE(NumTextFound(overlay), 57);
  Scene uncovered;
  uncovered.num_text = 0;
  uncovered.num_scene = 1900;  // everything is passed by something
  ShowFor(&overlay, uncovered, 8.0, 0.1);
  EXPECT_LE(NumTextFound(overlay), 6);
}

TEST(StaticOverlay, ARestingSceneGivesNoEvidence) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  Scene scene;
  scene.share = 0.001;
  ShowFor(&overlay, scene, 2.0, 0.1);
  EXPECT_EQ(overlay.num_static(), 0);
}

// False matches go anywhere, each by itself.
TEST(StaticOverlay, FalseMatchesInARestingPictureAreNoMotion) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  for (std::uint64_t frame = 0; frame < 20; ++frame) {
    Scene scene;
    scene.share = 0.001;
    std::vector<Motion> motions = Show(scene, frame);
    Rng rng(frame, 7);
    for (std::size_t i = 0; i < motions.size(); i += 4) {
      motions[i].to_px = {static_cast<float>(rng.Uniform(0.0, kWidth)), static_cast<float>(rng.Uniform(0.0, kHeight))};
    }
    std::vector<std::uint8_t> flags(motions.size());
    overlay.Observe(motions, 0.1, flags);
  }
  EXPECT_EQ(overlay.num_static(), 0);
}

// The far end of a tube hardly moves, whatever the wall beside the scope does.
TEST(StaticOverlay, TheFarEndOfTheLumenIsScene) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  for (std::uint64_t frame = 0; frame < 10; ++frame) {
    std::vector<Motion> motions = Show({0.1, 0, 300}, frame);
    Rng rng(frame, 3);
    for (int i = 0; i < 80; ++i) {
      const Eigen::Vector2f middle(0.5f * kWidth, 0.5f * kHeight);
      const Eigen::Vector2f off(static_cast<float>(rng.Uniform(-70.0, 70.0)),
                                static_cast<float>(rng.Uniform(-70.0, 70.0)));
      motions.push_back({middle + off, middle + 1.03f * off, 1.0f});
    }
    std::vector<std::uint8_t> flags(motions.size());
    overlay.Observe(motions, 0.1, flags);
    EXPECT_LE(CountStill(flags, 300, motions.size()), 8) << frame;
  }
}

// A panel beside the window has more features than the scene.
TEST(StaticOverlay, MostOfThePictureMayBeStatic) {
  StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  std::vector<Motion> motions;
  Rng rng(3, 1);
  for (int i = 0; i < 600; ++i) {
    const Eigen::Vector2f at(static_cast<float>(rng.Uniform(0.0, 240.0)),
                             static_cast<float>(rng.Uniform(0.0, kHeight)));
    // One in six is badly found.
    motions.push_back({at, at + Eigen::Vector2f(i % 6 == 0 ? 1.7f : 0.0f, 0.0f), 1.0f});
  }
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2f at(static_cast<float>(rng.Uniform(260.0, kWidth)),
                             static_cast<float>(rng.Uniform(0.0, kHeight)));
    motions.push_back({at, at + Eigen::Vector2f(12.0f, 3.0f), 1.0f});
  }
  std::vector<std::uint8_t> flags(motions.size());
  overlay.Observe(motions, 0.1, flags);
  EXPECT_GE(CountStill(flags, 0, 600), 490);
  EXPECT_EQ(CountStill(flags, 600, 900), 0);
}

TEST(StaticOverlay, TwinsHaveThePlaceTheScaleAndTheAngle) {
  const StaticOverlay overlay(kWidth, kHeight, kMaxFeatures);
  const std::vector<Keypoint> before = {{100.0f, 50.0f, 1.5f, 1.0f, 0.1f, -1},
                                        {300.0f, 90.0f, 1.5f, 6.2f, 0.1f, -1},
                                        {200.0f, 40.0f, 2.4f, 2.0f, 0.1f, 0},
                                        {220.0f, 80.0f, 2.4f, 2.0f, 0.1f, 0}};
  const std::vector<Keypoint> now = {{100.4f, 49.8f, 1.55f, 1.05f, 0.1f, -1},
                                     {300.0f, 90.0f, 1.5f, 0.02f, 0.1f, -1},
                                     {200.0f, 40.0f, 2.4f, 3.0f, 0.1f, 0},
                                     {220.0f, 83.0f, 2.4f, 2.0f, 0.1f, 0}};
  std::vector<std::int32_t> twins(now.size());
  overlay.FindTwins(before, now, 0.35, 0.3, twins);
  EXPECT_EQ(twins, (std::vector<std::int32_t>{0, 1, -1, -1}));
}

// Matches of a founding: text founds nothing, and afterwards every frame is without it.
TEST(OverlayWatch, SiftsMatchesAndBlanksFeatures) {
  const InitialisationConfig noise;
  OverlayWatch watch(noise, true, kWidth, kHeight, kMaxFeatures);
  FrameFeatures a(kMaxFeatures), b(kMaxFeatures);
  std::vector<Match> matches;
  for (int step = 0; step < 8; ++step) {
    const std::vector<Motion> motions = Show(Scene{}, static_cast<std::uint64_t>(step));
    matches.clear();
    a.num = b.num = static_cast<std::int32_t>(motions.size());
    for (int i = 0; i < a.num; ++i) {
      const Motion& motion = motions[static_cast<std::size_t>(i)];
      a.keypoints[i] = {motion.from_px.x(), motion.from_px.y(), 2.0f, 0.0f, 0.1f, 0};
      b.keypoints[i] = {motion.to_px.x(), motion.to_px.y(), 2.0f, 0.0f, 0.1f, 0};
      b.bearings[i] = {0.0f, 0.0f, 1.0f};
      matches.push_back({i, i, 0.99f, 0.5f});
    }
    const int kept = watch.Sift(a, b, matches, TimePoint(std::chrono::milliseconds(200 * step)),
                                TimePoint(std::chrono::milliseconds(200 * step + 200)));
    EXPECT_NEAR(kept, 400, 5);
    EXPECT_GE(matches[0].query, 60);
  }
  watch.Blank(&b);
  EXPECT_GE(std::count(b.bearings.begin(), b.bearings.begin() + 60, Bearing{}), 57);
  EXPECT_LE(std::count(b.bearings.begin() + 60, b.bearings.begin() + b.num, Bearing{}), 40);
  std::vector<std::uint8_t> allowed(kMaxFeatures);
  watch.Allow(b, allowed);
  EXPECT_LE(std::count(allowed.begin(), allowed.begin() + 60, 1), 3);
}

TEST(OverlayWatch, SwitchedOffLeavesEverything) {
  const InitialisationConfig noise;
  OverlayWatch watch(noise, false, kWidth, kHeight, kMaxFeatures);
  FrameFeatures a(1), b(1);
  std::vector<Match> matches(1, {0, 0, 0.99f, 0.5f});
  EXPECT_EQ(watch.Sift(a, b, matches, TimePoint{}, TimePoint{}), 1);
  EXPECT_FALSE(watch.is_due(TimePoint{}));
}

TEST(OverlayWatch, IsDueAgainWhenTheClockWasSetBack) {
  const InitialisationConfig noise;
  OverlayWatch watch(noise, true, kWidth, kHeight, kMaxFeatures);
  FrameFeatures features(1);
  features.num = 1;
  const TimePoint time(std::chrono::hours(2));
  watch.KeepFrame(features, time);
  EXPECT_FALSE(watch.is_due(time));
  EXPECT_TRUE(watch.is_due(time - std::chrono::hours(1)));
}

// A map is tracked: its points say how the scene moves, twins of features what stands still.
TEST(OverlayWatch, TwinsBesideTrackedPointsAreFound) {
  const InitialisationConfig noise;
  OverlayWatch watch(noise, true, kWidth, kHeight, kMaxFeatures);
  std::vector<OverlayWatch::Tracked> tracked;
  FrameFeatures before(kMaxFeatures), now(kMaxFeatures);
  for (int step = 0; step < 6; ++step) {
    const std::vector<Motion> motions = Show(Scene{}, static_cast<std::uint64_t>(step));
    std::vector<std::pair<Keypoint, Eigen::Vector2f>> features;
    before.num = 0;
    for (std::size_t i = 0; i < motions.size(); ++i) {
      const Motion& motion = motions[i];
      features.push_back({{motion.to_px.x(), motion.to_px.y(), 2.0f, 1.0f, 0.1f, 0}, motion.from_px});
      if (i < 60) before.keypoints[before.num++] = {motion.from_px.x(), motion.from_px.y(), 2.0f, 1.0f, 0.1f, 0};
    }
    std::sort(features.begin(), features.end(),
              [](const auto& x, const auto& y) { return x.first.y_px < y.first.y_px; });
    tracked.clear();
    now.num = 0;
    for (const auto& [keypoint, from] : features) {
      const bool is_text = keypoint.x_px < 90.0f && keypoint.y_px < 60.0f;
      if (!is_text) tracked.push_back({now.num, from});
      now.keypoints[now.num++] = keypoint;
    }
    const TimePoint time(std::chrono::milliseconds(400 * step));
    EXPECT_TRUE(watch.is_due(time));
    watch.KeepFrame(before, time);
    EXPECT_FALSE(watch.is_due(time + std::chrono::milliseconds(100)));
    watch.Compare(now, tracked, time + std::chrono::milliseconds(200));
  }
  EXPECT_GE(NumTextFound(watch.overlay()), 57);
}

// Detected features of a map say how the scene moves; followed ones stand behind them, densely, all of one scale. Those
// that happen to lie where another one lay before are nothing that stands still.
TEST(OverlayWatch, FollowedFeaturesAreNoTwinsByChance) {
  const InitialisationConfig noise;
  const int num_tracked = 400, num_followed = 1200;
  const float shrink = 0.5f;  // of a small picture
  for (const bool is_sorted : {true, false}) {
    SCOPED_TRACE(is_sorted);
    OverlayWatch watch(noise, true, kWidth / 2, kHeight / 2, kMaxFeatures);
    FrameFeatures before(kMaxFeatures), now(kMaxFeatures);
    for (int step = 0; step < 10; ++step) {
      Scene scene;
      scene.num_text = 0;
      scene.num_scene = num_tracked + num_followed;
      std::vector<Motion> motions = Show(scene, static_cast<std::uint64_t>(step));
      const auto by_y = [](const Motion& a, const Motion& b) { return a.to_px.y() < b.to_px.y(); };
      if (is_sorted) std::sort(motions.begin() + num_tracked, motions.end(), by_y);
      std::vector<OverlayWatch::Tracked> tracked;
      for (int i = 0; i < scene.num_scene; ++i) {
        const Eigen::Vector2f from = shrink * motions[static_cast<std::size_t>(i)].from_px;
        const Eigen::Vector2f to = shrink * motions[static_cast<std::size_t>(i)].to_px;
        const int octave = i < num_tracked ? 1 : 2;
        before.keypoints[i] = {from.x(), from.y(), 2.0f, 1.0f, 0.1f, octave};
        now.keypoints[i] = {to.x(), to.y(), 2.0f, 1.0f, 0.1f, octave};
        if (i < num_tracked) tracked.push_back({i, from});
      }
      before.num = now.num = scene.num_scene;
      before.num_followed = now.num_followed = num_followed;
      const TimePoint time(std::chrono::milliseconds(400 * step));
      watch.KeepFrame(before, time);
      watch.Compare(now, tracked, time + std::chrono::milliseconds(200));
    }
    EXPECT_EQ(watch.overlay().num_static(), 0);
  }
}

}  // namespace
}  // namespace haustra::test
