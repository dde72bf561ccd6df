// What every KeyframeRetrieval must keep (engine/place/retrieval.h), on each implementation.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "engine/place/make_retrieval.h"
#include "engine/place/strongest_features.h"
#include "tests/engine/place/synthetic_colon.h"
#include "tests/engine/place/synthetic_words.h"

namespace haustra::test {
namespace {

class RetrievalContractTest : public testing::TestWithParam<const char*> {
 protected:
  static constexpr int kNumLandmarks = 4000;

  RetrievalContractTest() : colon_(1), atlas_(colon_.MakeAtlas()), vocabulary_(LandmarkVocabulary(kNumLandmarks)) {
    colon_.config().place.retrieval.kind = GetParam();
    colon_.AddWall(0.0, 14.0, kNumLandmarks);
    colon_.AddMap(&atlas_, 0.0, 10.0, 40, Sim3{});
  }

  std::unique_ptr<KeyframeRetrieval> Make() { return MakeRetrieval(colon_.config(), colon_.device(), &vocabulary_); }
  std::unique_ptr<KeyframeRetrieval> MakeFull() {
    std::unique_ptr<KeyframeRetrieval> retrieval = Make();
    for (const SyntheticColon::Frame& frame : colon_.frames()) {
      EXPECT_TRUE(retrieval->Add(atlas_, frame.keyframe).ok());
    }
    return retrieval;
  }
  KeyframeHandle keyframe(int i) const { return colon_.frames()[i].keyframe; }
  KeyframeId id(KeyframeHandle handle) const { return atlas_.keyframe(handle).id; }

  RetrievalQuery QueryOf(int i) {
    SelectStrongestWithPoint(atlas_.keyframe(keyframe(i)), 256, &strongest_);
    RetrievalQuery query;
    query.set = atlas_.keyframe(keyframe(i)).features.set;
    query.strongest = strongest_;
    return query;
  }
  bool IsFound(KeyframeHandle handle) const {
    return std::any_of(found_.begin(), found_.end(), [&](const auto& c) { return c.keyframe == handle; });
  }

