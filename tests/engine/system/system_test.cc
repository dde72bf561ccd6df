// The whole engine on a tube of landmarks that a scripted device sees: truth is geometry, nothing is an image.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/engine.h"
#include "engine/geometry/rng.h"
#include "hal/fakes/scripted_frame_source.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/engine/system/small_config.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

using test::ColonCalibration;

constexpr Duration kPeriod = std::chrono::milliseconds(40);

// A scope in a wavy tube of radius 1 along z. A position that is not a number is an occluded frame.
class Procedure {
 public:
  explicit Procedure(const EngineConfig& config)
      : config_(config),
        camera_(CameraModel::Create(ColonCalibration()).value()),
        device_(Engine::PlanFor(config, camera_.calibration()), {}),
        source_(camera_.calibration()) {
    Rng rng(17);
    for (std::uint32_t id = 1; id <= 9000; ++id) {
      const double around = rng.Uniform(0.0, 2.0 * std::numbers::pi);
      const double z = rng.Uniform(-2.0, 22.0);
      const double radius = 1.0 + 0.15 * std::sin(4.0 * z) + 0.1 * std::cos(2.0 * around + z);
      landmarks_.push_back({{radius * std::cos(around), radius * std::sin(around), z}, rng.Uniform(3.0, 8.0), id});
    }
  }

  // Everything in sight is up to so many pixels from where it should be.
  void Shake(double pixels) { shake_ = pixels; }
  // Landmarks are so many times as large as usual (a scale of 3 to 8 pixels at a distance of 1).
  void Resize(double factor) {
    for (Landmark& landmark : landmarks_) landmark.size *= factor;
  }

