// Marks in the whole engine, on a tube of landmarks that a scripted device sees: set in a frame, seen in later ones,
// after losses, joins and in the next procedure. Truth is geometry.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/engine.h"
#include "engine/geometry/rng.h"
#include "hal/fakes/scripted_frame_source.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/engine/system/small_config.h"
#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

// A scope in a wavy tube of radius 1 along z.
class MarkedProcedure {
 public:
  // mask: as in SceneRegion.
  explicit MarkedProcedure(const EngineConfig& config = SmallEngineConfig(), ImageView mask = {})
      : camera_(ColonCamera()),
        device_(Engine::PlanFor(config, camera_.calibration()), {}),
        source_(camera_.calibration()),
        engine_(config, camera_, device_, Engine::Mode::kSequential, nullptr, mask) {
    EXPECT_TRUE(device_.SetStaticMask(mask).ok());
    Rng rng(17);
    for (std::uint32_t id = 1; id <= 9000; ++id) {
      landmarks_.push_back(
          {WallAt(rng.Uniform(0.0, 2.0 * std::numbers::pi), rng.Uniform(-2.0, 22.0)), rng.Uniform(3.0, 8.0), id});
    }
  }

  static Eigen::Vector3d WallAt(double around, double z) {
    const double radius = 1.0 + 0.15 * std::sin(4.0 * z) + 0.1 * std::cos(2.0 * around + z);
    return {radius * std::cos(around), radius * std::sin(around), z};
  }

  // In all further pictures it is black beyond this distance from the middle.
  void DarkenBeyond(double radius_px) { window_radius_px_ = radius_px; }
  // All further frames, each looked at before the next is made.
  void Move(double from, double to, int num_frames) {
    for (int i = 0; i < num_frames; ++i) Show(ViewFrom(from + (to - from) * i / (num_frames - 1)));
  }
  void Occlude(int num_frames) {
    for (int i = 0; i < num_frames; ++i) Show(std::nullopt);
  }

  // What frame `frame` sees of a point of the world.
  Eigen::Vector2d PixelOf(const Eigen::Vector3d& in_world, std::size_t frame) const {
    Eigen::Vector2d pixel;
    EXPECT_TRUE(camera_.Project(truth_[frame] * in_world, &pixel));
    return pixel;
  }
  bool IsInView(const Eigen::Vector3d& in_world, std::size_t frame) const {
    Eigen::Vector2d pixel;
    const Eigen::Vector3d in_cam = truth_[frame] * in_world;
    return in_cam.z() > 0.3 && in_cam.norm() < 2.5 && camera_.Project(in_cam, &pixel) && camera_.IsInImage(pixel, 20.0);
  }

  Result<MarkId> Mark(std::string_view label, const Eigen::Vector3d& in_world, std::uint32_t frame) {
    return engine_.SetMark({frame, PixelOf(in_world, frame), MarkLabel::From(label).value()});
  }

  // How the mark is seen in frames from `first` on that truly show it: how many there are, and how many show it within
  // 2 % of the image's width.
  struct Score {
    int num_in_view = 0;
    int num_found = 0;
    double worst_px = 0.0;
  };
  Score Judge(MarkId id, const Eigen::Vector3d& in_world, std::size_t first) const {
    Score score;
    for (std::size_t i = first; i < truth_.size(); ++i) {
      if (results_[i].state != TrackingState::kTracking || !IsInView(in_world, i)) continue;
      ++score.num_in_view;
      for (const MarkSighting& sighting : sightings_[i]) {
        if (sighting.id != id || sighting.state != MarkState::kInFront) continue;
        const double error = (Eigen::Vector2d(sighting.u_px, sighting.v_px) - PixelOf(in_world, i)).norm();
        score.num_found += error < 0.02 * camera_.width_px();
        score.worst_px = std::max(score.worst_px, error);
      }
    }
    return score;
  }

