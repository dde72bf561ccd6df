// Two engines in one tube of landmarks, one after the other: the second one is given the maps of the first as a file.
// Frame numbers and time stamps of both begin at zero.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/engine.h"
#include "engine/export_map.h"
#include "engine/geometry/rng.h"
#include "hal/fakes/scripted_frame_source.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/engine/system/small_config.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// The scope flies along a wavy tube of radius 1.
class Session {
 public:
  explicit Session(const EngineConfig& config = test::SmallEngineConfig())
      : camera_(CameraModel::Create(test::ColonCalibration()).value()),
        device_(Engine::PlanFor(config, camera_.calibration()), {}),
        source_(camera_.calibration()),
        engine_(config, camera_, device_, Engine::Mode::kSequential, nullptr, ImageView{}) {
    Rng rng(17);
    for (std::uint32_t id = 1; id <= 9000; ++id) {
      const double around = rng.Uniform(0.0, 2.0 * std::numbers::pi);
      const double z = rng.Uniform(-2.0, 22.0);
      const double radius = 1.0 + 0.15 * std::sin(4.0 * z) + 0.1 * std::cos(2.0 * around + z);
      landmarks_.push_back({{radius * std::cos(around), radius * std::sin(around), z}, rng.Uniform(3.0, 8.0), id});
    }
  }

  void Move(double from, double to, int num_frames) {
    for (int i = 0; i < num_frames; ++i) Add(from + (to - from) * i / (num_frames - 1));
  }
  void Run() {
    for (Result<Frame> frame = source_.Next(kNoDeadline); frame.ok(); frame = source_.Next(kNoDeadline)) {
      results_.push_back(engine_.Track(*frame, kNoDeadline));
      while (engine_.BackgroundStep()) {
      }
      for (MapEvent event; engine_.map_events().TryPop(&event);) ++num_events_[static_cast<int>(event.kind)];
    }
  }
  std::string Save() const {
    StringSink sink;
    EXPECT_EQ(engine_.SaveAtlas(sink).ToString(), "ok");
    return sink.bytes();
  }
  Status Load(const std::string& file) {
    return engine_.LoadAtlas({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()});
  }

  int NumEvents(MapEventKind kind) const { return num_events_[static_cast<int>(kind)]; }
  Engine& engine() { return engine_; }
  const std::vector<FrameResult>& results() const { return results_; }
  const std::vector<SE3>& truth() const { return truth_; }

 private:
  struct Landmark {
    Eigen::Vector3d position;
    double size;
    std::uint32_t id;
  };

  void Add(double z) {
    const auto index = static_cast<std::uint32_t>(truth_.size());
    const Eigen::Vector3d centre(0.15 * std::sin(3.0 * z), 0.12 * std::cos(2.0 * z), z);
    const SE3 cam_from_world =
        SE3(ExpSO3({0.05 * std::sin(z), 0.05 * std::cos(1.7 * z), 0.0}), Eigen::Vector3d::Zero()) *
        SE3(Eigen::Quaterniond::Identity(), -centre);
    truth_.push_back(cam_from_world);
    std::vector<ScriptedFeature> features;
    for (const Landmark& landmark : landmarks_) {
      const Eigen::Vector3d in_cam = cam_from_world * landmark.position;
      Eigen::Vector2d pixel;
      if (in_cam.z() < 0.3 || in_cam.norm() > 3.0 || !camera_.Project(in_cam, &pixel)) continue;
      if (noise_.Uniform() > 0.7) continue;  // not detected in this frame
      pixel += Eigen::Vector2d(noise_.Uniform(-0.5, 0.5), noise_.Uniform(-0.5, 0.5));
      if (!camera_.IsInImage(pixel)) continue;
      ScriptedFeature feature;
      feature.keypoint.x_px = static_cast<float>(pixel.x());
      feature.keypoint.y_px = static_cast<float>(pixel.y());
      feature.keypoint.scale_px = static_cast<float>(landmark.size / in_cam.norm());
      feature.keypoint.response = 1.0f / static_cast<float>(1 + landmark.id % 97);
      feature.appearance = {landmark.id, landmark.id};
      features.push_back(feature);
    }
    device_.SetFrame(index, features);
    source_.AddFrame(TimePoint(std::chrono::milliseconds(40) * index));
  }

