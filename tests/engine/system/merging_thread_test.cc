// Mapping and the recogniser as two threads have them, in an order that the test chooses: answers that come late, too
// late, or while the mapper gives up what they are about.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/mapping/mapper.h"
#include "engine/place/place_recogniser.h"
#include "engine/tracking/tracker.h"
#include "hal/forwarding_vision_device.h"
#include "tests/hal/ticking_clock.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

using SetKey = std::pair<std::uint32_t, std::uint32_t>;
SetKey KeyOf(FeatureSetHandle set) { return {set.index, set.generation}; }

// Remembers what is read by the recogniser, and fails the test when any of it goes.
class GuardedDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  void Guard(const PlaceTask& task) {
    const auto guard = [this](const GroupExcerpt& group) {
      for (int i = 0; i < group.num_keyframes; ++i) guarded_.insert(KeyOf(group.keyframes[i].set));
      for (const SearchedPoint& point : group.points) guarded_.insert(KeyOf(point.descriptor.set));
    };
    guarded_.insert(KeyOf(task.votes.query_set));
    for (const VoteList::Entry& entry : task.votes.entries) guarded_.insert(KeyOf(entry.set));
    if (task.stage == PlaceTask::Stage::kRetrieve) return;
    guard(task.query);
    for (int i = 0; i < task.num_candidates; ++i) guard(task.candidates[i].group);
  }
  void EndGuard() {
    formerly_guarded_.insert(guarded_.begin(), guarded_.end());
    guarded_.clear();
  }
  void ReleaseFeatureSet(FeatureSetHandle set) override {
    ForwardingVisionDevice::ReleaseFeatureSet(set);
    if (HasOwner(set)) return;
    EXPECT_FALSE(guarded_.contains(KeyOf(set))) << "set " << set.index << " is still read";
    num_released_later += formerly_guarded_.contains(KeyOf(set));
  }

  int num_released_later = 0;

 private:
  bool HasOwner(FeatureSetHandle set) {
    const bool has_owner = RetainFeatureSet(set);
    if (has_owner) ForwardingVisionDevice::ReleaseFeatureSet(set);
    return has_owner;
  }

  std::set<SetKey> guarded_, formerly_guarded_;
};

// The parts of an engine, each worked by hand.
class Parts {
 public:
  // With a clock: in real-time mode.
  explicit Parts(ScriptedColon& colon, const Clock* clock = nullptr)
      : colon_(colon),
        config_(colon.config()),
        device(colon.device()),
        scene_(colon.camera(), {}),
        link_(config_),
        places(config_, std::pmr::get_default_resource()),
        mapper(config_, colon.camera(), scene_, device, link_, places, clock, clock != nullptr, nullptr),
        recogniser_(config_, colon.camera(), scene_, colon.device()),
        tracker_(config_, colon.camera(), scene_, device, link_, nullptr) {}

  // False: there are no more frames.
  bool TrackNext() {
    const Result<Frame> frame = colon_.source().Next(kNoDeadline);
    if (!frame.ok()) return false;
    results.push_back(tracker_.Track(*frame, kNoDeadline));
    return true;
  }
  void SkipTo(std::size_t frame_index) {
    for (std::size_t i = results.size(); i < frame_index; ++i) EXPECT_TRUE(colon_.source().Next(kNoDeadline).ok());
  }
  void Map() {
    while (mapper.Step()) {
    }
    Look();
  }
  void Look() {
    if (const PlaceTask* task = places.Asked()) device.Guard(*task);
    for (MapEvent event; mapper.events().TryPop(&event);) events.push_back(event);
    for (LatePose pose; mapper.late_poses().TryPop(&pose);) {
    }
  }
  // Answers which keyframes look alike. True: the mapper has asked on, whether it is one of them.
  bool Retrieve() {
    PlaceTask* task = places.Asked();
    if (task == nullptr) return false;
    if (task->stage == PlaceTask::Stage::kVerify) return true;
    recogniser_.Recognise(task);
    device.EndGuard();
    places.Answer();
    Map();
    return places.has_question() && task->stage == PlaceTask::Stage::kVerify;
  }
  // Answers the whole question. True: a place was recognised; the mapper has not yet heard of it.
  bool Recognise() {
    if (!Retrieve()) return false;
    PlaceTask* task = places.Asked();
    recogniser_.Recognise(task);
    device.EndGuard();
    places.Answer();
    return task->is_known;
  }
  // Frame by frame, until a place was recognised of which the mapper has not yet heard. False: the video ended first.
  bool TrackUntilRecognised() {
    while (TrackNext()) {
      Map();
      if (Recognise()) return true;
      Map();
    }
    return false;
  }
  std::vector<MapEvent> EventsOf(MapEventKind kind) const {
    std::vector<MapEvent> found;
    std::copy_if(events.begin(), events.end(), std::back_inserter(found),
                 [&](const MapEvent& event) { return event.kind == kind; });
    return found;
  }
  std::uint64_t num_keyframes() const { return mapper.counters().num_keyframes; }
  bool has_proposal() { return link_.proposals.Front() != nullptr; }

