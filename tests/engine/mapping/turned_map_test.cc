// A young map that is built anew while the mapper takes in a keyframe, and what becomes of all that knows its shape.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/depth/depth_keeper.h"
#include "engine/geometry/constants.h"
#include "engine/mapping/keyframe_inserter.h"
#include "engine/place/make_retrieval.h"
#include "tests/engine/mapping/mirrored_map.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

class TurnedMapTest : public testing::Test {
 protected:
  // Of the map; the two views after them are proposed.
  static constexpr int kNum = MirroredMap::kStraight;

  TurnedMapTest() {
    EngineConfig& config = scene_.colon.config();
    config.depth.kept_pictures = kNum;
    config.depth.newer_keyframes = 0;
    config.mapping.redundant_share = 1.0;  // none is culled
    inserter_.emplace(state_,
                      KeyframeInserter::Parts{publisher_, *retrieval_, evictor_, trial_, bundle_, adjuster_, marks_});
    state_.active = scene_.Make(&state_.atlas);
    state_.newest = scene_.keyframe(kNum - 1);
    constexpr LocalBundle::Extent kAll{MirroredMap::kNumViews, true, 100};
    EXPECT_TRUE(bundle_.Adjust(scene_.keyframe(kNum), kAll, {}, &state_.atlas).ok());
    for (const int view : {kNum, kNum + 1}) {
      const KeyframeHandle keyframe = scene_.keyframe(view);
      proposed_.push_back(state_.atlas.keyframe(keyframe).cam_from_map);
      scene_.colon.device().ReleaseFeatureSet(state_.atlas.RemoveKeyframe(keyframe, state_.newest));
    }
    const CameraModel& camera = scene_.colon.camera();
    const int step_px = config.depth.step_px;
    pictures_.emplace(kHandedPictures, std::pmr::get_default_resource(), camera.width_px(), camera.height_px(),
                      std::pmr::get_default_resource());
    mailbox_ = std::make_unique<DepthMailbox>(camera.width_px() / step_px, camera.height_px() / step_px,
                                              config.features.max, std::pmr::get_default_resource());
    depths_.emplace(config, camera, state_.atlas, *pictures_, *mailbox_, std::pmr::get_default_resource());
    publisher_.Publish();
  }

  // What tracking proposes: a view, where it has it, with the points that it has found there.
  KeyframeHandle Insert(int view, const SE3& cam_from_map, std::uint64_t num_reframings_heard) {
    KeyframeProposal proposal(SyntheticColon::kMaxFeatures, 0);
    const SyntheticColon::Sight sight = scene_.colon.Look(MirroredMap::View(view));
    proposal.view.frame_index = static_cast<std::uint32_t>(view);
    proposal.view.features = sight.features;
    proposal.map_id = state_.atlas.map(state_.active).id;
    proposal.cam_from_map = cam_from_map;
    proposal.num_reframings_heard = num_reframings_heard;
    std::map<int, MapPointHandle> points;
    for (int i = 0; i < kNum; ++i) {
      const Keyframe& keyframe = state_.atlas.keyframe(scene_.keyframe(i));
      const std::vector<int>& landmarks = scene_.colon.frames()[static_cast<std::size_t>(i)].landmarks;
      for (std::size_t f = 0; f < landmarks.size(); ++f) {
        if (keyframe.points[f]) points[landmarks[f]] = keyframe.points[f];
      }
    }
    for (std::size_t f = 0; f < sight.landmarks.size(); ++f) {
      const auto found = points.find(sight.landmarks[f]);
      if (found != points.end()) proposal.points[f] = found->second;
    }
    const KeyframeHandle keyframe = inserter_->Insert(proposal);
    EXPECT_EQ(CheckInvariants(state_.atlas).ToString(), "ok");
    return keyframe;
  }
  KeyframeHandle InsertTheFirst() { return Insert(kNum, proposed_[0], 0); }

  // How far it is turned from where it truly stands beside the view that is straight, in degrees.
  double Error(int view, KeyframeHandle keyframe) const {
    const SE3 now = state_.atlas.keyframe(keyframe).cam_from_map * proposed_[0].Inverse();
    return now.rotation.angularDistance(MirroredMap::View(view).rotation) / kDegree;
  }