  std::string Save() const {
    StringSink sink;
    EXPECT_EQ(engine_.SaveAtlas(sink).ToString(), "ok");
    return sink.bytes();
  }
  Status Load(const std::string& file) {
    return engine_.LoadAtlas({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()});
  }

  Engine& engine() { return engine_; }
  const MarkSightings& sightings(std::size_t frame) const { return sightings_[frame]; }
  std::size_t num_frames() const { return truth_.size(); }
  const std::vector<FrameResult>& results() const { return results_; }
  int NumEvents(MapEventKind kind) const { return static_cast<int>(std::count(events_.begin(), events_.end(), kind)); }

 private:
  struct Landmark {
    Eigen::Vector3d position;
    double size;
    std::uint32_t id;
  };

  static SE3 ViewFrom(double z) {
    const Eigen::Vector3d centre(0.15 * std::sin(3.0 * z), 0.12 * std::cos(2.0 * z), z);
    return SE3(ExpSO3({0.05 * std::sin(z), 0.05 * std::cos(1.7 * z), 0.0}), Eigen::Vector3d::Zero()) *
           SE3(Eigen::Quaterniond::Identity(), -centre);
  }

  void Show(const std::optional<SE3>& cam_from_world) {
    const auto index = static_cast<std::uint32_t>(truth_.size());
    truth_.push_back(cam_from_world.value_or(SE3{}));
    device_.SetFrame(index, cam_from_world ? See(*cam_from_world) : std::vector<ScriptedFeature>{});
    source_.AddFrame(TimePoint(std::chrono::milliseconds(40) * index));
    const Frame frame = source_.Next(kNoDeadline).value();
    Darken(frame.image);
    results_.push_back(engine_.Track(frame, kNoDeadline));
    sightings_.push_back(engine_.mark_sightings());
    while (engine_.BackgroundStep()) continue;
    for (MapEvent event; engine_.map_events().TryPop(&event);) events_.push_back(event.kind);
    ASSERT_EQ(CheckInvariants(engine_.atlas()).ToString(), "ok") << "frame " << index;
  }

  // But for the first row, by which the device knows the frame.
  void Darken(const ImageView& image) {
    if (!std::isfinite(window_radius_px_)) return;
    const Eigen::Vector2d middle(0.5 * image.width, 0.5 * image.height);
    for (int y = 1; y < image.height; ++y) {
      auto* row = const_cast<std::uint8_t*>(image.row(y));
      for (int x = 0; x < image.width; ++x) {
        if ((Eigen::Vector2d(x, y) - middle).norm() > window_radius_px_) row[x] = 16;
      }
    }
  }

  std::vector<ScriptedFeature> See(const SE3& cam_from_world) {
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
    return features;
  }

  CameraModel camera_;
  ScriptedVisionDevice device_;
  ScriptedFrameSource source_;
  Engine engine_;
  Rng noise_{23};
  double window_radius_px_ = std::numeric_limits<double>::infinity();
  std::vector<Landmark> landmarks_;
  std::vector<SE3> truth_;
  std::vector<FrameResult> results_;
  std::vector<MarkSightings> sightings_;
  std::vector<MapEventKind> events_;
};

void ExpectFound(const MarkedProcedure::Score& score, int min_in_view) {
  EXPECT_GE(score.num_in_view, min_in_view);
  EXPECT_GE(score.num_found, score.num_in_view * 95 / 100);
}

TEST(Marks, AreFoundAgainAsTheScopeGoesOnAndComesBack) {
  MarkedProcedure procedure;
  procedure.Move(0.0, 2.0, 50);
  const Eigen::Vector3d place = MarkedProcedure::WallAt(1.0, 3.2);
  // Some frames ago.
  const Result<MarkId> id = procedure.Mark("polyp", place, 45);
  ASSERT_TRUE(id.ok()) << id.status().ToString();
  procedure.Move(2.0, 5.0, 75);
  procedure.Move(5.0, 0.5, 110);
  ExpectFound(procedure.Judge(*id, place, 50), 30);
}

