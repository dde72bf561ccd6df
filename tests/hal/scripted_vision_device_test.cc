#include "hal/fakes/scripted_vision_device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "hal/fakes/frame_tag.h"
#include "tests/hal/fatal_trap.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using Operation = ScriptedVisionDevice::Operation;
using FailurePoint = ScriptedVisionDevice::FailurePoint;

constexpr int kWidth = 64, kHeight = 48, kMaxFeatures = 10;

VisionPlan SmallPlan() {
  VisionPlan plan;
  plan.max_width_px = kWidth;
  plan.max_height_px = kHeight;
  plan.max_features = kMaxFeatures;
  plan.max_feature_sets = 3;
  plan.max_match_list = 20;
  return plan;
}

ScriptedFeature Feature(std::uint32_t landmark, float x, float y, float response = 1.0f) {
  ScriptedFeature feature;
  feature.keypoint = {x, y, 2.0f, 0.0f, response, 0};
  feature.appearance.landmark_id = landmark;
  return feature;
}

TimePoint At(int ms) { return TimePoint(milliseconds(ms)); }

// A marked picture, the buffers of an extraction, and the request made of both.
struct Extraction {
  explicit Extraction(std::uint32_t frame_index) : pixels(kWidth * kHeight, 128), keypoints(kMaxFeatures) {
    WriteFrameTag(frame_index, pixels);
  }
  ExtractRequest Request(FeatureSetHandle set) {
    return {{pixels.data(), kWidth, kHeight, kWidth, PixelFormat::kGrey8}, set, keypoints, &num_keypoints};
  }

  std::vector<std::uint8_t> pixels;
  std::vector<Keypoint> keypoints;
  std::int32_t num_keypoints = -1;
};

FeatureSetHandle Extract(ScriptedVisionDevice& device, std::uint32_t frame_index) {
  const FeatureSetHandle set = *device.CreateFeatureSet();
  Extraction extraction(frame_index);
  EXPECT_TRUE(ExtractAndWait(device, Lane::kTracking, extraction.Request(set)).ok());
  return set;
}

TEST(ScriptedVisionDevice, ExtractionGivesTheScriptedFeaturesInOrder) {
  ScriptedVisionDevice device(SmallPlan(), {});
  device.SetFrame(3, {Feature(1, 30, 20), Feature(2, 10, 20), Feature(3, 50, 5)});
  const FeatureSetHandle set = *device.CreateFeatureSet();
  Extraction extraction(3);
  ASSERT_TRUE(ExtractAndWait(device, Lane::kTracking, extraction.Request(set)).ok());
  ASSERT_EQ(extraction.num_keypoints, 3);
  EXPECT_EQ(extraction.keypoints[0].x_px, 50.0f);
  EXPECT_EQ(extraction.keypoints[1].x_px, 10.0f);
  EXPECT_EQ(extraction.keypoints[2].x_px, 30.0f);
  std::vector<std::uint8_t> bytes(3 * kDescriptorBytes);
  ASSERT_TRUE(device.ReadDescriptors(set, bytes).ok());
  const auto expected = EncodeAppearance({2, 0});
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), bytes.begin() + kDescriptorBytes));
}

TEST(ScriptedVisionDevice, FrameWithoutScriptHasNoFeatures) {
  ScriptedVisionDevice device(SmallPlan(), {});
  Extraction extraction(99);
  ASSERT_TRUE(ExtractAndWait(device, Lane::kTracking, extraction.Request(*device.CreateFeatureSet())).ok());
  EXPECT_EQ(extraction.num_keypoints, 0);
}