  void Answer(std::uint32_t frame_index, std::uint64_t map_epoch) {
    AnsweredFrame answered;
    answered.frame_index = frame_index;
    answered.map_epoch = map_epoch;
    answered.reference_keyframe = state_.atlas.keyframe(scene_.keyframe(0)).id;
    link_.Answer(answered);
  }
  // In a frame that stands where the first keyframe does, at the feature of that number.
  Result<MarkId> Mark(std::uint32_t frame_index, int feature, const char* label) {
    const Eigen::Vector2d pixel = state_.atlas.keyframe(scene_.keyframe(0)).features.pixel(feature);
    return marks_.Set({frame_index, pixel, MarkLabel::From(label).value()});
  }
  // Of the first keyframe, near the middle of the wall: where the wall is farthest from its mirror.
  int FeatureThatMoves() const {
    const auto& frame = scene_.colon.frames().front();
    const Keyframe& keyframe = state_.atlas.keyframe(frame.keyframe);
    int best = -1;
    double most = 0.0;
    for (int f = 0; f < keyframe.features.num; ++f) {
      const Eigen::Vector3d& truth = scene_.colon.landmark(frame.landmarks[static_cast<std::size_t>(f)]).position;
      const double height = std::abs(truth.z() - MirroredMap::kDistance);
      if (!keyframe.points[f] || truth.head<2>().norm() > 0.15 || height <= most) continue;
      most = height;
      best = f;
    }
    return best;
  }

  void HandPicture(std::uint32_t frame_index) {
    const int width = scene_.colon.camera().width_px(), height = scene_.colon.camera().height_px();
    const std::vector<std::uint8_t> pixels(std::size_t(3) * width * height, 90);
    Frame frame;
    frame.index = frame_index;
    frame.image = {pixels.data(), width, height, std::ptrdiff_t{3} * width, PixelFormat::kBgr8};
    ASSERT_TRUE(pictures_->BeginPush()->Copy(frame));
    pictures_->CommitPush();
    WorkOnDepths();
  }
  void WorkOnDepths() {
    while (depths_->Step()) {
    }
  }

  MirroredMap scene_{3};
  TrackingLink link_{scene_.colon.config()};
  PlaceMailbox places_{scene_.colon.config(), std::pmr::get_default_resource()};
  SceneRegion region_{scene_.colon.camera(), {}};
  MappingState state_{
      scene_.colon.config(),           scene_.colon.camera(), region_, scene_.colon.device(), link_, nullptr, false,
      std::pmr::get_default_resource()};
  SnapshotPublisher publisher_{state_, places_};
  std::unique_ptr<KeyframeRetrieval> retrieval_ = MakeRetrieval(scene_.colon.config(), scene_.colon.device(), nullptr);
  Evictor evictor_{scene_.colon.config(), state_.atlas, *retrieval_,
                   [this](FeatureSetHandle set) { publisher_.Retire(set); }, [](MapHandle) {}};
  PointTrial trial_{scene_.colon.config().mapping};
  SchurBundleAdjuster adjuster_;
  LocalBundle bundle_{scene_.colon.config(), state_.noise, scene_.colon.camera(), adjuster_};
  MarkKeeper marks_{state_};
  std::optional<KeyframeInserter> inserter_;
  std::vector<SE3> proposed_;  // poses in the mirror
  std::optional<PictureRing> pictures_;
  std::unique_ptr<DepthMailbox> mailbox_;
  std::optional<DepthKeeper> depths_;
};

TEST_F(TurnedMapTest, ItsKeyframesGoWhereTheyTrulyStandAndTrackingHearsOfIt) {
  for (int i = 0; i < kNum; ++i) ASSERT_GT(Error(i, scene_.keyframe(i)), 10.0) << i;
  const KeyframeHandle last = InsertTheFirst();
  ASSERT_TRUE(last);
  EXPECT_EQ(state_.counters.num_reliefs_turned, 1u);
  EXPECT_EQ(state_.newest, last);
  EXPECT_LT(Error(kNum, last), 1.0);
  for (int i = 0; i < kNum; ++i) {
    EXPECT_LT(Error(i, scene_.keyframe(i)), 1.0) << i;
    EXPECT_EQ(state_.atlas.keyframe(scene_.keyframe(i)).turned_at, 1u) << i;
  }
  EXPECT_EQ(state_.atlas.keyframe(last).turned_at, 1u);
  const VersionedReply* reply = link_.replies.Front();
  ASSERT_NE(reply, nullptr);
  const auto* reframing = std::get_if<Reframing>(&reply->reply);
  ASSERT_NE(reframing, nullptr);
  EXPECT_FALSE(reframing->keeps_shape);
  EXPECT_EQ(reframing->old_map_id, state_.atlas.map(state_.active).id);
  EXPECT_EQ(reframing->new_map_id, reframing->old_map_id);
}

