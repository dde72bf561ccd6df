// Long procedures in pools that are far too small: what goes, what stays, and that nothing breaks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/io/atlas_reader.h"
#include "hal/fakes/manual_clock.h"
#include "platform/session/session.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using test::ScriptedColon;

// In the order in which they come: the answers, with late poses filled in.
class Observer final : public test::RecordingObserver {
 public:
  void OnLatePose(const LatePose& pose) override {
    for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame) {
      if (frame->result.frame_index != pose.frame_index) continue;
      frame->result.reference_keyframe = pose.reference_keyframe;
      frame->result.cam_from_reference = pose.cam_from_reference;
      frame->result.reference_scale = pose.reference_scale;
      return;
    }
  }
};

// More keyframes stay than by default, so that pools fill on a short way.
EngineConfig CrowdedConfig() {
  EngineConfig config = test::SmallEngineConfig();
  config.mapping.redundant_share = 0.9;
  return config;
}

struct Outcome {
  std::unique_ptr<ScriptedColon> colon;
  std::unique_ptr<Engine> engine;
  Observer observer;

  int NumEvents(MapEventKind kind) const {
    return static_cast<int>(std::count_if(observer.events.begin(), observer.events.end(),
                                          [&](const MapEvent& event) { return event.kind == kind; }));
  }
  int NumLocalised() const {
    int num = 0;
    ResolvedPose pose;
    for (const FrameOutcome& frame : observer.frames) num += engine->Resolve(frame.result, &pose);
    return num;
  }
  // Root mean square distance of the camera centres from the truth, after one similarity a map.
  double RmsError() const {
    std::map<MapId, std::pair<std::vector<Eigen::Vector3d>, std::vector<Eigen::Vector3d>>> maps;
    for (const FrameOutcome& frame : observer.frames) {
      ResolvedPose pose;
      if (!engine->Resolve(frame.result, &pose)) continue;
      maps[pose.map_id].first.push_back(pose.cam_from_map.InverseTranslation());
      maps[pose.map_id].second.push_back(colon->centres()[frame.result.frame_index]);
    }
    double sum = 0.0;
    std::size_t num = 0;
    for (const auto& [id, centres] : maps) {
      Sim3 truth_from_map;
      if (centres.first.size() < 10 || !AlignSim3(centres.first, centres.second, &truth_from_map)) continue;
      for (std::size_t i = 0; i < centres.first.size(); ++i) {
        sum += (truth_from_map * centres.first[i] - centres.second[i]).squaredNorm();
      }
      num += centres.first.size();
    }
    return num > 0 ? std::sqrt(sum / static_cast<double>(num)) : 0.0;
  }
};

Outcome RunIn(const EngineConfig& config, void (*script)(ScriptedColon*)) {
  Outcome outcome;
  outcome.colon = std::make_unique<ScriptedColon>(TimePoint{}, config);
  script(outcome.colon.get());
  outcome.engine = outcome.colon->MakeEngine();
  const std::atomic<bool> never{false};
  const auto session = RunSequential(outcome.colon->source(), *outcome.engine, ManualClock(), outcome.observer, never);
  EXPECT_TRUE(session.ok());
  return outcome;
}

// Five places that have nothing in common (one sees 3 units far).
void FivePlaces(ScriptedColon* colon) {
  for (int place = 0; place < 5; ++place) {
    colon->Move(4.2 * place, 4.2 * place + 1.0, 40);
    colon->Occlude(5);
  }
}

// And back from the last over the one before it.
void FivePlacesAndBack(ScriptedColon* colon) {
  FivePlaces(colon);
  colon->Move(17.8, 12.6, 110);
}

// One place only, without a loss: everything is in the active map.
void OneLongWay(ScriptedColon* colon) { colon->Move(0.0, 7.0, 180); }