TEST(Marks, AreFoundAgainAfterALoss) {
  MarkedProcedure procedure;
  procedure.Move(0.0, 2.0, 50);
  const Eigen::Vector3d place = MarkedProcedure::WallAt(4.0, 3.0);
  const Result<MarkId> id = procedure.Mark("polyp", place, 49);
  ASSERT_TRUE(id.ok()) << id.status().ToString();
  procedure.Move(2.0, 2.4, 10);
  procedure.Occlude(10);
  const std::size_t first = procedure.num_frames();
  procedure.Move(2.4, 1.0, 40);
  ExpectFound(procedure.Judge(*id, place, first), 20);
}

// Between the two maps lies a stretch that nobody saw; the younger one is marked, and moved into the other's frame.
TEST(Marks, GoAlongWhenTheirMapIsJoined) {
  MarkedProcedure procedure;
  procedure.Move(0.0, 3.0, 75);
  procedure.Occlude(5);
  procedure.Move(9.0, 7.0, 50);
  const Eigen::Vector3d place = MarkedProcedure::WallAt(1.0, 8.6);
  const Result<MarkId> id = procedure.Mark("polyp", place, static_cast<std::uint32_t>(procedure.num_frames()) - 1);
  ASSERT_TRUE(id.ok()) << id.status().ToString();
  procedure.Move(7.0, 1.0, 150);
  EXPECT_GE(procedure.NumEvents(MapEventKind::kMerged), 1);
  const std::size_t first = procedure.num_frames();
  procedure.Move(1.0, 7.6, 160);
  ExpectFound(procedure.Judge(*id, place, first), 20);
}

TEST(Marks, AreThereInTheNextProcedure) {
  const Eigen::Vector3d place = MarkedProcedure::WallAt(1.0, 3.2);
  std::string file;
  MarkId id = 0;
  {
    MarkedProcedure procedure;
    procedure.Move(0.0, 4.0, 100);
    const Result<MarkId> set = procedure.Mark("polyp", place, 50);
    ASSERT_TRUE(set.ok()) << set.status().ToString();
    id = *set;
    file = procedure.Save();
  }
  MarkedProcedure next;
  ASSERT_EQ(next.Load(file).ToString(), "ok");
  EXPECT_EQ(next.engine().atlas().marks().size(), 1u);
  next.Move(1.0, 3.0, 50);
  ExpectFound(next.Judge(id, place, 5), 20);
  // Its label is taken, and numbers go on.
  EXPECT_EQ(next.Mark("polyp", place, 49).code(), StatusCode::kInvalidArgument);
  const Result<MarkId> other = next.Mark("other", place, 25);
  ASSERT_TRUE(other.ok()) << other.status().ToString();
  EXPECT_GT(*other, id);
}