TEST_F(TurnedMapTest, ItsDepthIsForgottenAndSearchedAgain) {
  for (int i = 0; i < kNum && mailbox_->Asked() == nullptr; ++i) HandPicture(static_cast<std::uint32_t>(i));
  ASSERT_NE(mailbox_->Asked(), nullptr);
  const KeyframeHandle asked = mailbox_->Asked()->keyframe;
  mailbox_->Asked()->depth.Clear(0.1);
  mailbox_->Asked()->status = Status::Ok();
  mailbox_->Answer();
  WorkOnDepths();
  ASSERT_NE(depths_->DepthOf(asked), nullptr);
  ASSERT_TRUE(InsertTheFirst());
  EXPECT_EQ(depths_->DepthOf(asked), nullptr);
  // Others may be asked about first.
  for (int i = 0; i <= kNum && depths_->DepthOf(asked) == nullptr; ++i) {
    WorkOnDepths();
    ASSERT_NE(mailbox_->Asked(), nullptr);
    mailbox_->Answer();
    WorkOnDepths();
  }
  EXPECT_NE(depths_->DepthOf(asked), nullptr);
}

TEST_F(TurnedMapTest, ItsMarksGoToTheWall) {
  RecordProperty("req", "MRK-001");
  Answer(3, 0);
  const int feature = FeatureThatMoves();
  ASSERT_GE(feature, 0);
  const Result<MarkId> set = Mark(3, feature, "polyp");
  ASSERT_TRUE(set.ok()) << set.status().ToString();
  const auto place = [&] {
    return state_.atlas.PlaceOf(state_.atlas.marks().At(state_.atlas.FindMark("polyp"))).position;
  };
  const MapPointHandle point = state_.atlas.keyframe(scene_.keyframe(0)).points[feature];
  const Eigen::Vector3d before = place();
  EXPECT_LT((before - state_.atlas.point(point).position).norm(), 0.03) << "on the mirror of the wall";
  ASSERT_TRUE(InsertTheFirst());
  EXPECT_GT((place() - before).norm(), 0.04);
  ASSERT_NE(state_.atlas.GetPoint(point), nullptr);
  EXPECT_LT((place() - state_.atlas.point(point).position).norm(), 0.02);
}

TEST_F(TurnedMapTest, FramesOfBeforeAreNotMarkedAnyMore) {
  ASSERT_TRUE(InsertTheFirst());
  Answer(3, 0);
  Answer(4, 1);
  const int feature = FeatureThatMoves();
  EXPECT_THAT(Mark(3, feature, "before").status().message(), HasSubstr("its map has taken another shape since"));
  const Result<MarkId> set = Mark(4, feature, "after");
  EXPECT_TRUE(set.ok()) << set.status().ToString();
}

// Where it stood is known of the former shape only. The same view comes again with a pose of the new one.
// What stands in for their keyframe came after the map was built anew, and was never turned itself.
TEST_F(TurnedMapTest, FramesOfBeforeAreNotMarkedWhereALaterKeyframeStandsIn) {
  const Keyframe& first = state_.atlas.keyframe(scene_.keyframe(0));
  const Eigen::Vector2d pixel = first.features.pixel(FeatureThatMoves());
  Answer(3, 0);
  Answer(4, 1);
  ASSERT_TRUE(InsertTheFirst());
  const KeyframeHandle later = Insert(kNum + 1, first.cam_from_map, 1);
  ASSERT_TRUE(later);
  ASSERT_EQ(state_.atlas.keyframe(later).turned_at, 0u);
  publisher_.Retire(state_.atlas.RemoveKeyframe(scene_.keyframe(0), later));
  const auto mark = [&](std::uint32_t frame_index, const char* label) {
    return marks_.Set({frame_index, pixel, MarkLabel::From(label).value()});
  };
  EXPECT_THAT(mark(3, "before").status().message(), HasSubstr("its map has taken another shape since"));
  const Result<MarkId> after = mark(4, "after");
  EXPECT_TRUE(after.ok()) << after.status().ToString();
}

TEST_F(TurnedMapTest, KeyframeThatWasProposedBeforeIsRefused) {
  ASSERT_TRUE(InsertTheFirst());
  const int num_free = scene_.colon.device().num_free_feature_sets();
  EXPECT_FALSE(Insert(kNum + 1, proposed_[1], 0));
  EXPECT_EQ(scene_.colon.device().num_free_feature_sets(), num_free);
  const KeyframeHandle next = Insert(kNum + 1, MirroredMap::View(kNum + 1) * proposed_[0], 1);
  ASSERT_TRUE(next);
  EXPECT_LT(Error(kNum + 1, next), 1.0);
  EXPECT_EQ(state_.counters.num_reliefs_turned, 1u);
}

}  // namespace
}  // namespace haustra::test