void ExpectSound(const Outcome& outcome) {
  EXPECT_EQ(CheckInvariants(outcome.engine->atlas()).ToString(), "ok");
  // The device's sets: those of the keyframes, and what tracking holds of the last frame.
  const auto& atlas = outcome.engine->atlas();
  const int in_use = outcome.colon->device().plan().max_feature_sets - outcome.colon->device().num_free_feature_sets();
  EXPECT_GE(in_use, static_cast<int>(atlas.keyframes().size()));
  EXPECT_LE(in_use, static_cast<int>(atlas.keyframes().size()) + 50);
}

TEST(TinyPools, KeyframesOfInactiveMapsMakeRoomAndNoFrameIsLost) {
  const Outcome plenty = RunIn(CrowdedConfig(), FivePlacesAndBack);
  ASSERT_EQ(plenty.engine->evictions().num_keyframes, 0u);
  ASSERT_GT(plenty.engine->atlas().keyframes().high_water(), 55u);
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 45;
  const Outcome tight = RunIn(config, FivePlacesAndBack);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->evictions().num_keyframes, 10u);
  EXPECT_EQ(tight.engine->mapper_counters().num_keyframes_refused, 0u);
  EXPECT_EQ(tight.engine->atlas().keyframes().high_water(), 45u);
  // Within two points of a hundred.
  const auto num_frames = static_cast<double>(plenty.observer.frames.size());
  EXPECT_GE(tight.NumLocalised(), plenty.NumLocalised() - 0.02 * num_frames);
  // Thinned maps are found again and joined.
  EXPECT_GE(tight.NumEvents(MapEventKind::kMerged) + tight.NumEvents(MapEventKind::kFrameFound), 1);
  EXPECT_LT(tight.RmsError(), 0.08);
}

TEST(TinyPools, EvictionRepeatsToTheBit) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 20;
  const Outcome a = RunIn(config, FivePlaces);
  const Outcome b = RunIn(config, FivePlaces);
  EXPECT_EQ(a.engine->evictions().num_keyframes, b.engine->evictions().num_keyframes);
  ASSERT_EQ(a.observer.frames.size(), b.observer.frames.size());
  for (std::size_t i = 0; i < a.observer.frames.size(); ++i) {
    ResolvedPose pose_a, pose_b;
    const bool has_pose = a.engine->Resolve(a.observer.frames[i].result, &pose_a);
    ASSERT_EQ(has_pose, b.engine->Resolve(b.observer.frames[i].result, &pose_b)) << i;
    if (!has_pose) continue;
    ASSERT_EQ(pose_a.cam_from_map.translation, pose_b.cam_from_map.translation) << i;
    ASSERT_EQ(pose_a.map_id, pose_b.map_id) << i;
  }
}

TEST(TinyPools, OneActiveMapThinsOutBehindTheScope) {
  const Outcome plenty = RunIn(CrowdedConfig(), OneLongWay);
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 26;
  const Outcome tight = RunIn(config, OneLongWay);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->evictions().num_keyframes, 5u);
  EXPECT_GE(tight.NumLocalised(), plenty.NumLocalised() - 5);
  EXPECT_LT(tight.RmsError(), plenty.RmsError() + 0.1);
}

TEST(TinyPools, SmallMapsGoAsAWholeWhenNothingElseIsLeft) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 20;
  const Outcome tight = RunIn(config, FivePlaces);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->evictions().num_maps, 0u);
  EXPECT_EQ(static_cast<std::uint64_t>(tight.NumEvents(MapEventKind::kMapEvicted)), tight.engine->evictions().num_maps);
  // Of the last place every frame is there.
  EXPECT_GT(tight.NumLocalised(), 20);
  // The evicted ones have no frames left, and say so.
  for (const MapEvent& event : tight.observer.events) {
    if (event.kind != MapEventKind::kMapEvicted) continue;
    for (const FrameOutcome& frame : tight.observer.frames) {
      ResolvedPose pose;
      if (tight.engine->Resolve(frame.result, &pose)) {
        EXPECT_NE(pose.map_id, event.map_id);
      }
    }
  }
}

