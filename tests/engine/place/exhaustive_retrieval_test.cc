#include "engine/place/exhaustive_retrieval.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "engine/place/strongest_features.h"
#include "tests/engine/place/synthetic_colon.h"
#include "tests/geometry/allocation_counter.h"

namespace haustra::test {
namespace {

class ExhaustiveRetrievalTest : public testing::Test {
 protected:
  ExhaustiveRetrievalTest() : colon_(1), atlas_(colon_.MakeAtlas()) {
    colon_.AddWall(0.0, 14.0, 4000);
    colon_.AddMap(&atlas_, 0.0, 10.0, 40, Sim3{});
  }

  KeyframeHandle keyframe(int i) const { return colon_.frames()[i].keyframe; }

  void AddAll(KeyframeRetrieval* retrieval) {
    for (const SyntheticColon::Frame& frame : colon_.frames()) {
      ASSERT_TRUE(retrieval->Add(atlas_, frame.keyframe).ok());
    }
  }

  RetrievalQuery QueryOf(int i) {
    SelectStrongestWithPoint(atlas_.keyframe(keyframe(i)), 256, &strongest_);
    RetrievalQuery query;
    query.set = atlas_.keyframe(keyframe(i)).features.set;
    query.strongest = strongest_;
    query.is_excluded = [handle = keyframe(i)](KeyframeHandle other, const Keyframe&) { return other == handle; };
    return query;
  }

