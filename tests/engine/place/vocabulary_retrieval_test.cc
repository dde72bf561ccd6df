#include "engine/place/vocabulary_retrieval.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "engine/place/strongest_features.h"
#include "tests/engine/place/synthetic_colon.h"
#include "tests/engine/place/synthetic_words.h"
#include "tests/geometry/allocation_counter.h"

namespace haustra::test {
namespace {

class VocabularyRetrievalTest : public testing::Test {
 protected:
  static constexpr int kNumLandmarks = 4000;

  VocabularyRetrievalTest() : colon_(2), atlas_(colon_.MakeAtlas()), vocabulary_(LandmarkVocabulary(kNumLandmarks)) {
    colon_.AddWall(0.0, 14.0, kNumLandmarks);
    colon_.AddMap(&atlas_, 0.0, 10.0, 30, Sim3{});
  }

  const Keyframe& keyframe(int i) const { return atlas_.keyframe(colon_.frames()[i].keyframe); }

  // tf-idf of the strongest features, divided by its sum, in floating point.
  std::map<std::int32_t, double> BagOf(int i) {
    std::vector<std::uint8_t> descriptors(SyntheticColon::kMaxFeatures * kDescriptorBytes);
    EXPECT_TRUE(colon_.device().ReadDescriptors(keyframe(i).features.set, descriptors).ok());
    std::vector<std::int32_t> strongest;
    SelectStrongest(keyframe(i).features, options_.max_descriptors, &strongest);
    std::map<std::int32_t, double> bag;
    double total = 0.0;
    for (const std::int32_t feature : strongest) {
      const std::int32_t word = vocabulary_.WordOf(&descriptors[feature * std::size_t{kDescriptorBytes}]);
      bag[word] += vocabulary_.weight(word);
      total += vocabulary_.weight(word);
    }
    for (auto& [word, weight] : bag) weight /= total;
    return bag;
  }

  SyntheticColon colon_;
  Atlas atlas_;
  Vocabulary vocabulary_;
  RetrievalConfig options_;
  std::vector<std::int32_t> strongest_;
  std::vector<RetrievalCandidate> found_;
};

TEST_F(VocabularyRetrievalTest, ScoreIsOneLessHalfTheL1DistanceOfTheBags) {
  VocabularyRetrieval retrieval(colon_.config(), options_, colon_.device(), vocabulary_);
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(retrieval.Add(atlas_, colon_.frames()[i].keyframe).ok());
  SelectStrongest(keyframe(12).features, options_.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = keyframe(12).features.set;
  query.strongest = strongest_;
  query.max_results = 100;
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  ASSERT_GE(found_.size(), 5u);
  const std::map<std::int32_t, double> bag = BagOf(12);
  for (const RetrievalCandidate& candidate : found_) {
    const auto frame = std::find_if(colon_.frames().begin(), colon_.frames().end(),
                                    [&](const SyntheticColon::Frame& f) { return f.keyframe == candidate.keyframe; });
    std::map<std::int32_t, double> other = BagOf(static_cast<int>(frame - colon_.frames().begin()));
    double distance = 0.0;
    int num_common = 0;
    for (const auto& [word, share] : bag) {
      num_common += other.contains(word) ? 1 : 0;
      distance += std::abs(share - other[word]);
    }
    for (const auto& [word, share] : other) distance += bag.contains(word) ? 0.0 : share;
    EXPECT_NEAR(candidate.score, 1.0 - distance / 2.0, 1e-4);
    EXPECT_EQ(candidate.num_votes, num_common);
  }
}

TEST_F(VocabularyRetrievalTest, FewerWordsInCommonThanMinVotesAreChance) {
  VocabularyRetrieval retrieval(colon_.config(), options_, colon_.device(), vocabulary_);
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(retrieval.Add(atlas_, colon_.frames()[i].keyframe).ok());
  SelectStrongest(keyframe(12).features, options_.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = keyframe(12).features.set;
  query.strongest = strongest_;
  query.max_results = 100;
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  std::vector<int> votes;
  for (const RetrievalCandidate& candidate : found_) votes.push_back(candidate.num_votes);
  std::sort(votes.begin(), votes.end());
  options_.min_votes = votes[votes.size() / 2];
  ASSERT_GT(options_.min_votes, votes.front());
  ASSERT_TRUE(retrieval.Query(atlas_, query, &found_).ok());
  const auto num_enough = votes.end() - std::lower_bound(votes.begin(), votes.end(), options_.min_votes);
  EXPECT_EQ(static_cast<std::ptrdiff_t>(found_.size()), num_enough);
  for (const RetrievalCandidate& candidate : found_) EXPECT_GE(candidate.num_votes, options_.min_votes);
}

TEST_F(VocabularyRetrievalTest, FeatureThatIsNotThereIsAnError) {
  VocabularyRetrieval retrieval(colon_.config(), options_, colon_.device(), vocabulary_);
  const std::int32_t strongest[] = {0, SyntheticColon::kMaxFeatures};
  RetrievalQuery query;
  query.set = keyframe(0).features.set;
  query.strongest = strongest;
  EXPECT_EQ(retrieval.Query(atlas_, query, &found_).code(), StatusCode::kInvalidArgument);
}

TEST_F(VocabularyRetrievalTest, ReleasedFeatureSetIsNotAddedAndTakesNoRoom) {
  colon_.config().memory.max_keyframes = 1;
  VocabularyRetrieval retrieval(colon_.config(), options_, colon_.device(), vocabulary_);
  colon_.device().ReleaseFeatureSet(keyframe(0).features.set);
  EXPECT_EQ(retrieval.Add(atlas_, colon_.frames()[0].keyframe).code(), StatusCode::kInvalidArgument);
  EXPECT_TRUE(retrieval.Add(atlas_, colon_.frames()[1].keyframe).ok());
}

TEST_F(VocabularyRetrievalTest, TakesItsMemoryAtConstruction) {
  VocabularyRetrieval retrieval(colon_.config(), options_, colon_.device(), vocabulary_);
  SelectStrongest(keyframe(12).features, options_.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = keyframe(12).features.set;
  query.strongest = strongest_;
  found_.reserve(100);
  if (!AllocationCounter::IsAvailable()) GTEST_SKIP() << "allocations cannot be counted here";
  const AllocationCounter allocations;
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 30; ++i) (void)retrieval.Add(atlas_, colon_.frames()[i].keyframe);
    (void)retrieval.Query(atlas_, query, &found_);
    for (int i = 0; i < 30; ++i) retrieval.Remove(colon_.frames()[i].keyframe);
  }
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_FALSE(found_.empty());
}

}  // namespace
}  // namespace haustra::test