TEST(TinyPools, MapPointsMakeRoom) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_map_points = 2400;
  const Outcome tight = RunIn(config, FivePlaces);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->evictions().num_points, 100u);
  EXPECT_LE(tight.engine->atlas().points().high_water(), 2400u);
  EXPECT_EQ(tight.observer.frames[30].result.state, TrackingState::kTracking);
  // The last place, too: its last five frames are dark.
  EXPECT_EQ(tight.observer.frames[tight.observer.frames.size() - 6].result.state, TrackingState::kTracking);
}

TEST(TinyPools, EntriesOfMapsThatHaveGoneAreUsedAgain) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_maps = 3;
  const Outcome tight = RunIn(config, FivePlaces);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->evictions().num_map_entries, 0u);
  EXPECT_EQ(tight.engine->mapper_counters().num_maps_refused, 0u);
  EXPECT_LE(tight.engine->atlas().maps().high_water(), 3u);
  EXPECT_GE(tight.NumEvents(MapEventKind::kMapCreated), 4);
}

TEST(TinyPools, IdsThatHaveAllBeenGivenRefuseKeyframesAndAreCounted) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 20;
  config.memory.max_keyframe_ids = 30;
  const Outcome tight = RunIn(config, OneLongWay);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->mapper_counters().num_keyframe_ids_refused, 0u);
  EXPECT_EQ(tight.engine->atlas().num_keyframe_ids(), 30u);
}

// However long it goes on: tracking needs a set for every frame.
TEST(TinyPools, RefusedKeyframesKeepNoFeatureSets) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 20;
  config.memory.max_keyframe_ids = 30;
  ScriptedColon colon(TimePoint{}, config);
  OneLongWay(&colon);
  colon.Move(7.0, 3.0, 100);
  const auto engine = colon.MakeEngine();
  std::uint64_t num_refused = 0;
  int num_free = 0;
  FrameResult result;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    const bool is_first_refused = num_refused == 0;
    result = engine->Track(*frame, kNoDeadline);
    while (engine->BackgroundStep()) continue;
    num_refused = engine->mapper_counters().num_keyframes_refused;
    if (is_first_refused) num_free = colon.device().num_free_feature_sets();
  }
  ASSERT_GE(num_refused, 30u);
  EXPECT_EQ(result.state, TrackingState::kTracking);
  EXPECT_EQ(colon.device().num_free_feature_sets(), num_free) << "after " << num_refused << " refused keyframes";
}

TEST(TinyPools, FullRingsLoseTheNewestAndCountIt) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_map_events = 4;
  ScriptedColon colon(TimePoint{}, config);
  FivePlaces(&colon);
  const auto engine = colon.MakeEngine();
  // Nobody reads the events.
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    (void)engine->Track(*frame, kNoDeadline);
    while (engine->BackgroundStep()) continue;
  }
  EXPECT_EQ(engine->map_events().size(), 4u);
  EXPECT_GT(engine->map_events().num_dropped(), 0u);
  MapEvent first;
  ASSERT_TRUE(engine->map_events().TryPop(&first));
  EXPECT_EQ(first.kind, MapEventKind::kMapCreated);
}

TEST(TinyPools, LatePosesThatNobodyReadsAreLostAndCounted) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_late_poses = 1;
  ScriptedColon colon(TimePoint{}, config);
  FivePlaces(&colon);
  const auto engine = colon.MakeEngine();
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    (void)engine->Track(*frame, kNoDeadline);
    while (engine->BackgroundStep()) continue;
  }
  EXPECT_EQ(engine->late_poses().size(), 1u);
  EXPECT_GT(engine->late_poses().num_dropped(), 0u);
}

// Answers of a tracker whose mapper stands still while the scope comes to a new place.
std::vector<FrameResult> TrackWithABusyMapper(ScriptedColon& colon, Engine& engine) {
  colon.Move(0.0, 2.0, 60);
  colon.Occlude(5);
  colon.Move(10.0, 13.0, 90);
  std::vector<FrameResult> results;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    results.push_back(engine.Track(*frame, kNoDeadline));
    if (frame->index >= 40 && frame->index < 110) continue;
    while (engine.BackgroundStep()) continue;
  }
  EXPECT_EQ(CheckInvariants(engine.atlas()).ToString(), "ok");
  return results;
}