 private:
  ScriptedColon& colon_;
  const EngineConfig& config_;

 public:
  GuardedDevice device;

 private:
  SceneRegion scene_;
  TrackingLink link_;

 public:
  PlaceMailbox places;
  Mapper mapper;
  std::vector<FrameResult> results;
  std::vector<MapEvent> events;

 private:
  PlaceRecogniser recogniser_;
  Tracker tracker_;
};

// Every question is answered at once; how many frames it takes until a place is recognised.
std::size_t NumFramesToRecognition() {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  Parts parts(colon);
  while (parts.TrackNext()) {
    parts.Map();
    if (parts.Recognise()) return parts.results.size();
    parts.Map();
  }
  ADD_FAILURE() << "the place is not recognised";
  return 0;
}

// The same, but the question that will be answered with yes is out.
void RunToQuestion(std::size_t num_frames, Parts& parts) {
  while (parts.results.size() < num_frames) {
    ASSERT_TRUE(parts.TrackNext());
    parts.Map();
    if (parts.results.size() == num_frames) break;
    parts.Recognise();
    parts.Map();
  }
  ASSERT_TRUE(parts.Retrieve());
}

TEST(MergingThread, MappingGoesOnAndJoinsTheMapsAsTheyAreWhenTheAnswerComes) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  Parts parts(colon);
  RunToQuestion(NumFramesToRecognition(), parts);
  const std::uint64_t before = parts.num_keyframes();
  while (parts.num_keyframes() < before + 2) {
    ASSERT_TRUE(parts.TrackNext());
    parts.Map();
    ASSERT_EQ(parts.results.back().state, TrackingState::kTracking);
  }
  ASSERT_TRUE(parts.Recognise());
  const PlaceTask& task = *parts.places.Answered();
  const KeyframeId asked = task.area.counts.keyframe_a;
  const MapId map_a = task.area.counts.map_a, map_b = task.area.counts.map_b;
  EXPECT_TRUE(parts.EventsOf(MapEventKind::kMerged).empty()) << "nobody but the mapper joins maps";
  parts.Map();
  ASSERT_EQ(parts.EventsOf(MapEventKind::kMerged).size(), 1u);
  const MapEvent merged = parts.EventsOf(MapEventKind::kMerged)[0];
  EXPECT_EQ(merged.place.keyframe_a, asked);
  EXPECT_EQ(std::set({merged.map_id, merged.other_map_id}), std::set({map_a, map_b}));
  EXPECT_EQ(CheckInvariants(parts.mapper.atlas()).ToString(), "ok");
  // Tracking changes its frame of reference in one step.
  while (parts.TrackNext()) {
    EXPECT_EQ(parts.results.back().state, TrackingState::kTracking);
    EXPECT_EQ(parts.results.back().map_id, merged.map_id);
    parts.Map();
    parts.Recognise();
  }
}