  CameraModel camera_;
  ScriptedVisionDevice device_;
  ScriptedFrameSource source_;
  Engine engine_;
  Rng noise_{23};
  std::vector<Landmark> landmarks_;
  std::vector<SE3> truth_;
  std::vector<FrameResult> results_;
  std::array<int, 32> num_events_{};
};

// Distance of the keyframes of both sessions from the truth, after one similarity for all that lie in `map`.
double RmsOfBothSessions(Session& first, Session& second, MapHandle map) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const KeyframeHandle handle : second.engine().atlas().map(map).keyframes) {
    const Keyframe& keyframe = second.engine().atlas().keyframe(handle);
    const Session& session = keyframe.session == 0 ? first : second;
    estimated.push_back(keyframe.cam_from_map.InverseTranslation());
    truth.push_back(session.truth()[keyframe.frame_index].InverseTranslation());
  }
  Sim3 truth_from_map;
  EXPECT_TRUE(AlignSim3(estimated, truth, &truth_from_map));
  double sum = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) sum += (truth_from_map * estimated[i] - truth[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

int NumOfSession(const Atlas& atlas, std::uint32_t session) {
  int num = 0;
  atlas.keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) { num += keyframe.session == session; });
  return num;
}

class SecondSession : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    first_ = new Session;
    first_->Move(0.0, 4.0, 100);
    first_->Run();
    file_ = new std::string(first_->Save());
  }
  static void TearDownTestSuite() {
    delete first_;
    delete file_;
  }

  static Session* first_;
  static std::string* file_;
};
Session* SecondSession::first_ = nullptr;
std::string* SecondSession::file_ = nullptr;

TEST_F(SecondSession, FirstFrameInALoadedMapIsFoundThere) {
  Session second;
  ASSERT_EQ(second.Load(*file_).ToString(), "ok");
  second.Move(2.0, 3.5, 40);
  second.Run();
  EXPECT_EQ(second.NumEvents(MapEventKind::kMapCreated), 0);
  EXPECT_EQ(second.NumEvents(MapEventKind::kFrameFound), 1);
  for (std::size_t i = 2; i < second.results().size(); ++i) {
    EXPECT_EQ(second.results()[i].state, TrackingState::kTracking) << i;
    EXPECT_EQ(second.results()[i].map_id, 0u) << i;
  }
  EXPECT_EQ(CheckInvariants(second.engine().atlas()).ToString(), "ok");
}