TEST(ScriptedVisionDevice, StrongestFeaturesStayWhenThereAreTooMany) {
  ScriptedVisionDevice device(SmallPlan(), {});
  std::vector<ScriptedFeature> features;
  for (int i = 0; i < 12; ++i) features.push_back(Feature(i, static_cast<float>(i), 1, i == 0 || i == 5 ? 0.1f : 1.0f));
  device.SetFrame(0, features);
  Extraction extraction(0);
  ASSERT_TRUE(ExtractAndWait(device, Lane::kTracking, extraction.Request(*device.CreateFeatureSet())).ok());
  ASSERT_EQ(extraction.num_keypoints, kMaxFeatures);
  for (const Keypoint& keypoint : extraction.keypoints) {
    EXPECT_NE(keypoint.x_px, 0.0f);
    EXPECT_NE(keypoint.x_px, 5.0f);
  }
}

TEST(ScriptedVisionDevice, FeaturesThatAreTooFineAreLeftOutWhenAsked) {
  ScriptedVisionDevice device(SmallPlan(), {});
  ScriptedFeature fine = Feature(1, 10, 20);
  fine.keypoint.scale_px = 1.0f;
  device.SetFrame(3, {fine, Feature(2, 30, 20)});
  Extraction extraction(3);
  ExtractRequest request = extraction.Request(*device.CreateFeatureSet());
  request.min_scale_px = 1.5f;
  ASSERT_TRUE(ExtractAndWait(device, Lane::kTracking, request).ok());
  ASSERT_EQ(extraction.num_keypoints, 1);
  EXPECT_EQ(extraction.keypoints[0].x_px, 30.0f);
}

TEST(ScriptedVisionDevice, FeaturesUnderTheStaticMaskAreNeverSeen) {
  ScriptedVisionDevice device(SmallPlan(), {});
  std::vector<std::uint8_t> mask(kWidth * kHeight, 255);
  mask[20 * kWidth + 30] = 0;
  ASSERT_TRUE(device.SetStaticMask({mask.data(), kWidth, kHeight, kWidth, PixelFormat::kGrey8}).ok());
  device.SetFrame(0, {Feature(1, 30.3f, 19.8f), Feature(2, 31, 20)});
  Extraction extraction(0);
  ASSERT_TRUE(ExtractAndWait(device, Lane::kTracking, extraction.Request(*device.CreateFeatureSet())).ok());
  ASSERT_EQ(extraction.num_keypoints, 1);
  EXPECT_EQ(extraction.keypoints[0].x_px, 31.0f);
}

TEST(ScriptedVisionDevice, MaskLargerThanThePlanIsRefused) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const std::vector<std::uint8_t> mask((kWidth + 1) * kHeight, 255);
  EXPECT_EQ(device.SetStaticMask({mask.data(), kWidth + 1, kHeight, kWidth + 1, PixelFormat::kGrey8}).code(),
            StatusCode::kInvalidArgument);
}

TEST(ScriptedVisionDevice, FeatureSetsRunOutAndComeBack) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const FeatureSetHandle first = *device.CreateFeatureSet();
  (void)device.CreateFeatureSet();
  (void)device.CreateFeatureSet();
  EXPECT_EQ(device.num_free_feature_sets(), 0);
  EXPECT_EQ(device.CreateFeatureSet().code(), StatusCode::kCapacityExceeded);
  device.ReleaseFeatureSet(first);
  device.ReleaseFeatureSet(first);
  EXPECT_EQ(device.num_free_feature_sets(), 1);
  EXPECT_TRUE(device.CreateFeatureSet().ok());
}

TEST(ScriptedVisionDevice, SetIsWrittenOnce) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const FeatureSetHandle set = Extract(device, 0);
  Extraction again(0);
  EXPECT_EQ(device.EnqueueExtract(Lane::kTracking, again.Request(set)).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(device.WriteFeatures(set, {}, {}).code(), StatusCode::kInvalidArgument);
}

