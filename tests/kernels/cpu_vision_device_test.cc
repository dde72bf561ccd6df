// What the CPU device promises beyond the contract: the same matches to the bit at every SIMD level, the same features
// for any number of threads, and no allocation once it stands.
#include "kernels/cpu/cpu_vision_device.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <thread>
#include <vector>

#include "platform/clock/system_clock.h"
#include "platform/trap/wait_trap.h"
#include "tests/kernels/allocation_counter.h"
#include "tests/kernels/blob_scene.h"
#include "tests/kernels/naive_matcher.h"

namespace haustra::testing {
namespace {

using kernels::SimdLevel;

constexpr int kWidth = 320;
constexpr int kHeight = 240;

VisionPlan SmallPlan() {
  VisionPlan plan;
  plan.max_width_px = kWidth;
  plan.max_height_px = kHeight;
  plan.max_features = 500;
  plan.max_feature_sets = 4;
  plan.max_match_list = 600;
  return plan;
}

std::unique_ptr<VisionDevice> Create(int num_threads, SimdLevel level = kernels::BestSimdLevel()) {
  ExtractOptions options;
  options.num_features = 500;
  options.border_threshold = 0;
  return CreateCpuVisionDevice(SmallPlan(), options, num_threads, level).value();
}

Picture Texture(unsigned seed) {
  return Render(RandomBlobs(900, kWidth, kHeight, 20.0, 40.0, seed), kWidth, kHeight, 120.0);
}

HostFeatures Extract(VisionDevice& device, const Picture& picture, FeatureSetHandle* set, float min_scale_px = 0.0f) {
  *set = device.CreateFeatureSet().value();
  HostFeatures features;
  features.keypoints.resize(500);
  std::int32_t count = 0;
  EXPECT_TRUE(
      ExtractAndWait(device, Lane::kTracking, {picture.view(), *set, features.keypoints, &count, 0, min_scale_px})
          .ok());
  features.keypoints.resize(count);
  features.descriptors.resize(static_cast<std::size_t>(count) * kDescriptorBytes);
  EXPECT_TRUE(device.ReadDescriptors(*set, features.descriptors).ok());
  return features;
}

bool IsSame(const Keypoint& a, const Keypoint& b) {
  return a.x_px == b.x_px && a.y_px == b.y_px && a.scale_px == b.scale_px && a.angle_rad == b.angle_rad &&
         a.response == b.response && a.octave == b.octave;
}

std::vector<SimdLevel> SupportedLevels() {
  std::vector<SimdLevel> levels;
  for (const SimdLevel level : {SimdLevel::kPortable, SimdLevel::kNeonDot, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
    if (kernels::IsSupported(level)) levels.push_back(level);
  }
  return levels;
}

TEST(CpuVisionDevice, ExtractDoesNotDependOnTheNumberOfThreads) {
  const Picture picture = Texture(1);
  FeatureSetHandle set;
  const auto one = Create(1);
  const HostFeatures expected = Extract(*one, picture, &set);
  ASSERT_GT(expected.keypoints.size(), 300u);
  for (const int num_threads : {2, 3, 7}) {
    const auto device = Create(num_threads);
    const HostFeatures features = Extract(*device, picture, &set);
    ASSERT_EQ(features.size(), expected.size());
    for (int i = 0; i < features.size(); ++i) ASSERT_TRUE(IsSame(features.keypoints[i], expected.keypoints[i])) << i;
    EXPECT_EQ(features.descriptors, expected.descriptors);
  }
}

// What makes it quick: the enlarged picture has the keypoints of octave -1 and no others.
TEST(CpuVisionDevice, ExtractWithoutFineScalesLeavesOutTheEnlargedPicture) {
  const Picture picture = Texture(1);
  std::vector<HostFeatures> of_threads;
  for (const int num_threads : {1, 3}) {
    const auto device = Create(num_threads);
    FeatureSetHandle set;
    const HostFeatures all = Extract(*device, picture, &set);
    EXPECT_TRUE(
        std::any_of(all.keypoints.begin(), all.keypoints.end(), [](const Keypoint& k) { return k.octave < 0; }));
    device->ReleaseFeatureSet(set);
    of_threads.push_back(Extract(*device, picture, &set, 1.8f));
    for (const Keypoint& k : of_threads.back().keypoints) {
      EXPECT_GE(k.octave, 0);
      EXPECT_GE(k.scale_px, 1.79f);
    }
    const HostFeatures finer = Extract(*device, picture, &set, 1.7f);
    EXPECT_EQ(finer.descriptors, all.descriptors) << "octave -1 has some of 1.75";
  }
  EXPECT_GT(of_threads[0].size(), 50);
  EXPECT_EQ(of_threads[0].descriptors, of_threads[1].descriptors);
}

TEST(CpuVisionDevice, ExtractAgreesBetweenSimdLevelsUpToRounding) {
  const Picture picture = Texture(2);
  FeatureSetHandle set;
  const HostFeatures expected = Extract(*Create(1, SimdLevel::kPortable), picture, &set);
  for (const SimdLevel level : SupportedLevels()) {
    const HostFeatures features = Extract(*Create(1, level), picture, &set);
    int found = 0;
    for (int i = 0; i < expected.size(); ++i) {
      for (int j = 0; j < features.size(); ++j) {
        const Keypoint& a = expected.keypoints[i];
        const Keypoint& b = features.keypoints[j];
        if (std::hypot(a.x_px - b.x_px, a.y_px - b.y_px) < 0.01f && std::abs(a.scale_px / b.scale_px - 1.0f) < 0.01f &&
            Similarity(expected.descriptor(i), features.descriptor(j)) > 0.995) {
          ++found;
          break;
        }
      }
    }
    EXPECT_GE(found, 0.98 * expected.size()) << ToString(level);
  }
}

TEST(CpuVisionDevice, MatchesAreTheSameToTheBitAtEverySimdLevelAndNumberOfThreads) {
  std::vector<Match> expected, expected_guided;
  FeatureSetHandle unused;
  const HostFeatures a = Extract(*Create(1, SimdLevel::kPortable), Texture(3), &unused);
  const HostFeatures b = Extract(*Create(1, SimdLevel::kPortable), Texture(3 + 1), &unused);
  for (const SimdLevel level : SupportedLevels()) {
    for (const int num_threads : {1, 4}) {
      const auto device = Create(num_threads, level);
      const FeatureSetHandle sets[] = {device->CreateFeatureSet().value(), device->CreateFeatureSet().value()};
      ASSERT_TRUE(device->WriteFeatures(sets[0], a.keypoints, a.descriptors).ok());
      ASSERT_TRUE(device->WriteFeatures(sets[1], b.keypoints, b.descriptors).ok());
      const DisparityWindow window{150.0f, 100.0f};
      std::vector<Match> matches(500);
      std::int32_t count = 0;
      ASSERT_TRUE(MatchAndWait(*device, Lane::kTracking,
                               {DescriptorList::Whole(sets[0]),
                                DescriptorList::Whole(sets[1]),
                                {0.0f, 0.99f, true},
                                &window,
                                nullptr,
                                matches,
                                &count})
                      .ok());
      matches.resize(count);
      std::vector<GuidedQuery> queries;
      for (int i = 0; i < a.size(); ++i) {
        queries.push_back({{sets[0], i}, a.keypoints[i].x_px, a.keypoints[i].y_px, 40.0f, 0.0f, 100.0f});
      }
      std::vector<Match> guided(500);
      ASSERT_TRUE(GuidedMatchAndWait(*device, Lane::kTracking, {queries, sets[1], {}, {}, guided, &count}).ok());
      guided.resize(count);
      if (expected.empty()) {
        expected = matches;
        expected_guided = guided;
        ASSERT_GT(expected.size(), 30u);
        ASSERT_GT(expected_guided.size(), 30u);
      }
      const auto is_same = [](const std::vector<Match>& p, const std::vector<Match>& q) {
        return p.size() == q.size() && std::equal(p.begin(), p.end(), q.begin(), [](const Match& m, const Match& n) {
                 return m.query == n.query && m.train == n.train && m.similarity == n.similarity &&
                        m.second_similarity == n.second_similarity;
               });
      };
      EXPECT_TRUE(is_same(matches, expected)) << ToString(level);
      EXPECT_TRUE(is_same(guided, expected_guided)) << ToString(level);
    }
  }
}

// Each wait is over long before the work is, wherever in the work it is by then.
TEST(CpuVisionDevice, WaitsThatEndInsideTheWorkChangeNoResult) {
  const SystemClock clock;
  const auto in_slices = [&](VisionDevice& device, const Result<Ticket>& ticket) {
    EXPECT_TRUE(ticket.ok());
    int num_left = 0;
    for (;; ++num_left) {
      const Status status = device.Wait(*ticket, clock.Now() + std::chrono::microseconds(100));
      if (status.ok()) return num_left;
      EXPECT_EQ(status.code(), StatusCode::kDeadlineExceeded);
    }
  };
  const Picture picture = Texture(1);
  FeatureSetHandle set;
  const auto reference = Create(1);
  const HostFeatures expected = Extract(*reference, picture, &set);
  MatchRequest match;
  match.query = match.train = DescriptorList::Whole(set);
  match.options = {0.1f, 1.0f, true};
  for (const int num_threads : {1, 3}) {
    const auto device = Create(num_threads);
    const FeatureSetHandle sliced = device->CreateFeatureSet().value();
    HostFeatures features;
    features.keypoints.resize(500);
    std::int32_t count = -7;
    EXPECT_GT(in_slices(*device,
                        device->EnqueueExtract(Lane::kTracking, {picture.view(), sliced, features.keypoints, &count})),
              2);
    features.keypoints.resize(static_cast<std::size_t>(count));
    features.descriptors.resize(features.keypoints.size() * kDescriptorBytes);
    EXPECT_TRUE(device->ReadDescriptors(sliced, features.descriptors).ok());
    ASSERT_EQ(features.size(), expected.size());
    for (int i = 0; i < features.size(); ++i) ASSERT_TRUE(IsSame(features.keypoints[i], expected.keypoints[i])) << i;
    EXPECT_EQ(features.descriptors, expected.descriptors);

    std::vector<Match> matches(500), expected_matches(500);
    std::int32_t expected_count = 0;
    MatchRequest request = match;
    request.matches = expected_matches;
    request.num_matches = &expected_count;
    ASSERT_TRUE(MatchAndWait(*reference, Lane::kTracking, request).ok());
    request.query = request.train = DescriptorList::Whole(sliced);
    request.matches = matches;
    request.num_matches = &count;
    in_slices(*device, device->EnqueueMatch(Lane::kTracking, request));
    ASSERT_EQ(count, expected_count);
    ASSERT_GT(count, 300);
    for (int i = 0; i < count; ++i) EXPECT_EQ(matches[i].train, expected_matches[i].train);

    std::vector<GuidedQuery> queries;
    for (int i = 0; i < 600; ++i)
      queries.push_back({{sliced, i % features.size()}, 160.0f, 120.0f, 400.0f, 0.0f, 99.0f});
    std::vector<Match> guided(600);
    in_slices(*device, device->EnqueueGuidedMatch(Lane::kTracking, {queries, sliced, {}, {}, guided, &count}));
    EXPECT_EQ(count, features.size()) << "each query finds the keypoint that it is of";
  }
}

TEST(CpuVisionDevice, WorkAfterConstructionDoesNotAllocate) {
  const auto device = Create(2);
  const Picture picture = Texture(5);
  Picture colour = picture;
  colour.pixels.resize(picture.pixels.size() * 3, 90);
  std::vector<Keypoint> keypoints(500);
  std::vector<Match> matches(600);
  std::vector<GuidedQuery> queries(500);
  std::vector<DescriptorRef> refs(500);
  std::int32_t count = 0;
  bool is_ok = true;

  const int before = NumAllocations();
  const FeatureSetHandle set = device->CreateFeatureSet().value();
  const FeatureSetHandle second = device->CreateFeatureSet().value();
  is_ok &= ExtractAndWait(*device, Lane::kTracking, {picture.view(), set, keypoints, &count}).ok();
  for (int i = 0; i < 500; ++i) {
    refs[i] = {set, i};
    queries[i] = {refs[i], keypoints[i].x_px, keypoints[i].y_px, 20.0f, 0.0f, 100.0f};
  }
  is_ok &= ExtractAndWait(
               *device, Lane::kBackground,
               {{colour.pixels.data(), kWidth, kHeight, 3 * kWidth, PixelFormat::kBgr8}, second, keypoints, &count})
               .ok();
  is_ok &= MatchAndWait(*device, Lane::kTracking,
                        {DescriptorList::Whole(set),
                         DescriptorList::Gather(refs),
                         {0.1f, 0.9f, true},
                         nullptr,
                         nullptr,
                         matches,
                         &count})
               .ok();
  is_ok &= GuidedMatchAndWait(*device, Lane::kTracking, {queries, set, {}, {}, matches, &count}).ok();
  device->ReleaseFeatureSet(set);
  device->ReleaseFeatureSet(second);
  const int after = NumAllocations();

  EXPECT_TRUE(is_ok);
  EXPECT_GT(count, 300);
  EXPECT_EQ(after, before);
}

// What else may hold up tracking: neither mapping's requests nor its own helpers have a lock in common with it, and
// without helpers it asks nothing of the kernel.
TEST(CpuVisionDevice, WorkTakesNoLock) {
  if (!WaitTrap::CatchesLocks()) GTEST_SKIP() << "locks cannot be watched in this build";
  const Picture picture = Texture(5);
  for (const int num_threads : {1, 3}) {
    const auto device = Create(num_threads);
    std::thread tracking([&] {
      const bool is_told = WaitTrap::CatchSystemCalls();
      std::vector<Keypoint> keypoints(500);
      std::vector<Match> matches(500);
      std::vector<GuidedQuery> queries(500);
      std::int32_t count = 0;
      const WaitTrap trap(WaitTrap::Mode::kCount);
      const FeatureSetHandle set = device->CreateFeatureSet().value();
      bool is_ok = ExtractAndWait(*device, Lane::kTracking, {picture.view(), set, keypoints, &count}).ok();
      MatchRequest match;
      match.query = match.train = DescriptorList::Whole(set);
      match.options.mutual = true;
      match.matches = matches;
      match.num_matches = &count;
      is_ok &= MatchAndWait(*device, Lane::kTracking, match).ok();
      for (int i = 0; i < 500; ++i) queries[i] = {{set, i}, keypoints[i].x_px, keypoints[i].y_px, 20.0f, 0.0f, 99.0f};
      is_ok &= GuidedMatchAndWait(*device, Lane::kTracking, {queries, set, {}, {}, matches, &count}).ok();
      device->ReleaseFeatureSet(set);
      EXPECT_TRUE(is_ok);
      EXPECT_EQ(WaitTrap::num_locks(), 0u);
      const bool may_ask_nothing = is_told && num_threads == 1;
      EXPECT_EQ(may_ask_nothing ? WaitTrap::num_system_calls() : 0u, 0u) << WaitTrap::last_system_call();
    });
    tracking.join();
  }
}

TEST(CpuVisionDevice, CreateRefusesWhatThisMachineCannotDo) {
  EXPECT_EQ(CreateCpuVisionDevice(SmallPlan(), {}, 0).code(), StatusCode::kInvalidArgument);
  ExtractOptions options;
  options.num_features = 500;
  EXPECT_EQ(CreateCpuVisionDevice(SmallPlan(), options, 65).code(), StatusCode::kInvalidArgument);
  for (const SimdLevel level : {SimdLevel::kNeonDot, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
    if (kernels::IsSupported(level)) continue;
    EXPECT_EQ(CreateCpuVisionDevice(SmallPlan(), options, 1, level).code(), StatusCode::kUnavailable);
  }
}

// In a process of its own, whose user may have so few. The administrator has no such limit.
TEST(CpuVisionDevice, CreateSaysSoWhereThereAreNoMoreThreads) {
  constexpr int kGood = 0, kIsMade = 1, kHasThreads = 2, kCannotTell = 77;
  const pid_t child = ::fork();
  if (child == 0) {
    constexpr uid_t kNobody = 65534;
    constexpr rlimit kLimit{3, 3};
    if (::getuid() == 0 && ::setuid(kNobody) != 0) ::_exit(kCannotTell);
    if (::setrlimit(RLIMIT_NPROC, &kLimit) != 0) ::_exit(kCannotTell);
    ExtractOptions options;
    options.num_features = 500;
    if (CreateCpuVisionDevice(SmallPlan(), options, 8).code() != StatusCode::kCapacityExceeded) ::_exit(kIsMade);
    const auto num_threads = std::distance(std::filesystem::directory_iterator("/proc/self/task"), {});
    ::_exit(num_threads == 1 ? kGood : kHasThreads);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  if (WEXITSTATUS(status) == kCannotTell) GTEST_SKIP() << "the number of threads cannot be limited here";
  EXPECT_EQ(WEXITSTATUS(status), kGood);
}

}  // namespace
}  // namespace haustra::testing