  void Add(double z) {
    const auto index = static_cast<std::uint32_t>(truth_.size());
    if (std::isnan(z)) {
      truth_.emplace_back();
      device_.SetFrame(index, {});
    } else {
      const Eigen::Vector3d centre(0.15 * std::sin(3.0 * z), 0.12 * std::cos(2.0 * z), z);
      const SE3 cam_from_world =
          SE3(ExpSO3({0.05 * std::sin(z), 0.05 * std::cos(1.7 * z), 0.0}), Eigen::Vector3d::Zero()) *
          SE3(Eigen::Quaterniond::Identity(), -centre);
      truth_.push_back(cam_from_world);
      device_.SetFrame(index, See(cam_from_world));
    }
    source_.AddFrame(TimePoint(kPeriod * index));
  }
  // What is seen from z, but of every `num_apart` landmarks only one where it should be: another wall that looks alike.
  void AddAlike(double z, int num_apart) {
    const auto index = static_cast<std::uint32_t>(truth_.size());
    Add(z);
    const std::vector<ScriptedFeature> true_features = See(truth_.back());
    std::vector<ScriptedFeature> features = true_features;
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (i % num_apart == 0) continue;
      const ScriptedFeature& other = true_features[(i + features.size() / 2) % features.size()];
      features[i].keypoint.x_px = other.keypoint.x_px;
      features[i].keypoint.y_px = other.keypoint.y_px;
    }
    device_.SetFrame(index, features);
  }
  // From here on bubbles hang before the scope, which is at z.
  void Blow(double z) {
    Rng rng(29);
    for (std::uint32_t id = 100001; id <= 100300; ++id) {
      bubbles_.push_back(
          {{rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), z + rng.Uniform(0.9, 1.5)}, rng.Uniform(3.0, 8.0), id});
    }
  }
  // They hide the wall and have moved by so much.
  void AddBubblesAlone(double z, const Eigen::Vector3d& moved) {
    const auto index = static_cast<std::uint32_t>(truth_.size());
    Add(z);
    std::vector<ScriptedFeature> features;
    See(bubbles_, truth_.back() * SE3(Eigen::Quaterniond::Identity(), moved), &features);
    device_.SetFrame(index, features);
  }
  void Move(double from, double to, int num_frames) {
    for (int i = 0; i < num_frames; ++i) Add(from + (to - from) * i / (num_frames - 1));
  }
  void Occlude(int num_frames) {
    for (int i = 0; i < num_frames; ++i) Add(std::nan(""));
  }

  // Sequential mode over all frames.
  void Run() {
    engine_ = std::make_unique<Engine>(config_, camera_, device_, Engine::Mode::kSequential, nullptr, ImageView{});
    results_.clear();
    for (Result<Frame> frame = source_.Next(kNoDeadline); frame.ok(); frame = source_.Next(kNoDeadline)) {
      results_.push_back(engine_->Track(*frame, kNoDeadline));
      while (engine_->BackgroundStep()) {
      }
      for (LatePose pose; engine_->late_poses().TryPop(&pose);) {
        FrameResult& late = results_[pose.frame_index];
        late.reference_keyframe = pose.reference_keyframe;
        late.cam_from_reference = pose.cam_from_reference;
        late.reference_scale = pose.reference_scale;
      }
      for (MapEvent event; engine_->map_events().TryPop(&event);) {
        const bool is_refusal =
            event.kind == MapEventKind::kMergeRejected || event.kind == MapEventKind::kFrameNotFound;
        if (!is_refusal) events_.push_back(event);
      }
    }
  }

  // Camera centres of all frames that have a final pose, by map: estimate and truth.
  struct Centres {
    std::vector<Eigen::Vector3d> estimated;
    std::vector<Eigen::Vector3d> truth;
  };
  std::map<MapId, Centres> FinalCentres() const {
    std::map<MapId, Centres> centres;
    for (std::size_t i = 0; i < results_.size(); ++i) {
      ResolvedPose pose;
      if (!engine_->Resolve(results_[i], &pose)) continue;
      centres[pose.map_id].estimated.push_back(pose.cam_from_map.InverseTranslation());
      centres[pose.map_id].truth.push_back(truth_[i].InverseTranslation());
    }
    return centres;
  }
  static double RmsAfterAlignment(const Centres& centres) {
    Sim3 truth_from_map;
    EXPECT_TRUE(AlignSim3(centres.estimated, centres.truth, &truth_from_map));
    double sum = 0.0;
    for (std::size_t i = 0; i < centres.truth.size(); ++i) {
      sum += (truth_from_map * centres.estimated[i] - centres.truth[i]).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(centres.truth.size()));
  }
  int NumEvents(MapEventKind kind) const {
    return static_cast<int>(
        std::count_if(events_.begin(), events_.end(), [&](const MapEvent& e) { return e.kind == kind; }));
  }

  Engine& engine() { return *engine_; }
  ScriptedVisionDevice& device() { return device_; }
  const std::vector<FrameResult>& results() const { return results_; }

 private:
  struct Landmark {
    Eigen::Vector3d position;
    double size;
    std::uint32_t id;
  };

  std::vector<ScriptedFeature> See(const SE3& cam_from_world) {
    std::vector<ScriptedFeature> features;
    See(landmarks_, cam_from_world, &features);
    See(bubbles_, cam_from_world, &features);
    return features;
  }
  void See(const std::vector<Landmark>& landmarks, const SE3& cam_from_world, std::vector<ScriptedFeature>* features) {
    for (const Landmark& landmark : landmarks) {
      const Eigen::Vector3d in_cam = cam_from_world * landmark.position;
      Eigen::Vector2d pixel;
      if (in_cam.z() < 0.3 || in_cam.norm() > 3.0 || !camera_.Project(in_cam, &pixel)) continue;
      if (noise_.Uniform() > 0.7) continue;  // not detected in this frame
      pixel += Eigen::Vector2d(noise_.Uniform(-shake_, shake_), noise_.Uniform(-shake_, shake_));
      if (!camera_.IsInImage(pixel)) continue;
      ScriptedFeature feature;
      feature.keypoint.x_px = static_cast<float>(pixel.x());
      feature.keypoint.y_px = static_cast<float>(pixel.y());
      feature.keypoint.scale_px = static_cast<float>(landmark.size / in_cam.norm());
      feature.keypoint.response = 1.0f / static_cast<float>(1 + landmark.id % 97);
      feature.appearance = {landmark.id, landmark.id};
      features->push_back(feature);
    }
  }

  EngineConfig config_;
  CameraModel camera_;
  ScriptedVisionDevice device_;
  ScriptedFrameSource source_;
  Rng noise_{23};
  double shake_ = 0.5;
  std::vector<Landmark> landmarks_;
  std::vector<Landmark> bubbles_;
  std::vector<SE3> truth_;
  std::unique_ptr<Engine> engine_;
  std::vector<FrameResult> results_;
  std::vector<MapEvent> events_;
};

