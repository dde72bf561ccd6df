// Where the tracker says that it has found points of the map in a frame: what a viewer draws.
#include "tests/engine/tracking/tracker_with_mapper.h"

namespace haustra::test {
namespace {

class MatchedPixelsTest : public TrackerWithMapper {
 protected:
  std::vector<Eigen::Vector2f> pixels_ = std::vector<Eigen::Vector2f>(8000);
};

TEST_F(MatchedPixelsTest, AreThoseThatAgreeWithThePose) {
  EXPECT_EQ(tracker_.MatchedPixels(pixels_), 0u) << "nothing was tracked";
  const CameraCalibration& camera = colon_.camera().calibration();
  int num_tracked = 0;
  for (int i = 0; i < 60; ++i) {
    const FrameResult result = TrackAndMap(1);
    const std::size_t count = tracker_.MatchedPixels(pixels_);
    if (result.state != TrackingState::kTracking) {
      EXPECT_EQ(count, 0u) << "frame " << i << " has no pose";
      continue;
    }
    ++num_tracked;
    ASSERT_EQ(count, static_cast<std::size_t>(result.num_inliers));
    for (std::size_t k = 0; k < count; ++k) {
      EXPECT_GE(pixels_[k].minCoeff(), 0.0F);
      EXPECT_LT(pixels_[k].x(), static_cast<float>(camera.width_px));
      EXPECT_LT(pixels_[k].y(), static_cast<float>(camera.height_px));
    }
  }
  EXPECT_GT(num_tracked, 20);
}

TEST_F(MatchedPixelsTest, OfMoreThanThereIsRoomForComesAnEvenSelection) {
  TrackAndMap(60);
  const std::size_t all = tracker_.MatchedPixels(pixels_);
  ASSERT_GT(all, 20u);
  std::vector<Eigen::Vector2f> few(10);
  ASSERT_EQ(tracker_.MatchedPixels(few), 10u);
  for (std::size_t k = 0; k < 10; ++k) EXPECT_EQ(few[k], pixels_[k * all / 10]);
  EXPECT_EQ(tracker_.MatchedPixels({}), 0u);
}

TEST_F(MatchedPixelsTest, ADamagedFrameShowsNone) {
  const FrameResult last = TrackAndMap(60);
  ASSERT_GT(tracker_.MatchedPixels(pixels_), 20u);
  (void)tracker_.SkipDamaged(last.frame_index + 1, last.timestamp);
  EXPECT_EQ(tracker_.MatchedPixels(pixels_), 0u);
}

}  // namespace
}  // namespace haustra::test
