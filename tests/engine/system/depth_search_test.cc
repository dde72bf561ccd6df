// The engine and the matcher that it is lent.
#include <gtest/gtest.h>

#include <vector>

#include "engine/surface/depth_matcher.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

// It outlives the engine, and may serve somebody else then: nothing of the engine stops it any more.
TEST(DepthSearch, AMatcherIsFreeWhenItsEngineHasGone) {
  const EngineConfig config = QuickDepthConfig();
  ScriptedColon colon(TimePoint{}, config);
  const CameraModel& camera = colon.camera();
  DepthMatcher matcher(camera, ImageView{}, config.depth.options());
  const std::vector<std::uint8_t> pixels(std::size_t(camera.width_px()) * camera.height_px(), 100);
  const DepthView view{{pixels.data(), camera.width_px(), camera.height_px(), camera.width_px(), PixelFormat::kGrey8},
                       SE3()};
  std::vector<DepthSeed> seeds(DepthMatcher::kMinSeeds);
  for (DepthSeed& seed : seeds) seed.inverse_range = 0.5 + 0.1 * static_cast<double>(&seed - seeds.data());
  DepthMap depth(matcher.width(), matcher.height());
  const auto match = [&] { return matcher.Match(view, {&view, 1}, seeds, &depth).code(); };
  {
    Engine engine(config, camera, colon.device(), Engine::Mode::kSequential, nullptr, ImageView{}, nullptr, &matcher);
    EXPECT_EQ(match(), StatusCode::kOk);
    engine.StopDepth(true);
    EXPECT_EQ(match(), StatusCode::kCancelled);
  }
  EXPECT_EQ(match(), StatusCode::kOk);
}

// One thread does all in turn: it is not caught by a search that is asked again and again.
TEST(DepthSearch, NothingIsLeftToDoWhileItIsStopped) {
  const EngineConfig config = QuickDepthConfig();
  ScriptedColon colon(TimePoint{}, config);
  colon.Move(0.0, 3.0, 60);
  DepthMatcher matcher(colon.camera(), ImageView{}, config.depth.options());
  Engine engine(config, colon.camera(), colon.device(), Engine::Mode::kSequential, nullptr, ImageView{}, nullptr,
                &matcher);
  engine.StopDepth(true);
  constexpr int kManySteps = 1000;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    engine.KeepPicture(*frame, engine.Track(*frame, kNoDeadline));
    int num_steps = 0;
    while (num_steps < kManySteps && engine.BackgroundStep()) ++num_steps;
    ASSERT_LT(num_steps, kManySteps) << frame->index;
  }
  EXPECT_TRUE(engine.has_depth_work()) << "it waits";
  EXPECT_EQ(engine.depths()->counters().num_depths, 0u);
  engine.StopDepth(false);
  engine.FinishDepth(kNeverStop);
  EXPECT_GT(engine.depths()->counters().num_depths, 0u);
}

}  // namespace
}  // namespace haustra::test
