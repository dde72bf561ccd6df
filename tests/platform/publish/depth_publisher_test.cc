// An atlas with depths, and what the depth table says of it.
#include "platform/publish/depth_publisher.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <map>
#include <memory>
#include <vector>

#include "engine/surface/depth_matcher.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

// Publishes between the frames, as a procedure does.
class PublishingHooks final : public SessionHooks {
 public:
  PublishingHooks(Engine& engine, DepthPublisher& publisher) : engine_(engine), publisher_(publisher) {}
  void OnTracked(const FrameOutcome&) override { publisher_.Publish(engine_); }

 private:
  Engine& engine_;
  DepthPublisher& publisher_;
};

class DepthPublisherTest : public testing::Test {
 protected:
  DepthPublisherTest() : path_(testing::TempDir() + "haustra_depth_publisher_" + std::to_string(::getpid())) {
    config_.depth.enabled = true;
    config_.depth.step_px = 8;
    config_.depth.iterations = 1;
    config_.depth.newer_keyframes = 1;
  }
  ~DepthPublisherTest() override { haustra_depth_close(&table_); }

  // Every keyframe as the atlas has it, and nothing else.
  void ExpectTableIs(const Engine& engine) {
    std::map<std::uint32_t, haustra_depth_keyframe> published;
    for (std::uint32_t slot = 0; slot < table_.num_slots; ++slot) {
      haustra_depth_keyframe keyframe;
      if (haustra_depth_read_keyframe(&table_, slot, &keyframe) != HAUSTRA_OK) continue;
      EXPECT_TRUE(published.emplace(keyframe.keyframe_id, keyframe).second);
      slots_[keyframe.keyframe_id] = slot;
    }
    const Atlas& atlas = engine.atlas();
    EXPECT_EQ(published.size(), atlas.keyframes().size());
    num_depths_ = 0;
    atlas.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& keyframe) {
      ASSERT_TRUE(published.contains(keyframe.id));
      const haustra_depth_keyframe& record = published.at(keyframe.id);
      EXPECT_EQ(record.frame_index, keyframe.frame_index);
      EXPECT_EQ(record.map_id, atlas.map(keyframe.map).id);
      EXPECT_EQ(record.procedure, 4u);
      const Eigen::Vector3d centre = keyframe.cam_from_map.InverseTranslation();
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(record.position_mu[i], centre[i], 1e-12);
      const KeptDepth* kept = engine.depths()->DepthOf(handle);
      ASSERT_EQ(kept != nullptr, record.depth != 0);
      if (kept == nullptr) return;
      ++num_depths_;
      auto depth = std::make_unique<haustra_depth>();
      ASSERT_EQ(haustra_depth_read(&table_, slots_.at(keyframe.id), record.depth, depth.get()), HAUSTRA_OK);
      ASSERT_EQ(depth->num_cells, static_cast<std::uint64_t>(kept->depth.num_cells()));
      const double growth = atlas.KeyframeScale(handle) / kept->scale;
      for (int cell = 0; cell < kept->depth.num_cells(); ++cell) {
        ASSERT_EQ(depth->codes[cell] == 0, !kept->depth.has_depth(cell));
        if (!kept->depth.has_depth(cell)) continue;
        const double range = 1.0 / (depth->codes[cell] * record.inverse_range_unit);
        ASSERT_NEAR(range, kept->depth.range_mu(cell) * growth, 1e-9 * range);
      }
    });
  }

  std::string path_;
  EngineConfig config_ = test::SmallEngineConfig();
  haustra_depth_table table_{};
  std::map<std::uint32_t, std::uint32_t> slots_;
  int num_depths_ = 0;
};

TEST_F(DepthPublisherTest, TheTableFollowsTheAtlas) {
  test::ScriptedColon colon(TimePoint{}, config_);
  // There and back, so that keyframes are culled.
  colon.Move(0.0, 1.6, 40);
  colon.Move(1.6, 0.0, 40);
  DepthMatcher depth(colon.camera(), ImageView{}, config_.depth.options());
  Engine engine(config_, colon.camera(), colon.device(), Engine::Mode::kSequential, nullptr, ImageView{}, nullptr,
                &depth);
  const auto writer = DepthTableWriter::Create(path_, 0600, static_cast<gid_t>(-1),
                                               static_cast<std::uint32_t>(config_.memory.max_keyframes));
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  ASSERT_EQ(haustra_depth_open(&table_, path_.c_str()), HAUSTRA_OK);
  DepthPublisher publisher(**writer, colon.camera().calibration(), ImageView{}, config_.depth.step_px,
                           config_.memory.max_keyframes);
  // Of a worker that died.
  haustra_depth_keyframe stale{};
  stale.procedure = 4;
  stale.keyframe_id = 77777;
  (*writer)->PublishKeyframe((*writer)->num_slots() - 1, stale);
  publisher.Begin(4);
  PublishingHooks hooks(engine, publisher);
  const SystemClock clock;
  test::RecordingObserver observer;
  ASSERT_TRUE(RunSequential(colon.source(), engine, clock, observer, test::kNeverStop, hooks).ok());
  engine.FinishDepth(test::kNeverStop);
  EXPECT_GT(engine.mapper_counters().num_keyframes_culled, 0u) << "slots are to be given back";
  while (publisher.Publish(engine)) {
  }
  ExpectTableIs(engine);
  EXPECT_GT(num_depths_, 2);
  haustra_depth_camera camera{};
  ASSERT_EQ(haustra_depth_read_camera(&table_, &camera), HAUSTRA_OK);
  EXPECT_EQ(camera.procedure, 4u);
  EXPECT_EQ(camera.step_px, 8u);
  EXPECT_EQ(camera.grid_width, static_cast<std::uint32_t>(colon.camera().width_px() / 8));
  // Nothing has changed: nothing is written.
  const std::uint64_t changes = haustra_depth_num_changes(&table_);
  EXPECT_FALSE(publisher.Publish(engine));
  EXPECT_EQ(haustra_depth_num_changes(&table_), changes);
  // As when a young map is built anew: what is known of its wall is of another shape.
  Atlas& atlas = const_cast<Atlas&>(engine.atlas());
  std::vector<KeyframeHandle> keyframes;
  atlas.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe&) { keyframes.push_back(handle); });
  for (const KeyframeHandle keyframe : keyframes) atlas.keyframe(keyframe).turned_at = 7;
  while (publisher.Publish(engine)) {
  }
  ExpectTableIs(engine);
  EXPECT_EQ(num_depths_, 0);
  engine.FinishDepth(test::kNeverStop);
  while (publisher.Publish(engine)) {
  }
  ExpectTableIs(engine);
  EXPECT_GT(num_depths_, 0) << "of those whose pictures are there";
  // Turned and searched again between two looks.
  for (const KeyframeHandle keyframe : keyframes) atlas.keyframe(keyframe).turned_at = 8;
  engine.FinishDepth(test::kNeverStop);
  while (publisher.Publish(engine)) {
  }
  ExpectTableIs(engine);
}

}  // namespace
}  // namespace haustra