  SyntheticColon colon_;
  Atlas atlas_;
  Vocabulary vocabulary_;
  std::vector<std::int32_t> strongest_;
  std::vector<RetrievalCandidate> found_;
};

TEST_P(RetrievalContractTest, ViewFindsItselfThenItsNeighbours) {
  const auto retrieval = MakeFull();
  for (const int i : {5, 20, 33}) {
    ASSERT_TRUE(retrieval->Query(atlas_, QueryOf(i), &found_).ok());
    ASSERT_GE(found_.size(), 3u);
    EXPECT_EQ(found_[0].keyframe, keyframe(i));
    for (int k = 1; k < 3; ++k) {
      EXPECT_LE(std::abs(static_cast<int>(id(found_[k].keyframe)) - static_cast<int>(id(keyframe(i)))), 2);
    }
  }
}

TEST_P(RetrievalContractTest, BestComeFirstAndScoresAreShares) {
  const auto retrieval = MakeFull();
  RetrievalQuery query = QueryOf(20);
  query.max_results = 100;
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  for (std::size_t i = 0; i < found_.size(); ++i) {
    EXPECT_GT(found_[i].score, 0.0);
    EXPECT_LE(found_[i].score, 1.0);
    EXPECT_GE(found_[i].num_votes, colon_.config().place.retrieval.min_votes);
    EXPECT_GE(found_[i == 0 ? 0 : i - 1].score, found_[i].score);
  }
}

TEST_P(RetrievalContractTest, NoMoreResultsThanAskedFor) {
  const auto retrieval = MakeFull();
  RetrievalQuery query = QueryOf(20);
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  const std::vector<RetrievalCandidate> ten = found_;
  query.max_results = 2;
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  ASSERT_EQ(found_.size(), 2u);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(found_[i].keyframe, ten[i].keyframe);
}

TEST_P(RetrievalContractTest, TiesGoToTheOlder) {
  // The same view three times: the scores are equal to the last bit.
  const MapHandle map = atlas_.CreateMap();
  const SE3 pose = colon_.frames()[20].cam_from_world;
  std::vector<KeyframeHandle> twins;
  const FrameFeatures features = atlas_.keyframe(keyframe(20)).features;
  std::vector<std::uint8_t> descriptors(SyntheticColon::kMaxFeatures * kDescriptorBytes);
  ASSERT_TRUE(colon_.device().ReadDescriptors(features.set, descriptors).ok());
  for (int i = 0; i < 3; ++i) {
    FrameFeatures copy = features;
    copy.set = colon_.device().CreateFeatureSet().value();
    ASSERT_TRUE(colon_.device()
                    .WriteFeatures(copy.set, std::span(features.keypoints).first(features.num),
                                   std::span(descriptors).first(features.num * std::size_t{kDescriptorBytes}))
                    .ok());
    twins.push_back(atlas_.AddKeyframe(map, 100 + i, TimePoint{}, pose, copy));
  }
  for (std::int32_t feature = 0; feature < features.num; ++feature) {
    const MapPointHandle point = atlas_.AddPoint(map, Eigen::Vector3d::UnitZ(), id(twins[0]));
    for (const KeyframeHandle twin : twins) atlas_.AddObservation(point, twin, feature);
  }
  const auto retrieval = Make();
  for (const int i : {2, 0, 1}) ASSERT_TRUE(retrieval->Add(atlas_, twins[i]).ok());
  ASSERT_TRUE(retrieval->Query(atlas_, QueryOf(20), &found_).ok());
  ASSERT_EQ(found_.size(), 3u);
  EXPECT_EQ(found_[0].score, found_[2].score);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(found_[i].keyframe, twins[i]);
}

TEST_P(RetrievalContractTest, ExcludedAndRemovedKeyframesAreNotFound) {
  const auto retrieval = MakeFull();
  retrieval->Remove(keyframe(21));
  retrieval->Remove(keyframe(21));  // the second time nothing happens
  RetrievalQuery query = QueryOf(20);
  query.is_excluded = [&](KeyframeHandle handle, const Keyframe&) { return handle == keyframe(19); };
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  EXPECT_TRUE(IsFound(keyframe(20)));
  EXPECT_FALSE(IsFound(keyframe(19)));
  EXPECT_FALSE(IsFound(keyframe(21)));
}

TEST_P(RetrievalContractTest, KeyframeThatLeftTheAtlasIsSkipped) {
  const auto retrieval = MakeFull();
  const KeyframeHandle gone = keyframe(21);
  const RetrievalQuery query = QueryOf(20);
  atlas_.RemoveKeyframe(gone, keyframe(22));
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  EXPECT_FALSE(found_.empty());
  EXPECT_FALSE(IsFound(gone));
}

TEST_P(RetrievalContractTest, OneThatIsNotInTheAtlasIsRefused) {
  const auto retrieval = Make();
  EXPECT_EQ(retrieval->Add(atlas_, KeyframeHandle{}).code(), StatusCode::kInvalidArgument);
}

TEST_P(RetrievalContractTest, ViewThatTheDeviceDoesNotKnowGivesItsErrorAndNothing) {
  const auto retrieval = MakeFull();
  RetrievalQuery query = QueryOf(20);
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  query.set = FeatureSetHandle{};
  EXPECT_EQ(retrieval->Query(atlas_, query, &found_).code(), StatusCode::kInvalidArgument);
  EXPECT_TRUE(found_.empty());
}

TEST_P(RetrievalContractTest, FullRetrievalRefusesUntilOneLeaves) {
  colon_.config().memory.max_keyframes = 2;
  const auto retrieval = Make();
  EXPECT_TRUE(retrieval->Add(atlas_, keyframe(19)).ok());
  EXPECT_TRUE(retrieval->Add(atlas_, keyframe(20)).ok());
  EXPECT_EQ(retrieval->Add(atlas_, keyframe(21)).code(), StatusCode::kCapacityExceeded);
  retrieval->Remove(keyframe(19));
  EXPECT_TRUE(retrieval->Add(atlas_, keyframe(21)).ok());
  ASSERT_TRUE(retrieval->Query(atlas_, QueryOf(20), &found_).ok());
  ASSERT_EQ(found_.size(), 2u);
  EXPECT_EQ(found_[0].keyframe, keyframe(20));
  EXPECT_EQ(found_[1].keyframe, keyframe(21));
}

TEST_P(RetrievalContractTest, EmptyRetrievalAndEmptyViewFindNothing) {
  const auto empty = Make();
  ASSERT_TRUE(empty->Query(atlas_, QueryOf(20), &found_).ok());
  EXPECT_TRUE(found_.empty());
  const auto retrieval = MakeFull();
  RetrievalQuery query = QueryOf(20);
  query.strongest = {};
  ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
  EXPECT_TRUE(found_.empty());
}

// Keyframes come and go in any order: what is found depends on those that are there alone, and repeats.
TEST_P(RetrievalContractTest, HistoryDoesNotMatter) {
  const auto retrieval = Make();
  Rng rng(5);
  std::vector<bool> is_there(colon_.frames().size(), false);
  for (int step = 0; step < 600; ++step) {
    const auto i = rng.UniformInt(static_cast<std::uint32_t>(is_there.size()));
    if (is_there[i]) {
      retrieval->Remove(keyframe(static_cast<int>(i)));
    } else {
      ASSERT_TRUE(retrieval->Add(atlas_, keyframe(static_cast<int>(i))).ok());
    }
    is_there[i] = !is_there[i];
  }
  const auto fresh = Make();
  for (std::size_t i = 0; i < is_there.size(); ++i) {
    if (!is_there[i]) continue;
    ASSERT_TRUE(fresh->Add(atlas_, keyframe(static_cast<int>(i))).ok());
  }
  std::vector<RetrievalCandidate> expected;
  for (int i = 0; i < static_cast<int>(is_there.size()); ++i) {
    RetrievalQuery query = QueryOf(i);
    query.max_results = 100;
    ASSERT_TRUE(retrieval->Query(atlas_, query, &found_).ok());
    ASSERT_TRUE(fresh->Query(atlas_, query, &expected).ok());
    ASSERT_EQ(found_.size(), expected.size());
    for (std::size_t k = 0; k < found_.size(); ++k) {
      EXPECT_EQ(found_[k].keyframe, expected[k].keyframe);
      EXPECT_EQ(found_[k].score, expected[k].score);
      EXPECT_EQ(found_[k].num_votes, expected[k].num_votes);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, RetrievalContractTest, testing::Values("exhaustive", "vocabulary"),
                         [](const auto& kind) { return std::string(kind.param); });

}  // namespace
}  // namespace haustra::test
