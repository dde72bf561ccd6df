#include "hal/fakes/scripted_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace haustra {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr ScriptedSimilarity kSimilarity{};

// An entry at feature index `idx` that shows `landmark` at (x, y).
ScriptedEntry Entry(std::int32_t idx, std::uint32_t landmark, float x = 0, float y = 0, std::uint32_t group = 0) {
  Keypoint keypoint;
  keypoint.x_px = x;
  keypoint.y_px = y;
  keypoint.scale_px = 2.0f;
  return {{landmark, group}, keypoint, idx, true};
}

std::vector<std::pair<int, int>> Pairs(std::span<const Match> matches) {
  std::vector<std::pair<int, int>> pairs;
  for (const Match& match : matches) pairs.emplace_back(match.query, match.train);
  return pairs;
}

std::vector<Match> RunMatch(const std::vector<ScriptedEntry>& query, const std::vector<ScriptedEntry>& train,
                            const MatchOptions& options, const DisparityWindow* disparity = nullptr,
                            const EpipolarGate* epipolar = nullptr) {
  std::vector<Match> matches(query.size());
  matches.resize(MatchScripted(query, train, kSimilarity, options, disparity, epipolar, matches));
  return matches;
}

std::vector<Match> RunGuided(const std::vector<GuidedQuery>& windows, const std::vector<ScriptedEntry>& query,
                             const std::vector<ScriptedEntry>& train, const MatchOptions& options,
                             const std::vector<std::uint8_t>& allowed = {}) {
  std::vector<Match> matches(query.size());
  std::vector<std::int32_t> holder(train.size());
  matches.resize(GuidedMatchScripted(windows, query, train, allowed, kSimilarity, options, holder, matches));
  return matches;
}

constexpr MatchOptions kStrict{0.7f, 0.9f, false};

TEST(ScriptedMatching, SameLandmarkIsFound) {
  const auto matches = RunMatch({Entry(0, 7), Entry(1, 8), Entry(2, 9)}, {Entry(0, 9), Entry(1, 7)}, kStrict);
  EXPECT_THAT(Pairs(matches), ElementsAre(Pair(0, 1), Pair(2, 0)));
  EXPECT_EQ(matches[0].similarity, kSimilarity.same);
  EXPECT_EQ(matches[0].second_similarity, kSimilarity.other);
}

TEST(ScriptedMatching, OnlyCandidateHasNoSecond) {
  const auto matches = RunMatch({Entry(0, 7)}, {Entry(0, 7)}, kStrict);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].second_similarity, 0.0f);
}

TEST(ScriptedMatching, LookAlikeBesideTheLandmarkFailsTheRatioTest) {
  const std::vector<ScriptedEntry> query{Entry(0, 7, 0, 0, 3)};
  const std::vector<ScriptedEntry> train{Entry(0, 7, 0, 0, 3), Entry(1, 8, 0, 0, 3), Entry(2, 9)};
  EXPECT_THAT(RunMatch(query, train, kStrict), IsEmpty());
  EXPECT_THAT(Pairs(RunMatch(query, train, {0.7f, 1.0f, false})), ElementsAre(Pair(0, 0)));
}

TEST(ScriptedMatching, LookAlikeAloneIsTakenForTheLandmark) {
  const auto matches = RunMatch({Entry(0, 7, 0, 0, 3)}, {Entry(0, 8, 0, 0, 3), Entry(1, 9)}, kStrict);
  EXPECT_THAT(Pairs(matches), ElementsAre(Pair(0, 0)));
}

TEST(ScriptedMatching, TiesGoToTheLowestPosition) {
  const auto matches = RunMatch({Entry(0, 7)}, {Entry(0, 8), Entry(1, 7), Entry(2, 7)}, {0.7f, 1.0f, false});
  ASSERT_THAT(Pairs(matches), ElementsAre(Pair(0, 1)));
  EXPECT_EQ(matches[0].second_similarity, kSimilarity.same);
}