TEST(ScriptedVisionDevice, StaleHandlesAreRefused) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const FeatureSetHandle stale = *device.CreateFeatureSet();
  device.ReleaseFeatureSet(stale);
  const FeatureSetHandle alive = Extract(device, 0);
  Extraction extraction(0);
  EXPECT_EQ(device.EnqueueExtract(Lane::kTracking, extraction.Request(stale)).code(), StatusCode::kInvalidArgument);
  std::vector<Match> matches(kMaxFeatures);
  std::int32_t num_matches = -1;
  MatchRequest match;
  match.query = DescriptorList::Whole(alive);
  match.train = DescriptorList::Whole(stale);
  match.matches = matches;
  match.num_matches = &num_matches;
  EXPECT_EQ(device.EnqueueMatch(Lane::kTracking, match).code(), StatusCode::kInvalidArgument);
  GuidedMatchRequest guided;
  guided.train = stale;
  guided.num_matches = &num_matches;
  EXPECT_EQ(device.EnqueueGuidedMatch(Lane::kTracking, guided).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(device.ReadDescriptors(stale, {}).code(), StatusCode::kInvalidArgument);
}

// Landmarks 1 to 4 in frame 0, 3 to 6 in frame 1, moved by (5, 0).
void ScriptTwoFrames(ScriptedVisionDevice& device) {
  device.SetFrame(0, {Feature(1, 10, 1), Feature(2, 10, 2), Feature(3, 10, 3), Feature(4, 10, 4)});
  device.SetFrame(1, {Feature(3, 15, 3), Feature(4, 15, 4), Feature(5, 15, 5), Feature(6, 15, 6)});
}

struct Matching {
  Matching() : matches(20) {}
  MatchRequest Request(const DescriptorList& query, const DescriptorList& train) {
    MatchRequest request;
    request.query = query;
    request.train = train;
    request.options = {0.7f, 0.9f, true};
    request.matches = matches;
    request.num_matches = &num_matches;
    return request;
  }
  std::vector<Match> matches;
  std::int32_t num_matches = -1;
};

TEST(ScriptedVisionDevice, WholeSetsAreMatchedByLandmark) {
  ScriptedVisionDevice device(SmallPlan(), {});
  ScriptTwoFrames(device);
  const FeatureSetHandle a = Extract(device, 0), b = Extract(device, 1);
  Matching matching;
  const MatchRequest request = matching.Request(DescriptorList::Whole(a), DescriptorList::Whole(b));
  ASSERT_TRUE(MatchAndWait(device, Lane::kBackground, request).ok());
  ASSERT_EQ(matching.num_matches, 2);
  EXPECT_EQ(matching.matches[0].query, 2);
  EXPECT_EQ(matching.matches[0].train, 0);
  EXPECT_EQ(matching.matches[1].query, 3);
  EXPECT_EQ(matching.matches[1].train, 1);
}

TEST(ScriptedVisionDevice, PositionsCountWithinSubsetsAndGathers) {
  ScriptedVisionDevice device(SmallPlan(), {});
  ScriptTwoFrames(device);
  const FeatureSetHandle a = Extract(device, 0), b = Extract(device, 1);
  const std::vector<std::int32_t> indices{3, 0};
  const std::vector<DescriptorRef> refs{{b, 3}, {FeatureSetHandle{2, 77}, 0}, {b, 1}};
  Matching matching;
  const MatchRequest request = matching.Request(DescriptorList::Subset(a, indices), DescriptorList::Gather(refs));
  ASSERT_TRUE(MatchAndWait(device, Lane::kTracking, request).ok());
  ASSERT_EQ(matching.num_matches, 1);
  EXPECT_EQ(matching.matches[0].query, 0);
  EXPECT_EQ(matching.matches[0].train, 2);
}

TEST(ScriptedVisionDevice, EmptySubsetAndEmptyGatherMatchNothing) {
  ScriptedVisionDevice device(SmallPlan(), {});
  ScriptTwoFrames(device);
  const FeatureSetHandle a = Extract(device, 0);
  Matching matching;
  ASSERT_TRUE(
      MatchAndWait(device, Lane::kTracking, matching.Request(DescriptorList::Subset(a, {}), DescriptorList::Whole(a)))
          .ok());
  EXPECT_EQ(matching.num_matches, 0);
  ASSERT_TRUE(
      MatchAndWait(device, Lane::kTracking, matching.Request(DescriptorList::Whole(a), DescriptorList::Gather({})))
          .ok());
  EXPECT_EQ(matching.num_matches, 0);
}