TEST(System, TubeIsMappedInOneMapAndPosesAgreeWithTheTruth) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 6.0, 150);
  procedure.Run();
  const auto centres = procedure.FinalCentres();
  ASSERT_EQ(centres.size(), 1u);
  EXPECT_GE(centres.begin()->second.truth.size(), 140u);
  EXPECT_LT(Procedure::RmsAfterAlignment(centres.begin()->second), 0.03);
  EXPECT_EQ(CheckInvariants(procedure.engine().atlas()).ToString(), "ok");
}

TEST(System, ReferenceThatNoMotionExplainsHoldsUpNoMap) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Shake(60.0);
  procedure.Add(0.0);
  procedure.Shake(0.5);
  procedure.Move(0.0, 2.0, 50);
  procedure.Run();
  EXPECT_EQ(procedure.results()[5].reason, TrackingReason::kNoEpipolarGeometry);
  EXPECT_EQ(procedure.results()[12].state, TrackingState::kTracking);  // a younger view has founded the map
}

// The finest features of a compressed video are not located as well as their scale promises.
TEST(System, FineFeaturesOffByMoreThanTheirScaleFoundAMap) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Resize(0.2);
  procedure.Shake(1.8);
  procedure.Move(0.0, 2.0, 50);
  procedure.Run();
  EXPECT_EQ(procedure.results()[25].state, TrackingState::kTracking);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapCreated), 1);
}

TEST(System, OcclusionIsAnsweredLostAndThenRelocalisedInTheSameMap) {
  RecordProperty("req", "TRK-001");
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 3.0, 75);
  procedure.Occlude(15);
  procedure.Move(3.0, 4.0, 25);
  procedure.Run();
  for (int i = 75; i < 90; ++i) EXPECT_EQ(procedure.results()[i].state, TrackingState::kLost) << i;
  EXPECT_EQ(procedure.results()[75].reason, TrackingReason::kFewFeatures);
  EXPECT_EQ(procedure.results()[90].reason, TrackingReason::kRelocalised);
  EXPECT_EQ(procedure.results()[90].map_id, procedure.results()[74].map_id);
}

// One landmark in nine agrees with a pose, and these are more than a pose needs; the others contradict it.
TEST(System, WallThatIsOnlyAlikeIsNotTakenForTheMap) {
  RecordProperty("req", "TRK-001");
  for (const bool has_gate : {true, false}) {
    EngineConfig config = test::SmallEngineConfig();
    if (!has_gate) config.place.relocalisation.min_match_share = 0.0;
    Procedure procedure(config);
    procedure.Move(0.0, 3.0, 75);
    procedure.Occlude(5);
    for (int i = 0; i < 5; ++i) procedure.AddAlike(3.0, 9);
    procedure.Run();
    const bool is_placed = std::any_of(procedure.results().begin() + 80, procedure.results().end(),
                                       [](const FrameResult& r) { return r.state == TrackingState::kTracking; });
    EXPECT_NE(is_placed, has_gate);
  }
}

// The third stretch shows what the stored map holds; the map tracked last holds nothing of it.
// The next frame has to confirm it first, however much the map lacks there.
TEST(System, FrameFoundByBruteForceIsNoKeyframe) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 3.0, 75);
  procedure.Occlude(15);
  procedure.Move(3.3, 3.6, 10);
  procedure.Run();
  const std::vector<FrameResult>& results = procedure.results();
  EXPECT_EQ(results[90].reason, TrackingReason::kRelocalised);
  EXPECT_FALSE(results[90].is_keyframe);
  EXPECT_EQ(results[91].reason, TrackingReason::kTracked);
  EXPECT_TRUE(results[91].is_keyframe);
}

// Bubbles were triangulated a moment ago, and move. All that is seen agrees with one pose, and it is wrong.
TEST(System, YoungPointsAloneRecoverNoPose) {
  RecordProperty("req", "TRK-001");
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 3.0, 75);
  procedure.Blow(3.0);
  procedure.Move(3.04, 3.28, 7);
  for (int i = 0; i < 5; ++i) procedure.AddBubblesAlone(3.28, {0.3, 0.0, 0.0});
  procedure.Run();
  const std::vector<FrameResult>& results = procedure.results();
  EXPECT_EQ(results[81].state, TrackingState::kTracking);
  for (int i = 82; i < 87; ++i) EXPECT_EQ(results[i].state, TrackingState::kLost) << i;
}