TEST(Marks, AreRefusedWithAReason) {
  EngineConfig config = SmallEngineConfig();
  config.memory.max_marks = 1;
  MarkedProcedure procedure(config);
  const auto set = [&](std::uint32_t frame, const Eigen::Vector2d& pixel, std::string_view label) {
    return procedure.engine().SetMark({frame, pixel, MarkLabel::From(label).value()}).status();
  };
  EXPECT_THAT(set(kNewestFrame, {300, 200}, "a").message(), HasSubstr("no frame yet"));
  procedure.Move(0.0, 2.0, 50);
  EXPECT_THAT(set(0, {300, 200}, "a").message(), HasSubstr("no measured pose"));
  EXPECT_EQ(set(60, {300, 200}, "a").code(), StatusCode::kNotFound);
  EXPECT_THAT(set(49, {-5, 200}, "a").message(), HasSubstr("outside the image"));
  // The end of the tube is too far away for a landmark.
  EXPECT_THAT(set(49, procedure.PixelOf({0, 0, 20}, 49), "a").message(), HasSubstr("the map"));
  const Eigen::Vector3d place = MarkedProcedure::WallAt(1.0, 3.2);
  ASSERT_TRUE(procedure.Mark("a", place, 49).ok());
  EXPECT_EQ(procedure.Mark("a", place, 49).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(procedure.Mark("b", place, 49).code(), StatusCode::kCapacityExceeded);
  EXPECT_EQ(procedure.engine().RemoveMark("b").code(), StatusCode::kNotFound);
  EXPECT_TRUE(procedure.engine().RemoveMark("a").ok());
  EXPECT_TRUE(procedure.Mark("b", place, 49).ok());
  procedure.Occlude(2);
  EXPECT_THAT(set(kNewestFrame, {300, 200}, "c").message(), HasSubstr("marks already"));
  ASSERT_TRUE(procedure.engine().RemoveMark("b").ok());
  EXPECT_THAT(set(kNewestFrame, {300, 200}, "c").message(), HasSubstr("no measured pose"));
}

// The scope's window is a disc as high as 0.8 of the picture. Points are found up to its edge, so that there is a patch
// of wall at every pixel just beyond it.
TEST(Marks, AreNotSetAndNotShownInTheBorderAroundTheScene) {
  RecordProperty("req", "MRK-003");
  const CameraModel camera = ColonCamera();
  const int width = camera.width_px(), height = camera.height_px();
  const Eigen::Vector2d centre(0.5 * width, 0.5 * height);
  const double radius = 0.4 * height;
  std::vector<std::uint8_t> mask;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) mask.push_back((Eigen::Vector2d(x, y) - centre).norm() < radius ? 255 : 0);
  }
  MarkedProcedure procedure(SmallEngineConfig(), {mask.data(), width, height, width, PixelFormat::kGrey8});
  procedure.Move(0.0, 2.0, 50);
  const auto set = [&](const Eigen::Vector2d& pixel, std::string_view label) {
    return procedure.engine().SetMark({49, pixel, MarkLabel::From(label).value()});
  };
  for (int i = 0; i < 8; ++i) {
    const double around = 2.0 * std::numbers::pi * i / 8;
    const Eigen::Vector2d direction(std::cos(around), std::sin(around));
    const Result<MarkId> beyond = set(centre + (radius + 4.0) * direction, "beyond" + std::to_string(i));
    EXPECT_EQ(beyond.code(), StatusCode::kInvalidArgument) << i;
    EXPECT_THAT(beyond.status().message(), HasSubstr("border around the scene")) << i;
  }
  const Eigen::Vector3d place = MarkedProcedure::WallAt(1.0, 4.2);
  const Result<MarkId> id = procedure.Mark("polyp", place, 49);
  ASSERT_TRUE(id.ok()) << id.status().ToString();
  // It leaves the window sideways as the scope passes it.
  procedure.Move(2.0, 3.8, 45);
  int num_within = 0, num_behind_border = 0;
  for (std::size_t i = 50; i < procedure.num_frames(); ++i) {
    if (!procedure.IsInView(place, i)) continue;
    const double offset_px = (procedure.PixelOf(place, i) - centre).norm();
    for (const MarkSighting& sighting : procedure.sightings(i)) {
      if (sighting.id != *id) continue;
      num_within += offset_px < radius - 10.0 && sighting.state == MarkState::kInFront;
      if (offset_px < radius + 10.0) continue;
      ++num_behind_border;
      EXPECT_EQ(ToString(sighting.state), "out_of_view") << "frame " << i;
    }
  }
  EXPECT_GE(num_within, 5);
  EXPECT_GE(num_behind_border, 3);
}