TEST(ScriptedVisionDevice, TooLongListIsRefused) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const std::vector<DescriptorRef> refs(21);
  Matching matching;
  EXPECT_EQ(
      device.EnqueueMatch(Lane::kTracking, matching.Request(DescriptorList::Gather(refs), DescriptorList::Gather({})))
          .code(),
      StatusCode::kCapacityExceeded);
}

TEST(ScriptedVisionDevice, DisparityWindowNeedsKeypointsOfSets) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const FeatureSetHandle a = Extract(device, 0);
  const std::vector<DescriptorRef> refs{{a, 0}};
  const DisparityWindow window{1, 1};
  Matching matching;
  MatchRequest request = matching.Request(DescriptorList::Whole(a), DescriptorList::Gather(refs));
  request.disparity = &window;
  EXPECT_EQ(device.EnqueueMatch(Lane::kTracking, request).code(), StatusCode::kInvalidArgument);
}

TEST(ScriptedVisionDevice, GuidedMatchingFindsTheProjectedLandmark) {
  ScriptedVisionDevice device(SmallPlan(), {});
  ScriptTwoFrames(device);
  const FeatureSetHandle a = Extract(device, 0), b = Extract(device, 1);
  const std::vector<GuidedQuery> queries{{{a, 3}, 14, 4, 2, 0, 10}, {{a, 2}, 40, 40, 2, 0, 10}};
  std::vector<Match> matches(2);
  std::int32_t num_matches = -1;
  GuidedMatchRequest request;
  request.queries = queries;
  request.train = b;
  request.options = {0.7f, 0.9f, false};
  request.matches = matches;
  request.num_matches = &num_matches;
  ASSERT_TRUE(GuidedMatchAndWait(device, Lane::kTracking, request).ok());
  ASSERT_EQ(num_matches, 1);
  EXPECT_EQ(matches[0].query, 0);
  EXPECT_EQ(matches[0].train, 1);
}

TEST(ScriptedVisionDevice, ResultsAreWrittenByWaitAndNotBefore) {
  ScriptedVisionDevice device(SmallPlan(), {});
  device.SetFrame(0, {Feature(1, 10, 1)});
  Extraction extraction(0);
  const Result<Ticket> ticket = device.EnqueueExtract(Lane::kTracking, extraction.Request(*device.CreateFeatureSet()));
  ASSERT_TRUE(ticket.ok());
  EXPECT_EQ(extraction.num_keypoints, -1);
  ASSERT_TRUE(device.Wait(*ticket, kNoDeadline).ok());
  EXPECT_EQ(extraction.num_keypoints, 1);
  EXPECT_TRUE(device.Wait(*ticket, kNoDeadline).ok());
}