// What brute force finds after a loss passes the gates of relocalisation, every one of them.
TEST(System, BruteForceKeepsTheGatesOfRelocalisation) {
  const auto is_found_with = [](double min_spread, double max_rotation_sigma_deg, double max_position_sigma) {
    EngineConfig config = test::SmallEngineConfig();
    config.place.relocalisation.min_spread = min_spread;
    config.place.relocalisation.max_rotation_sigma_deg = max_rotation_sigma_deg;
    config.place.relocalisation.max_position_sigma = max_position_sigma;
    Procedure procedure(config);
    procedure.Move(0.0, 3.0, 75);
    procedure.Occlude(5);
    procedure.Move(3.0, 3.1, 5);
    procedure.Run();
    const std::vector<FrameResult>& results = procedure.results();
    return std::any_of(results.begin() + 80, results.end(), [&](const FrameResult& r) {
      return r.state == TrackingState::kTracking && r.map_id == results[74].map_id;
    });
  };
  EXPECT_TRUE(is_found_with(0.05, 1.5, 0.05));
  EXPECT_FALSE(is_found_with(1.0, 1.5, 0.05));
  EXPECT_FALSE(is_found_with(0.05, 1e-6, 0.05));
  EXPECT_FALSE(is_found_with(0.05, 1.5, 1e-6));
}

TEST(System, LostFrameIsFoundInAStoredMap) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 4.0, 100);
  procedure.Occlude(5);
  procedure.Move(12.0, 15.0, 75);
  procedure.Occlude(5);
  procedure.Move(2.0, 1.0, 25);
  procedure.Run();
  const std::vector<FrameResult>& results = procedure.results();
  const MapId first = results[99].map_id;
  ASSERT_NE(results[179].map_id, first);
  // The mapper finds the first frame after the occlusion; tracking goes on from there in the next one.
  EXPECT_EQ(results[185].state, TrackingState::kLost);
  EXPECT_EQ(results[186].state, TrackingState::kTracking);
  EXPECT_EQ(results[186].reason, TrackingReason::kRelocalised);
  for (std::size_t i = 186; i < results.size(); ++i) EXPECT_EQ(results[i].map_id, first) << i;
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kFrameFound), 1);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapCreated), 2);
  ResolvedPose late;
  ASSERT_TRUE(procedure.engine().Resolve(results[185], &late));  // it counts in the final trajectory
  EXPECT_EQ(late.map_id, first);
  const auto centres = procedure.FinalCentres();
  ASSERT_EQ(centres.size(), 2u);
  EXPECT_GE(centres.at(first).truth.size(), 120u);
  EXPECT_LT(Procedure::RmsAfterAlignment(centres.at(first)), 0.05);
  EXPECT_EQ(CheckInvariants(procedure.engine().atlas()).ToString(), "ok");
}

// A scope that looks at one place from all sides: nearly every keyframe is redundant. The map is one all the same.
TEST(System, MapOfAScopeThatHoversOutlivesALoss) {
  EngineConfig config = test::SmallEngineConfig();
  config.mapping.redundant_share = 0.05;
  Procedure procedure(config);
  for (int i = 0; i < 3; ++i) {
    procedure.Move(0.0, 0.2, 15);
    procedure.Move(0.2, 0.0, 15);
  }
  procedure.Occlude(5);
  procedure.Move(12.0, 15.0, 30);
  procedure.Run();
  const std::vector<FrameResult>& results = procedure.results();
  ASSERT_EQ(results[89].state, TrackingState::kTracking);
  ASSERT_GT(procedure.engine().mapper_counters().num_keyframes_culled, 0u);
  ASSERT_EQ(procedure.NumEvents(MapEventKind::kMapCreated), 2);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapStored), 1);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapDropped), 0);
  ResolvedPose pose;
  EXPECT_TRUE(procedure.engine().Resolve(results[89], &pose));
}

TEST(System, EveryFeatureSetIsGivenBackButThoseOfKeyframes) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 4.0, 100);
  procedure.Occlude(5);
  procedure.Move(12.0, 15.0, 75);
  procedure.Occlude(5);
  procedure.Move(2.0, 1.0, 25);
  procedure.Run();
  const int num_used = procedure.device().plan().max_feature_sets - procedure.device().num_free_feature_sets();
  const int num_keyframes = static_cast<int>(procedure.engine().atlas().keyframes().size());
  // Beside the keyframes': that of the last frame, and what the last snapshots may still refer to.
  EXPECT_GE(num_used, num_keyframes);
  EXPECT_LE(num_used, num_keyframes + 6);
}

