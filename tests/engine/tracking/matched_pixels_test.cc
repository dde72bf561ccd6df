// Where the tracker says that it has found points of the map in a frame: what a viewer draws.
#include <gtest/gtest.h>

#include "engine/mapping/mapper.h"
#include "engine/tracking/tracker.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

class MatchedPixelsTest : public testing::Test {
 protected:
  MatchedPixelsTest()
      : link_(config_),
        places_(config_, std::pmr::get_default_resource()),
        mapper_(config_, colon_.camera(), colon_.device(), link_, places_, nullptr, false, nullptr),
        tracker_(config_, colon_.camera(), colon_.device(), link_, nullptr, 1.0) {
    colon_.config().merging.enabled = false;
    colon_.Move(0.0, 3.0, 100);
  }

  FrameResult TrackNext() {
    const Result<Frame> frame = colon_.source().Next(kNoDeadline);
    EXPECT_TRUE(frame.ok());
    const FrameResult result = tracker_.Track(*frame, kNoDeadline);
    while (mapper_.Step()) continue;
    return result;
  }

  ScriptedColon colon_;
  const EngineConfig& config_ = colon_.config();
  TrackingLink link_;
  PlaceMailbox places_;
  Mapper mapper_;
  Tracker tracker_;
  std::vector<Eigen::Vector2f> pixels_ = std::vector<Eigen::Vector2f>(8000);
};

TEST_F(MatchedPixelsTest, AreThoseThatAgreeWithThePose) {
  EXPECT_EQ(tracker_.MatchedPixels(pixels_), 0u) << "nothing was tracked";
  const CameraCalibration& camera = colon_.camera().calibration();
  int num_tracked = 0;
  for (int i = 0; i < 60; ++i) {
    const FrameResult result = TrackNext();
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
  for (int i = 0; i < 60; ++i) TrackNext();
  const std::size_t all = tracker_.MatchedPixels(pixels_);
  ASSERT_GT(all, 20u);
  std::vector<Eigen::Vector2f> few(10);
  ASSERT_EQ(tracker_.MatchedPixels(few), 10u);
  for (std::size_t k = 0; k < 10; ++k) EXPECT_EQ(few[k], pixels_[k * all / 10]);
  EXPECT_EQ(tracker_.MatchedPixels({}), 0u);
}

}  // namespace
}  // namespace haustra::test