// A tower's picture, and nobody says where the window is. Points are found beyond its edge, as above.
TEST(Marks, AreNotSetInADarkSurroundThatNoMaskTells) {
  RecordProperty("req", "MRK-003");
  MarkedProcedure procedure;
  const CameraModel camera = ColonCamera();
  const Eigen::Vector2d centre(0.5 * camera.width_px(), 0.5 * camera.height_px());
  const double radius = 0.4 * camera.height_px();
  procedure.DarkenBeyond(radius);
  procedure.Move(0.0, 2.0, 50);
  for (int i = 0; i < 8; ++i) {
    const double around = 2.0 * std::numbers::pi * i / 8;
    const Eigen::Vector2d direction(std::cos(around), std::sin(around));
    const auto set = [&](double from_centre, const char* label) {
      const Eigen::Vector2d pixel = centre + from_centre * direction;
      return procedure.engine().SetMark({49, pixel, MarkLabel::From(label + std::to_string(i)).value()});
    };
    const Result<MarkId> beyond = set(radius + 16.0, "beyond");
    EXPECT_EQ(beyond.code(), StatusCode::kInvalidArgument) << i;
    EXPECT_THAT(beyond.status().message(), HasSubstr("dark surround")) << i;
    const Result<MarkId> within = set(radius - 16.0, "within");
    EXPECT_TRUE(within.ok()) << within.status().ToString();
  }
}

// A map of two keyframes would be dropped when it is lost.
TEST(Marks, KeepTheirMap) {
  EngineConfig config = SmallEngineConfig();
  config.mapping.min_map_keyframes = 100;
  MarkedProcedure procedure(config);
  procedure.Move(0.0, 1.0, 25);
  ASSERT_TRUE(procedure.Mark("polyp", MarkedProcedure::WallAt(1.0, 2.2), 24).ok());
  procedure.Occlude(5);
  procedure.Move(9.0, 8.0, 25);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapDropped), 0);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapStored), 1);
  EXPECT_EQ(procedure.engine().atlas().marks().size(), 1u);
}

// Keyframes are culled and evicted around the mark, and the one that holds it goes.
TEST(Marks, OutliveTheirKeyframes) {
  EngineConfig config = SmallEngineConfig();
  config.memory.max_keyframes = 16;
  MarkedProcedure procedure(config);
  procedure.Move(0.0, 2.0, 50);
  const Eigen::Vector3d place = MarkedProcedure::WallAt(1.0, 3.2);
  const Result<MarkId> id = procedure.Mark("polyp", place, 49);
  ASSERT_TRUE(id.ok()) << id.status().ToString();
  const Atlas& atlas = procedure.engine().atlas();
  const auto anchor = [&] { return atlas.marks().At(atlas.FindMark("polyp")).keyframe; };
  const KeyframeHandle first_anchor = anchor();
  procedure.Move(2.0, 10.0, 200);
  EXPECT_FALSE(anchor() == first_anchor);
  const std::size_t first = procedure.num_frames();
  procedure.Move(10.0, 1.0, 225);
  // With so few keyframes the map is not what it was: the mark comes close to its place only as the scope draws
  // back, within the limit in 4 of 28 frames. One whose place is lost when its keyframe goes is there in none.
  const MarkedProcedure::Score score = procedure.Judge(*id, place, first);
  EXPECT_GE(score.num_in_view, 10);
  EXPECT_GE(score.num_found, 2);
  EXPECT_EQ(atlas.marks().size(), 1u);
}

// Without marks and with them, tracking and mapping are the same to the bit.
TEST(Marks, ChangeNothingElse) {
  MarkedProcedure plain, marked;
  plain.Move(0.0, 2.0, 50);
  marked.Move(0.0, 2.0, 50);
  ASSERT_TRUE(marked.Mark("polyp", MarkedProcedure::WallAt(1.0, 3.2), 49).ok());
  plain.Move(2.0, 4.0, 50);
  marked.Move(2.0, 4.0, 50);
  for (std::size_t i = 0; i < plain.num_frames(); ++i) {
    const FrameResult &a = plain.results()[i], &b = marked.results()[i];
    ASSERT_EQ(a.cam_from_map.translation, b.cam_from_map.translation) << "frame " << i;
    ASSERT_EQ(a.cam_from_map.rotation.coeffs(), b.cam_from_map.rotation.coeffs()) << "frame " << i;
    ASSERT_EQ(a.num_inliers, b.num_inliers) << "frame " << i;
  }
}

}  // namespace
}  // namespace haustra::test