  SyntheticColon colon_;
  Atlas atlas_;
  RetrievalConfig options_;
  std::vector<std::int32_t> strongest_;
  std::vector<RetrievalCandidate> found_;
};

TEST_F(ExhaustiveRetrievalTest, NeighboursComeFirst) {
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  ASSERT_TRUE(retrieval.Query(atlas_, QueryOf(20), &found_).ok());
  ASSERT_GE(found_.size(), 2u);
  const KeyframeId id = atlas_.keyframe(keyframe(20)).id;
  for (int i = 0; i < 2; ++i) {
    EXPECT_LE(std::abs(static_cast<int>(atlas_.keyframe(found_[i].keyframe).id) - static_cast<int>(id)), 2);
  }
  for (std::size_t i = 1; i < found_.size(); ++i) EXPECT_GE(found_[i - 1].num_votes, found_[i].num_votes);
}

TEST_F(ExhaustiveRetrievalTest, UnseenPlaceGivesNothing) {
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  for (int i = 20; i < 40; ++i) ASSERT_TRUE(retrieval.Add(atlas_, keyframe(i)).ok());
  ASSERT_TRUE(retrieval.Query(atlas_, QueryOf(0), &found_).ok());
  EXPECT_TRUE(found_.empty());
}

TEST_F(ExhaustiveRetrievalTest, ExcludedAndRemovedKeyframesAreNotFound) {
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  retrieval.Remove(keyframe(21));
  RetrievalQuery query = QueryOf(20);
  query.is_excluded = [&](KeyframeHandle handle, const Keyframe&) { return handle == keyframe(19); };
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  ASSERT_FALSE(found_.empty());
  EXPECT_EQ(found_.front().keyframe, keyframe(20));
  for (const RetrievalCandidate& candidate : found_) {
    EXPECT_NE(candidate.keyframe, keyframe(19));
    EXPECT_NE(candidate.keyframe, keyframe(21));
  }
}

TEST_F(ExhaustiveRetrievalTest, KeyframeThatLeftTheAtlasIsSkipped) {
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  const RetrievalQuery query = QueryOf(20);
  const KeyframeHandle gone = keyframe(21);
  atlas_.RemoveKeyframe(gone, keyframe(22));
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  for (const RetrievalCandidate& candidate : found_) EXPECT_NE(candidate.keyframe, gone);
}

TEST_F(ExhaustiveRetrievalTest, BoundedQueryFindsTheViewItself) {
  ExhaustiveRetrieval all(colon_.config(), options_, colon_.device());
  AddAll(&all);
  RetrievalConfig bounded_options = options_;
  bounded_options.max_keyframes_per_query = 4;
  ExhaustiveRetrieval bounded(colon_.config(), bounded_options, colon_.device());
  AddAll(&bounded);
  std::vector<RetrievalCandidate> expected;
  for (int i = 0; i < 40; ++i) {
    RetrievalQuery query = QueryOf(i);
    query.is_excluded = nullptr;
    ASSERT_TRUE(all.Query(atlas_, query, &expected).ok());
    ASSERT_TRUE(bounded.Query(atlas_, query, &found_).ok());
    ASSERT_FALSE(expected.empty());
    ASSERT_FALSE(found_.empty()) << i;
    EXPECT_EQ(expected.front().keyframe, keyframe(i));
    EXPECT_EQ(found_.front().keyframe, keyframe(i));
    EXPECT_EQ(found_.front().num_votes, expected.front().num_votes) << i;
  }
}

TEST_F(ExhaustiveRetrievalTest, ExcludedAndRemovedKeyframesTakeNoPlaceOfTheBound) {
  options_.max_keyframes_per_query = 10;
  options_.min_votes = 0;
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  // Those that look most like the view.
  for (const int gone : {17, 20, 23}) retrieval.Remove(keyframe(gone));
  const std::set<KeyframeHandle> excluded = {keyframe(18), keyframe(19), keyframe(21), keyframe(22)};
  RetrievalQuery query = QueryOf(20);
  query.max_results = 100;
  query.is_excluded = [&](KeyframeHandle handle, const Keyframe&) { return excluded.contains(handle); };
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  EXPECT_EQ(found_.size(), 10u);
  for (const RetrievalCandidate& candidate : found_) {
    EXPECT_FALSE(excluded.contains(candidate.keyframe));
    for (const int gone : {17, 20, 23}) EXPECT_NE(candidate.keyframe, keyframe(gone));
  }
}

TEST_F(ExhaustiveRetrievalTest, BoundedQueryVotesOnNoMoreThanTheBound) {
  options_.max_keyframes_per_query = 15;
  options_.min_votes = 0;
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  RetrievalQuery query = QueryOf(20);
  query.max_results = 100;
  const auto calls = colon_.device().num_calls(ScriptedVisionDevice::Operation::kMatch);
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  EXPECT_EQ(colon_.device().num_calls(ScriptedVisionDevice::Operation::kMatch), calls + 15);
  EXPECT_EQ(found_.size(), 15u);
}

TEST_F(ExhaustiveRetrievalTest, VotersAreThoseWithAPointNow) {
  // A keyframe that had no points when it was added is found once it has some.
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  const MapHandle map = atlas_.CreateMap();
  const KeyframeHandle late = colon_.AddKeyframe(&atlas_, map, colon_.frames()[20].cam_from_world, Sim3{});
  ASSERT_TRUE(retrieval.Add(atlas_, late).ok());
  ASSERT_TRUE(retrieval.Query(atlas_, QueryOf(20), &found_).ok());
  EXPECT_TRUE(found_.empty());
  colon_.Link(&atlas_, static_cast<int>(colon_.frames().size()) - 1, 20, Sim3{});
  ASSERT_TRUE(retrieval.Query(atlas_, QueryOf(20), &found_).ok());
  ASSERT_EQ(found_.size(), 1u);
  EXPECT_EQ(found_.front().keyframe, late);
}

// As many as before, but other features.
TEST_F(ExhaustiveRetrievalTest, VotersFollowPointsThatGoWhileAsManyCome) {
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  const Keyframe& changed = atlas_.keyframe(keyframe(21));
  std::vector<std::int32_t> strongest;
  SelectStrongestWithPoint(changed, 40, &strongest);
  const std::vector<std::int32_t> with_point(strongest.begin(), strongest.begin() + 20);
  const std::vector<std::int32_t> without(strongest.begin() + 20, strongest.end());
  for (const std::int32_t feature : without) atlas_.RemovePoint(changed.points[feature]);
  VoteList votes(colon_.config(), options_, std::pmr::get_default_resource());
  ASSERT_TRUE(retrieval.Prepare(atlas_, QueryOf(20), &votes, &found_).ok());
  const int num_before = changed.num_points;
  for (const std::int32_t feature : with_point) atlas_.RemovePoint(changed.points[feature]);
  for (const std::int32_t feature : without) {
    ASSERT_TRUE(atlas_.AddObservation(atlas_.AddPoint(changed.map, {0, 0, 0}, 0), keyframe(21), feature));
  }
  ASSERT_EQ(changed.num_points, num_before) << "the number tells of the change: the test shows nothing";
  ASSERT_TRUE(retrieval.Prepare(atlas_, QueryOf(20), &votes, &found_).ok());
  const auto entry = std::find_if(votes.entries.begin(), votes.entries.end(),
                                  [&](const VoteList::Entry& each) { return each.keyframe == keyframe(21); });
  ASSERT_NE(entry, votes.entries.end());
  SelectStrongestWithPoint(changed, options_.max_descriptors, &strongest);
  const auto first = votes.features.begin() + entry->first;
  EXPECT_EQ(std::vector<std::int32_t>(first, first + entry->num), strongest);
}

TEST_F(ExhaustiveRetrievalTest, ReleasedFeatureSetIsNotAddedAndTakesNoRoom) {
  colon_.config().memory.max_keyframes = 1;
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  colon_.device().ReleaseFeatureSet(atlas_.keyframe(keyframe(0)).features.set);
  EXPECT_EQ(retrieval.Add(atlas_, keyframe(0)).code(), StatusCode::kInvalidArgument);
  EXPECT_TRUE(retrieval.Add(atlas_, keyframe(1)).ok());
}

TEST_F(ExhaustiveRetrievalTest, FeatureThatIsNotThereIsAnError) {
  options_.max_keyframes_per_query = 15;
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  AddAll(&retrieval);
  const std::int32_t strongest[] = {0, SyntheticColon::kMaxFeatures};
  RetrievalQuery query = QueryOf(0);
  query.strongest = strongest;
  EXPECT_EQ(retrieval.Query(atlas_, query, &found_).code(), StatusCode::kInvalidArgument);
  EXPECT_TRUE(found_.empty());
}

TEST_F(ExhaustiveRetrievalTest, TakesItsMemoryAtConstruction) {
  options_.max_keyframes_per_query = 15;
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  RetrievalQuery query = QueryOf(20);
  found_.reserve(100);
  if (!AllocationCounter::IsAvailable()) GTEST_SKIP() << "allocations cannot be counted here";
  const AllocationCounter allocations;
  for (int round = 0; round < 2; ++round) {
    for (int i = 0; i < 40; ++i) (void)retrieval.Add(atlas_, keyframe(i));
    (void)retrieval.Query(atlas_, query, &found_);
    for (int i = 0; i < 40; ++i) retrieval.Remove(keyframe(i));
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_FALSE(found_.empty());
}

TEST_F(ExhaustiveRetrievalTest, FailingDeviceGivesItsErrorAndNothing) {
  for (const auto point : {ScriptedVisionDevice::FailurePoint::kEnqueue, ScriptedVisionDevice::FailurePoint::kWait}) {
    ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
    AddAll(&retrieval);
    const auto calls = colon_.device().num_calls(ScriptedVisionDevice::Operation::kMatch);
    colon_.device().AddFailure(ScriptedVisionDevice::Operation::kMatch, calls + 20, point, StatusCode::kUnavailable);
    EXPECT_EQ(retrieval.Query(atlas_, QueryOf(20), &found_).code(), StatusCode::kUnavailable);
    EXPECT_TRUE(found_.empty());
    EXPECT_TRUE(retrieval.Query(atlas_, QueryOf(20), &found_).ok());
  }
}

TEST_F(ExhaustiveRetrievalTest, FullIndexRefuses) {
  colon_.config().memory.max_keyframes = 2;
  ExhaustiveRetrieval retrieval(colon_.config(), options_, colon_.device());
  EXPECT_TRUE(retrieval.Add(atlas_, keyframe(0)).ok());
  EXPECT_TRUE(retrieval.Add(atlas_, keyframe(1)).ok());
  EXPECT_EQ(retrieval.Add(atlas_, keyframe(2)).code(), StatusCode::kCapacityExceeded);
  retrieval.Remove(keyframe(0));
  EXPECT_TRUE(retrieval.Add(atlas_, keyframe(2)).ok());
}

}  // namespace
}  // namespace haustra::test