// A slice of a join is over at every look at the clock; between two of them the tracker's keyframes are taken in.
TEST(MergingThread, KeyframesAreServedBetweenTheSlicesOfAJoin) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  colon.config().merging.slice_milliseconds = 1;
  colon.config().merging.max_milliseconds = 10000;
  const TickingClock clock;
  Parts parts(colon, &clock);
  ASSERT_TRUE(parts.TrackUntilRecognised());
  const std::uint64_t before = parts.num_keyframes();
  int num_waiting = 0, longest = 0;  // steps of the mapper while a keyframe waits
  for (int step = 0; parts.EventsOf(MapEventKind::kMerged).empty(); ++step) {
    if (step % 6 == 0) {
      ASSERT_TRUE(parts.TrackNext());
      ASSERT_EQ(parts.results.back().state, TrackingState::kTracking);
    }
    const std::uint64_t num_taken = parts.num_keyframes();
    const bool is_waiting = parts.has_proposal();
    ASSERT_TRUE(parts.mapper.Step());
    parts.Look();
    num_waiting = is_waiting && parts.num_keyframes() == num_taken ? num_waiting + 1 : 0;
    longest = std::max(longest, num_waiting);
    ASSERT_EQ(CheckInvariants(parts.mapper.atlas()).ToString(), "ok");
  }
  EXPECT_GE(parts.num_keyframes(), before + 2);
  EXPECT_LE(longest, 1);
  const MapId joined = parts.EventsOf(MapEventKind::kMerged)[0].map_id;
  while (parts.TrackNext()) {
    EXPECT_EQ(parts.results.back().state, TrackingState::kTracking);
    EXPECT_EQ(parts.results.back().map_id, joined);
    parts.Map();
  }
}

// A join that was tried and given up has its event with the reason, and the maps stay as they are. When there is time
// again the next keyframe joins them.
TEST(MergingThread, JoinThatHadNoTimeIsToldAsNotJoinedAndTriedAgain) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  colon.config().merging.max_milliseconds = 1;
  const TickingClock clock;
  Parts parts(colon, &clock);
  ASSERT_TRUE(parts.TrackUntilRecognised());
  const CommonAreaCounts proven = parts.places.Answered()->area.counts;
  parts.Map();
  EXPECT_TRUE(parts.EventsOf(MapEventKind::kMerged).empty());
  std::vector<MapEvent> given_up;  // among the events of places that were not proven
  for (const MapEvent& event : parts.EventsOf(MapEventKind::kMergeRejected)) {
    if (ToString(event.place.verdict) == std::string("not_joined")) given_up.push_back(event);
  }
  ASSERT_EQ(given_up.size(), 1u);
  EXPECT_EQ(given_up[0].place.keyframe_a, proven.keyframe_a);
  EXPECT_EQ(given_up[0].map_id, proven.map_a);
  EXPECT_EQ(given_up[0].other_map_id, proven.map_b);
  EXPECT_EQ(parts.mapper.counters().num_loops_left_open, 1u);
  EXPECT_EQ(CheckInvariants(parts.mapper.atlas()).ToString(), "ok");
  colon.config().merging.max_milliseconds = 10000;
  while (parts.EventsOf(MapEventKind::kMerged).empty()) {
    ASSERT_TRUE(parts.TrackNext());
    EXPECT_EQ(parts.results.back().state, TrackingState::kTracking);
    parts.Map();
    parts.Recognise();
    parts.Map();
  }
}

TEST(MergingThread, KeyframesThatComeWhileAQuestionIsOutAreAskedAboutNewestFirst) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  Parts parts(colon);
  do {
    ASSERT_TRUE(parts.TrackNext());
    parts.Map();
  } while (!parts.Retrieve());
  const std::uint64_t before = parts.num_keyframes();
  while (parts.num_keyframes() < before + 3) {
    ASSERT_TRUE(parts.TrackNext());
    parts.Map();
  }
  EXPECT_EQ(parts.mapper.counters().num_places_skipped, 2u);
  const std::uint64_t num_asked = parts.places.num_asked();
  EXPECT_FALSE(parts.Recognise());
  EXPECT_TRUE(parts.EventsOf(MapEventKind::kMergeRejected).empty());
  parts.Map();
  const std::vector<MapEvent> rejected = parts.EventsOf(MapEventKind::kMergeRejected);
  ASSERT_FALSE(rejected.empty()) << "a rejection keeps its reason";
  for (const MapEvent& event : rejected) EXPECT_NE(event.place.verdict, CommonAreaVerdict::kAccepted);
  EXPECT_EQ(parts.places.num_asked(), num_asked + 1);
}

// A keyframe that comes when only what is needed is done goes into the map, and its place is asked for later.
TEST(MergingThread, NeededWorkTakesKeyframesAndAsksNothing) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  Parts parts(colon);
  std::uint64_t num_asked = 0;
  while (num_asked < 3) {
    ASSERT_TRUE(parts.TrackNext());
    if (!parts.has_proposal()) continue;
    const std::uint64_t num_keyframes = parts.num_keyframes(), before = parts.places.num_asked();
    while (parts.mapper.Step(MapWork::kNeeded)) continue;
    EXPECT_FALSE(parts.has_proposal());
    EXPECT_EQ(parts.places.num_asked(), before);
    if (parts.num_keyframes() != num_keyframes + 1) continue;
    ASSERT_TRUE(parts.mapper.Step()) << "it was put off";
    num_asked += parts.places.num_asked() - before;
    parts.Recognise();
    parts.Map();
  }
}