TEST(ScriptedVisionDevice, UnknownTicketIsRefused) {
  ScriptedVisionDevice device(SmallPlan(), {});
  EXPECT_EQ(device.Wait(Ticket{}, kNoDeadline).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(device.Wait(Ticket{12}, kNoDeadline).code(), StatusCode::kInvalidArgument);
}

TEST(ScriptedVisionDevice, LatencyPassesOnTheClockAndDeadlinesHold) {
  ManualClock clock;
  ScriptedVisionDevice::Options options;
  options.clock = &clock;
  options.latency[static_cast<int>(Operation::kExtract)] = milliseconds(10);
  ScriptedVisionDevice device(SmallPlan(), options);
  device.SetFrame(0, {Feature(1, 10, 1)});
  Extraction extraction(0);
  const Ticket ticket = *device.EnqueueExtract(Lane::kTracking, extraction.Request(*device.CreateFeatureSet()));
  EXPECT_EQ(device.Wait(ticket, At(4)).code(), StatusCode::kDeadlineExceeded);
  EXPECT_EQ(clock.Now(), At(4));
  EXPECT_EQ(extraction.num_keypoints, -1);
  EXPECT_TRUE(device.Wait(ticket, At(20)).ok());
  EXPECT_EQ(clock.Now(), At(10));
  EXPECT_EQ(extraction.num_keypoints, 1);
}

TEST(ScriptedVisionDevice, LanesWorkInOrderAndSideBySide) {
  ManualClock clock;
  ScriptedVisionDevice::Options options;
  options.clock = &clock;
  options.latency[static_cast<int>(Operation::kMatch)] = milliseconds(6);
  ScriptedVisionDevice device(SmallPlan(), options);
  Matching first, second, other;
  const DescriptorList none = DescriptorList::Gather({});
  const Ticket a = *device.EnqueueMatch(Lane::kTracking, first.Request(none, none));
  const Ticket b = *device.EnqueueMatch(Lane::kTracking, second.Request(none, none));
  const Ticket c = *device.EnqueueMatch(Lane::kBackground, other.Request(none, none));
  ASSERT_TRUE(device.Wait(c, kNoDeadline).ok());
  EXPECT_EQ(clock.Now(), At(6));
  EXPECT_EQ(first.num_matches, -1);
  ASSERT_TRUE(device.Wait(b, kNoDeadline).ok());
  EXPECT_EQ(clock.Now(), At(12));
  EXPECT_EQ(first.num_matches, 0);
  EXPECT_TRUE(device.Wait(a, kNoDeadline).ok());
}

TEST(ScriptedVisionDevice, FailuresComeAtTheCallsOfTheScript) {
  ScriptedVisionDevice device(SmallPlan(), {});
  device.AddFailure(Operation::kMatch, 1, FailurePoint::kEnqueue, StatusCode::kUnavailable);
  device.AddFailure(Operation::kMatch, 2, FailurePoint::kWait, StatusCode::kInternal);
  Matching matching;
  const DescriptorList none = DescriptorList::Gather({});
  EXPECT_TRUE(MatchAndWait(device, Lane::kTracking, matching.Request(none, none)).ok());
  matching.num_matches = -1;
  EXPECT_EQ(device.EnqueueMatch(Lane::kTracking, matching.Request(none, none)).code(), StatusCode::kUnavailable);
  const Result<Ticket> failing = device.EnqueueMatch(Lane::kTracking, matching.Request(none, none));
  ASSERT_TRUE(failing.ok());
  EXPECT_EQ(device.Wait(*failing, kNoDeadline).code(), StatusCode::kInternal);
  EXPECT_EQ(matching.num_matches, -1);
  EXPECT_TRUE(MatchAndWait(device, Lane::kTracking, matching.Request(none, none)).ok());
  EXPECT_EQ(device.num_calls(Operation::kMatch), 4u);
}

TEST(ScriptedVisionDevice, LostDeviceIsUnavailableUntilItIsBack) {
  ScriptedVisionDevice device(SmallPlan(), {});
  Matching matching;
  const DescriptorList none = DescriptorList::Gather({});
  const Ticket ticket = *device.EnqueueMatch(Lane::kTracking, matching.Request(none, none));
  device.SetLost(true);
  EXPECT_EQ(device.Wait(ticket, kNoDeadline).code(), StatusCode::kUnavailable);
  EXPECT_EQ(device.EnqueueMatch(Lane::kTracking, matching.Request(none, none)).code(), StatusCode::kUnavailable);
  device.SetLost(false);
  EXPECT_TRUE(device.Wait(ticket, kNoDeadline).ok());
}

TEST(ScriptedVisionDevice, ReleasingASetThatQueuedWorkNeedsStopsTheProcess) {
  const FatalTrap trap;
  ScriptedVisionDevice device(SmallPlan(), {});
  const FeatureSetHandle set = Extract(device, 0);
  Matching matching;
  const Ticket ticket =
      *device.EnqueueMatch(Lane::kTracking, matching.Request(DescriptorList::Whole(set), DescriptorList::Gather({})));
  device.ReleaseFeatureSet(set);
  EXPECT_THROW((void)device.Wait(ticket, kNoDeadline), CheckFailure);
}

TEST(ScriptedVisionDevice, WrittenDescriptorsAreReadBackAsTheyAre) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const std::vector<Keypoint> keypoints(1);
  auto descriptor = EncodeAppearance({2, 0});
  descriptor.back() ^= 1;  // no appearance gives this
  const FeatureSetHandle written = *device.CreateFeatureSet();
  ASSERT_TRUE(device.WriteFeatures(written, keypoints, descriptor).ok());
  std::array<std::uint8_t, kDescriptorBytes> read{};
  ASSERT_TRUE(device.ReadDescriptors(written, read).ok());
  EXPECT_EQ(read, descriptor);
  // What takes its place knows nothing of it.
  device.ReleaseFeatureSet(written);
  device.SetFrame(0, {Feature(2, 10, 1)});
  const FeatureSetHandle extracted = Extract(device, 0);
  ASSERT_TRUE(device.ReadDescriptors(extracted, read).ok());
  EXPECT_EQ(read, EncodeAppearance({2, 0}));
}