TEST(ScriptedMatching, MutualKeepsOnlyEachOthersBest) {
  const std::vector<ScriptedEntry> query{Entry(0, 7), Entry(1, 7)}, train{Entry(0, 7)};
  EXPECT_THAT(Pairs(RunMatch(query, train, {0.7f, 1.0f, false})), ElementsAre(Pair(0, 0), Pair(1, 0)));
  EXPECT_THAT(Pairs(RunMatch(query, train, {0.7f, 1.0f, true})), ElementsAre(Pair(0, 0)));
}

TEST(ScriptedMatching, StaleEntriesMatchNothingAndAreNobodysSecond) {
  ScriptedEntry stale = Entry(0, 7);
  stale.is_valid = false;
  EXPECT_THAT(RunMatch({stale}, {Entry(0, 7)}, kStrict), IsEmpty());
  const auto matches = RunMatch({Entry(0, 7)}, {stale, Entry(1, 7)}, kStrict);
  ASSERT_THAT(Pairs(matches), ElementsAre(Pair(0, 1)));
  EXPECT_EQ(matches[0].second_similarity, 0.0f);
}

TEST(ScriptedMatching, EmptyListsMatchNothing) {
  EXPECT_THAT(RunMatch({}, {Entry(0, 7)}, kStrict), IsEmpty());
  EXPECT_THAT(RunMatch({Entry(0, 7)}, {}, kStrict), IsEmpty());
}

TEST(ScriptedMatching, DisparityWindowAlsoBoundsTheSecondBest) {
  const DisparityWindow window{10.0f, 5.0f};
  const std::vector<ScriptedEntry> query{Entry(0, 7, 100, 100, 3)};
  const std::vector<ScriptedEntry> train{Entry(0, 8, 111, 100, 3), Entry(1, 7, 110, 105, 3), Entry(2, 7, 100, 106, 3)};
  const auto matches = RunMatch(query, train, kStrict, &window);
  ASSERT_THAT(Pairs(matches), ElementsAre(Pair(0, 1)));
  EXPECT_EQ(matches[0].second_similarity, 0.0f);
}

// The second camera stands one unit to the right and looks the same way: E = [t]x, rows stay on rows.
TEST(ScriptedMatching, EpipolarGateAdmitsWhatLiesOnThePlane) {
  EpipolarGate gate;
  gate.train_from_query_essential = {0, 0, 0, 0, 0, 1, 0, -1, 0};
  const auto bearing = [](float x, float y) {
    const float length = std::sqrt(x * x + y * y + 1.0f);
    return std::array<float, 3>{x / length, y / length, 1.0f / length};
  };
  const std::vector<std::array<float, 3>> query_bearings{bearing(0.1f, 0.2f), bearing(0.3f, -0.1f)};
  const std::vector<std::array<float, 3>> train_bearings{bearing(-0.2f, 0.2f), bearing(0.0f, 0.0f)};
  const std::vector<float> tolerance{0.01f, 0.01f};
  gate.query_bearings = query_bearings;
  gate.train_bearings = train_bearings;
  gate.query_tolerance = tolerance;
  gate.train_tolerance = tolerance;
  const std::vector<ScriptedEntry> query{Entry(0, 7), Entry(1, 8)}, train{Entry(0, 7), Entry(1, 8)};
  EXPECT_THAT(Pairs(RunMatch(query, train, kStrict, nullptr, &gate)), ElementsAre(Pair(0, 0)));
}

TEST(ScriptedMatching, BearingsWithoutAnEpipolarPlanePassNoGate) {
  EpipolarGate gate;  // E = 0
  const std::vector<std::array<float, 3>> bearings{{0.0f, 0.6f, 0.8f}};
  const std::vector<float> tolerance{1.0f};
  gate.query_bearings = gate.train_bearings = bearings;
  gate.query_tolerance = gate.train_tolerance = tolerance;
  EXPECT_TRUE(RunMatch({Entry(0, 7)}, {Entry(0, 7)}, kStrict, nullptr, &gate).empty());
}