TEST(MergingThread, AnswerAboutAMapThatTrackingHasLeftIsOutdated) {
  RecordProperty("req", "MRG-002");
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  const std::size_t num_back = colon.centres().size();
  colon.Occlude(5);
  colon.Move(14.0, 17.0, 75);
  Parts parts(colon);
  RunToQuestion(NumFramesToRecognition(), parts);
  parts.SkipTo(num_back);
  const std::size_t num_maps = parts.EventsOf(MapEventKind::kMapCreated).size();
  while (parts.EventsOf(MapEventKind::kMapCreated).size() == num_maps) {
    ASSERT_TRUE(parts.TrackNext());
    parts.Map();
  }
  ASSERT_TRUE(parts.Recognise());
  parts.Map();
  EXPECT_TRUE(parts.EventsOf(MapEventKind::kMerged).empty());
  EXPECT_EQ(parts.mapper.counters().num_merges_outdated, 1u);
  ASSERT_FALSE(parts.EventsOf(MapEventKind::kMergeRejected).empty());
  EXPECT_EQ(ToString(parts.EventsOf(MapEventKind::kMergeRejected).back().place.verdict), "outdated");
  EXPECT_EQ(CheckInvariants(parts.mapper.atlas()).ToString(), "ok");
}

TEST(MergingThread, FeatureSetsStayWhileTheRecogniserMayReadThem) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  colon.Occlude(5);
  colon.Move(3.0, 8.0, 150);
  colon.Occlude(5);
  colon.Move(14.0, 10.0, 100);
  Parts parts(colon);
  // Each question is answered twelve frames late; meanwhile keyframes are culled and small maps are dropped.
  int frames_out = 0;
  while (parts.TrackNext()) {
    parts.Map();
    if (parts.places.has_question() && ++frames_out == 12) {
      parts.Recognise();
      frames_out = 0;
    }
  }
  parts.Map();
  EXPECT_GE(parts.places.num_taken(), 3u);
  EXPECT_GT(parts.mapper.counters().num_keyframes_culled, 0u);
  EXPECT_GT(parts.device.num_released_later, 0) << "nothing was given up while it was read: the test shows nothing";
  EXPECT_EQ(CheckInvariants(parts.mapper.atlas()).ToString(), "ok");
}

// Answered at once, in real-time mode, mapping and recognition give what sequential mode gives: rejections and their
// reasons, merges, poses.
TEST(MergingThread, AnsweredAtOnceItIsSequentialMode) {
  std::vector<std::vector<MapEvent>> events(2);
  std::vector<std::vector<FrameResult>> results(2);
  for (const Engine::Mode mode : {Engine::Mode::kSequential, Engine::Mode::kRealTime}) {
    const auto run = static_cast<std::size_t>(mode);
    ScriptedColon colon;
    colon.MoveAwayAndBack();
    const auto engine = colon.MakeEngine(mode, colon.device());
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      results[run].push_back(engine->Track(*frame, kNoDeadline));
      do {
        while (engine->MergeStep()) {
        }
      } while (engine->MapStep());
      for (MapEvent event; engine->map_events().TryPop(&event);) events[run].push_back(event);
    }
  }
  ASSERT_EQ(events[0].size(), events[1].size());
  int num_rejected = 0;
  for (std::size_t i = 0; i < events[0].size(); ++i) {
    EXPECT_EQ(events[0][i].kind, events[1][i].kind);
    EXPECT_EQ(events[0][i].frame_index, events[1][i].frame_index);
    EXPECT_EQ(events[0][i].place.verdict, events[1][i].place.verdict);
    EXPECT_EQ(events[0][i].place.num_inliers, events[1][i].place.num_inliers);
    num_rejected += events[0][i].kind == MapEventKind::kMergeRejected;
  }
  EXPECT_GT(num_rejected, 0);
  for (std::size_t i = 0; i < results[0].size(); ++i) {
    EXPECT_EQ(results[0][i].cam_from_map.translation, results[1][i].cam_from_map.translation) << i;
  }
}

}  // namespace
}  // namespace haustra::test