TEST_F(SecondSession, MapBegunElsewhereIsMergedWithTheLoadedOne) {
  Session second;
  ASSERT_EQ(second.Load(*file_).ToString(), "ok");
  const int num_loaded = NumOfSession(second.engine().atlas(), 0);
  second.Move(9.0, 3.0, 150);
  second.Run();
  EXPECT_EQ(second.NumEvents(MapEventKind::kMapCreated), 1);
  EXPECT_EQ(second.NumEvents(MapEventKind::kMerged), 1);
  const Atlas& atlas = second.engine().atlas();
  EXPECT_EQ(CheckInvariants(atlas).ToString(), "ok");

  MapHandle joined;
  int num_living = 0;
  atlas.maps().ForEach([&](MapHandle handle, const Map& map) {
    if (map.keyframes.empty()) return;
    joined = handle;
    ++num_living;
  });
  ASSERT_EQ(num_living, 1);
  EXPECT_GE(NumOfSession(atlas, 0), num_loaded / 2);
  EXPECT_GE(NumOfSession(atlas, 1), 10);
  EXPECT_LT(RmsOfBothSessions(*first_, second, joined), 0.1);

  // Every frame of this session has its pose there.
  int num_resolved = 0;
  for (const FrameResult& result : second.results()) {
    ResolvedPose pose;
    if (!second.engine().Resolve(result, &pose)) continue;
    EXPECT_EQ(pose.map_id, atlas.map(joined).id);
    ++num_resolved;
  }
  EXPECT_GE(num_resolved, 120);

  // What is exported keeps frames of the same number apart, and takes colours from this session's pictures only.
  const int num_frames = static_cast<int>(second.results().size());
  const MapExport exported = ExportMap(
      second.engine(), joined, [](std::uint32_t index) { return std::to_string(index) + ".jpg"; },
      [&](std::uint32_t index, const Eigen::Vector2d&) {
        EXPECT_LT(index, num_frames);
        return std::array<std::uint8_t, 3>{9, 9, 9};
      });
  ASSERT_TRUE(Validate(exported).ok());
  std::vector<std::string> names;
  int num_of_first = 0;
  for (const KeyframeExport& keyframe : exported.keyframes) {
    names.push_back(keyframe.image_name);
    num_of_first += keyframe.image_name.starts_with("session_0/");
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
  EXPECT_EQ(num_of_first, NumOfSession(atlas, 0));
  int num_grey = 0, num_coloured = 0;
  for (const PointExport& point : exported.points) {
    const bool is_own = std::any_of(point.track.begin(), point.track.end(), [&](const auto& view) {
      return atlas.IsOfThisSession(static_cast<KeyframeId>(view.first));
    });
    EXPECT_EQ(point.rgb[0], is_own ? 9 : 128);
    ++(is_own ? num_coloured : num_grey);
  }
  EXPECT_GT(num_grey, 0);
  EXPECT_GT(num_coloured, 0);

  // And a third one can go on from here.
  Session third;
  const std::string saved = second.Save();
  ASSERT_EQ(third.Load(saved).ToString(), "ok");
  EXPECT_EQ(third.engine().atlas().session(), 2u);
  // What is loaded has new ids, and keeps them when it is loaded once more.
  const std::string renumbered = third.Save();
  Session fourth;
  ASSERT_EQ(fourth.Load(renumbered).ToString(), "ok");
  EXPECT_EQ(fourth.Save(), renumbered);
}

// A patient's atlas is carried on from procedure to procedure; each has all ids but those of what it loads.
TEST_F(SecondSession, IdsOfKeyframesDoNotRunOutOverTheYears) {
  EngineConfig config = test::SmallEngineConfig();
  config.memory.max_keyframe_ids = 2 * static_cast<int>(first_->engine().atlas().num_keyframe_ids());
  std::string file = *file_;
  std::size_t num_made = first_->engine().atlas().num_keyframe_ids();
  for (std::uint32_t number = 1; number <= 5; ++number) {
    SCOPED_TRACE(number);
    Session session(config);
    ASSERT_EQ(session.Load(file).ToString(), "ok");
    const std::size_t num_loaded = session.engine().atlas().num_keyframe_ids();
    EXPECT_EQ(num_loaded, session.engine().atlas().keyframes().size());
    session.Move(1.0, 3.5, 60);
    session.Run();
    EXPECT_EQ(session.results().back().state, TrackingState::kTracking);
    num_made += session.engine().atlas().num_keyframe_ids() - num_loaded;
    EXPECT_EQ(session.engine().mapper_counters().num_keyframe_ids_refused, 0u);
    EXPECT_EQ(session.engine().atlas().session(), number);
    EXPECT_EQ(CheckInvariants(session.engine().atlas()).ToString(), "ok");
    file = session.Save();
  }
  EXPECT_GT(num_made, static_cast<std::size_t>(config.memory.max_keyframe_ids)) << "all runs together";
}

TEST_F(SecondSession, PlaceThatTheLoadedMapDoesNotHoldStaysApart) {
  Session second;
  ASSERT_EQ(second.Load(*file_).ToString(), "ok");
  second.Move(12.0, 15.0, 75);
  second.Run();
  EXPECT_EQ(second.NumEvents(MapEventKind::kFrameFound), 0);
  EXPECT_EQ(second.NumEvents(MapEventKind::kMerged), 0);
  EXPECT_EQ(second.results().back().state, TrackingState::kTracking);
  EXPECT_NE(second.results().back().map_id, 0u);
}

TEST_F(SecondSession, RefusedFileLeavesTheEngineAsItWas) {
  std::string damaged = *file_;
  damaged[damaged.size() / 3] = static_cast<char>(damaged[damaged.size() / 3] ^ 1);
  EngineConfig config = test::SmallEngineConfig();
  Session with_file(config), without(config);
  EXPECT_EQ(with_file.Load(damaged).code(), StatusCode::kDataLoss);
  for (Session* session : {&with_file, &without}) {
    session->Move(0.0, 1.5, 40);
    session->Run();
  }
  EXPECT_EQ(with_file.Save(), without.Save());
  // Too late now.
  const Status status = with_file.Load(*file_);
  EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("before the first map"));
}

}  // namespace
}  // namespace haustra