TEST(ScriptedVisionDevice, WrittenFeaturesAreLikeExtractedOnes) {
  ScriptedVisionDevice device(SmallPlan(), {});
  device.SetFrame(0, {Feature(1, 10, 1), Feature(2, 10, 2)});
  const FeatureSetHandle extracted = Extract(device, 0), written = *device.CreateFeatureSet();
  const std::vector<Keypoint> keypoints(1);
  const auto descriptor = EncodeAppearance({2, 0});
  ASSERT_TRUE(device.WriteFeatures(written, keypoints, descriptor).ok());
  Matching matching;
  ASSERT_TRUE(MatchAndWait(device, Lane::kTracking,
                           matching.Request(DescriptorList::Whole(written), DescriptorList::Whole(extracted)))
                  .ok());
  ASSERT_EQ(matching.num_matches, 1);
  EXPECT_EQ(matching.matches[0].train, 1);
}

TEST(ScriptedVisionDevice, WrongNumberOfDescriptorsIsRefused) {
  ScriptedVisionDevice device(SmallPlan(), {});
  const FeatureSetHandle set = *device.CreateFeatureSet();
  const std::vector<Keypoint> keypoints(2);
  const std::vector<std::uint8_t> bytes(kDescriptorBytes);
  EXPECT_EQ(device.WriteFeatures(set, keypoints, bytes).code(), StatusCode::kInvalidArgument);
}

TEST(ScriptedVisionDevice, TwoLanesOnTwoThreadsShareTheSets) {
  VisionPlan plan = SmallPlan();
  plan.max_feature_sets = 8;
  ScriptedVisionDevice device(plan, {});
  ScriptTwoFrames(device);
  const FeatureSetHandle reference = Extract(device, 0);
  const auto work = [&](Lane lane, int* num_wrong) {
    for (int i = 0; i < 500; ++i) {
      const FeatureSetHandle set = *device.CreateFeatureSet();
      Extraction extraction(1);
      Matching matching;
      if (!ExtractAndWait(device, lane, extraction.Request(set)).ok()) ++*num_wrong;
      const MatchRequest request = matching.Request(DescriptorList::Whole(set), DescriptorList::Whole(reference));
      if (!MatchAndWait(device, lane, request).ok() || matching.num_matches != 2) ++*num_wrong;
      device.ReleaseFeatureSet(set);
    }
  };
  int wrong_here = 0, wrong_there = 0;
  std::thread other([&] { work(Lane::kBackground, &wrong_there); });
  work(Lane::kTracking, &wrong_here);
  other.join();
  EXPECT_EQ(wrong_here, 0);
  EXPECT_EQ(wrong_there, 0);
}

}  // namespace
}  // namespace haustra