TEST(ScriptedMatching, EpipolarBearingsAreFoundByFeatureAndNotByPosition) {
  EpipolarGate gate;
  gate.train_from_query_essential = {0, 0, 0, 0, 0, 1, 0, -1, 0};
  // Feature 1 of each side lies on the horizon, feature 0 does not.
  const std::vector<std::array<float, 3>> query_bearings{{0.0f, 0.6f, 0.8f}, {0.0f, 0.0f, 1.0f}};
  const std::vector<std::array<float, 3>> train_bearings{{0.0f, -0.6f, 0.8f}, {0.6f, 0.0f, 0.8f}};
  const std::vector<float> tolerance{0.01f, 0.01f};
  gate.query_bearings = query_bearings;
  gate.train_bearings = train_bearings;
  gate.query_tolerance = tolerance;
  gate.train_tolerance = tolerance;
  EXPECT_THAT(Pairs(RunMatch({Entry(1, 7)}, {Entry(1, 7)}, kStrict, nullptr, &gate)), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(RunMatch({Entry(0, 7)}, {Entry(0, 7)}, kStrict, nullptr, &gate), IsEmpty());
}

GuidedQuery Window(float x, float y, float radius, float min_scale = 0.0f, float max_scale = 100.0f) {
  return {{}, x, y, radius, min_scale, max_scale};
}

TEST(ScriptedGuidedMatching, FindsInsideTheWindowOnly) {
  const std::vector<ScriptedEntry> train{Entry(0, 7, 104, 103), Entry(1, 8, 110, 100)};
  EXPECT_THAT(Pairs(RunGuided({Window(100, 100, 5)}, {Entry(0, 7)}, train, kStrict)), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(RunGuided({Window(100, 100, 4.9f)}, {Entry(0, 7)}, train, kStrict), IsEmpty());
}

TEST(ScriptedGuidedMatching, ScaleMustBeInTheRange) {
  const std::vector<ScriptedEntry> train{Entry(0, 7, 100, 100)};
  EXPECT_THAT(RunGuided({Window(100, 100, 5, 2.1f, 4.0f)}, {Entry(0, 7)}, train, kStrict), IsEmpty());
  EXPECT_THAT(RunGuided({Window(100, 100, 5, 0.5f, 1.9f)}, {Entry(0, 7)}, train, kStrict), IsEmpty());
  EXPECT_THAT(Pairs(RunGuided({Window(100, 100, 5, 2.0f, 2.0f)}, {Entry(0, 7)}, train, kStrict)),
              ElementsAre(Pair(0, 0)));
}

TEST(ScriptedGuidedMatching, LookAlikeCountsAsSecondOnlyInsideTheWindow) {
  const std::vector<ScriptedEntry> query{Entry(0, 7, 0, 0, 3)};
  const std::vector<ScriptedEntry> train{Entry(0, 7, 100, 100, 3), Entry(1, 8, 120, 100, 3)};
  EXPECT_THAT(Pairs(RunGuided({Window(100, 100, 10)}, query, train, kStrict)), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(RunGuided({Window(100, 100, 30)}, query, train, kStrict), IsEmpty());
}

TEST(ScriptedGuidedMatching, KeypointThatIsNotAllowedIsLeftOut) {
  const std::vector<ScriptedEntry> train{Entry(0, 7, 100, 100), Entry(1, 7, 101, 100)};
  EXPECT_THAT(Pairs(RunGuided({Window(100, 100, 10)}, {Entry(0, 7)}, train, kStrict, {0, 1})), ElementsAre(Pair(0, 1)));
}

TEST(ScriptedGuidedMatching, KeypointGoesToTheMostSimilarQueryAndThenToTheFirst) {
  const std::vector<ScriptedEntry> train{Entry(0, 7, 100, 100, 3)};
  const std::vector<GuidedQuery> windows(3, Window(100, 100, 10));
  EXPECT_THAT(
      Pairs(RunGuided(windows, {Entry(0, 8, 0, 0, 3), Entry(1, 7, 0, 0, 3), Entry(2, 7, 0, 0, 3)}, train, kStrict)),
      ElementsAre(Pair(1, 0)));
}

}  // namespace
}  // namespace haustra