TEST(System, MapBegunElsewhereIsMergedWhenTheScopeComesBack) {
  RecordProperty("req", "MRG-002");
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 4.0, 100);
  procedure.Occlude(5);
  procedure.Move(9.0, 3.0, 150);  // lands far away, and comes back to what the first map holds
  procedure.Run();
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMapCreated), 2);
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMerged), 1);
  // Who compares poses sees that those before and after do not belong together.
  std::uint64_t last_epoch = 0;
  for (const FrameResult& result : procedure.results()) last_epoch = std::max(last_epoch, result.map_epoch);
  EXPECT_GT(last_epoch, procedure.results()[50].map_epoch);
  const auto centres = procedure.FinalCentres();
  ASSERT_EQ(centres.size(), 1u);
  EXPECT_GE(centres.begin()->second.truth.size(), 230u);
  EXPECT_LT(Procedure::RmsAfterAlignment(centres.begin()->second), 0.1);
  EXPECT_EQ(CheckInvariants(procedure.engine().atlas()).ToString(), "ok");
}

TEST(System, PlacesThatShareNothingStayTwoMaps) {
  RecordProperty("req", "MRG-001");
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 3.0, 75);
  procedure.Occlude(5);
  procedure.Move(12.0, 15.0, 75);
  procedure.Run();
  EXPECT_EQ(procedure.NumEvents(MapEventKind::kMerged), 0);
  EXPECT_EQ(procedure.FinalCentres().size(), 2u);
}

TEST(System, FailedExtractionCostsItsFrameOnly) {
  Procedure procedure(test::SmallEngineConfig());
  procedure.Move(0.0, 3.0, 75);
  procedure.device().AddFailure(ScriptedVisionDevice::Operation::kExtract, 50,
                                ScriptedVisionDevice::FailurePoint::kWait, StatusCode::kDeadlineExceeded);
  procedure.Run();
  EXPECT_EQ(procedure.results()[50].state, TrackingState::kLost);
  EXPECT_EQ(procedure.results()[50].reason, TrackingReason::kDamagedFrame);
  EXPECT_EQ(procedure.results()[51].state, TrackingState::kTracking);
}

TEST(System, FullKeyframePoolRefusesKeyframesAndKeepsTracking) {
  RecordProperty("req", "MEM-001");
  EngineConfig config = test::SmallEngineConfig();
  config.memory.max_keyframes = 10;
  config.mapping.redundant_share = 0.9;  // so many stay that the pool fills on a short way
  Procedure procedure(config);
  procedure.Move(0.0, 1.5, 100);
  procedure.Run();
  EXPECT_GT(procedure.engine().mapper_counters().num_keyframes_refused, 0u);
  EXPECT_EQ(procedure.engine().atlas().keyframes().high_water(), 10u);
  EXPECT_EQ(procedure.results()[60].state, TrackingState::kTracking);
  EXPECT_EQ(CheckInvariants(procedure.engine().atlas()).ToString(), "ok");
}

TEST(System, TwoRunsGiveTheSameResultsToTheBit) {
  std::vector<FrameResult> first;
  for (int run = 0; run < 2; ++run) {
    Procedure procedure(test::SmallEngineConfig());
    procedure.Move(0.0, 2.0, 60);
    procedure.Occlude(5);
    procedure.Move(5.0, 1.5, 90);
    procedure.Run();
    if (run == 0) {
      first = procedure.results();
      continue;
    }
    ASSERT_EQ(procedure.results().size(), first.size());
    for (std::size_t i = 0; i < first.size(); ++i) {
      const FrameResult& a = first[i];
      const FrameResult& b = procedure.results()[i];
      EXPECT_EQ(a.state, b.state) << i;
      EXPECT_EQ(a.num_inliers, b.num_inliers) << i;
      EXPECT_EQ(a.cam_from_map.translation, b.cam_from_map.translation) << i;
      EXPECT_EQ(a.cam_from_map.rotation.coeffs(), b.cam_from_map.rotation.coeffs()) << i;
    }
  }
}

}  // namespace
}  // namespace haustra