TEST(TinyPools, SmallestRingHoldsWhatTrackingProposesWhileTheMapperIsBusy) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_proposals = 2;
  ScriptedColon colon(TimePoint{}, config);
  const auto engine = colon.MakeEngine();
  const std::vector<FrameResult> results = TrackWithABusyMapper(colon, *engine);
  EXPECT_EQ(engine->num_proposals_refused(), 0u);
  EXPECT_EQ(results[39].state, TrackingState::kTracking);
  EXPECT_EQ(results.back().state, TrackingState::kTracking);
  EXPECT_NE(results.back().map_id, results[39].map_id);
}

// Less than a configuration may ask for: the request for a lost frame's place takes the room of a new map.
TEST(TinyPools, ProposalsThatFindTheRingFullAreCountedAndLeaveNothingBehind) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_proposals = 1;
  ScriptedColon colon(TimePoint{}, config);
  const auto engine = colon.MakeEngine();
  (void)TrackWithABusyMapper(colon, *engine);
  EXPECT_GT(engine->num_proposals_refused(), 0u);
  const int in_use = colon.device().plan().max_feature_sets - colon.device().num_free_feature_sets();
  EXPECT_LE(in_use, static_cast<int>(engine->atlas().keyframes().size()) + 50);
}

TEST(TinyPools, SnapshotWithoutRoomLeavesOutWhatIsFarAndIsCounted) {
  EngineConfig config = CrowdedConfig();
  const Outcome plenty = RunIn(config, OneLongWay);
  EXPECT_EQ(plenty.engine->mapper_counters().num_snapshots_cut, 0u);
  config.memory.max_local_points = 600;
  const Outcome tight = RunIn(config, OneLongWay);
  ExpectSound(tight);
  EXPECT_GT(tight.engine->mapper_counters().num_snapshots_cut, 0u);
  EXPECT_GE(tight.NumLocalised(), plenty.NumLocalised() - 5);
  EXPECT_LT(tight.RmsError(), plenty.RmsError() + 0.1);
}

TEST(TinyPools, WithoutAFeatureSetAFrameIsLostAndTheNextIsNot) {
  ScriptedColon colon;
  colon.Move(0.0, 2.0, 60);
  const auto engine = colon.MakeEngine();
  std::vector<FeatureSetHandle> taken;
  std::vector<FrameResult> results;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    if (frame->index == 40) {
      for (auto set = colon.device().CreateFeatureSet(); set.ok(); set = colon.device().CreateFeatureSet()) {
        taken.push_back(*set);
      }
    }
    results.push_back(engine->Track(*frame, kNoDeadline));
    while (engine->BackgroundStep()) continue;
    for (const FeatureSetHandle set : taken) colon.device().ReleaseFeatureSet(set);
    taken.clear();
  }
  EXPECT_EQ(results[39].state, TrackingState::kTracking);
  EXPECT_EQ(results[40].reason, TrackingReason::kDamagedFrame);
  EXPECT_EQ(engine->num_feature_sets_refused(), 1u);
  EXPECT_EQ(results[42].state, TrackingState::kTracking);
}

TEST(TinyPools, ThinnedAtlasIsSavedAndLoaded) {
  EngineConfig config = CrowdedConfig();
  config.memory.max_keyframes = 24;
  const Outcome tight = RunIn(config, FivePlaces);
  ASSERT_GT(tight.engine->evictions().num_keyframes, 0u);
  StringSink sink;
  ASSERT_TRUE(tight.engine->SaveAtlas(sink).ok());
  ScriptedColon next(TimePoint{}, config);
  const auto engine = next.MakeEngine();
  const std::vector<std::uint8_t> file(sink.bytes().begin(), sink.bytes().end());
  const Status loaded = engine->LoadAtlas(file);
  ASSERT_TRUE(loaded.ok()) << loaded.ToString();
  EXPECT_EQ(engine->atlas().keyframes().size(), tight.engine->atlas().keyframes().size());
  EXPECT_EQ(CheckInvariants(engine->atlas()).ToString(), "ok");
}

}  // namespace
}  // namespace haustra
