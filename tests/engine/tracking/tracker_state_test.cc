// The tracker's states and what changes them, as tables.
#include "engine/tracking/tracker_state.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace haustra {
namespace {

constexpr MapId kHere = 3, kElsewhere = 8;
const SE3 kPose(ExpSO3({0.1, 0.2, 0.0}), {1.0, 2.0, 3.0});
const SE3 kOther(ExpSO3({0.0, -0.3, 0.1}), {0.5, 0.0, -1.0});
const Sim3 kMove(2.0, ExpSO3({0.0, 0.0, 0.5}), {4.0, 5.0, 6.0});

Course ACourse() { return {kHere, kPose, 40, kOther, TimePoint(std::chrono::milliseconds(1500))}; }
Start AStart(bool is_found) { return {is_found, kElsewhere, kOther, 41}; }

Lost NoMapYet() { return {}; }
Lost Asking() { return {ACourse(), std::nullopt, true}; }
Lost WithStart() { return {ACourse(), AStart(true), false}; }
AwaitingMap Awaiting() { return {7, 44, ACourse()}; }
Tracking InSight() {
  Tracking tracking;
  tracking.course = ACourse();
  tracking.velocity = kOther;
  return tracking;
}

// What can be told of a state in a few words.
std::string Say(const TrackerState& state) {
  if (const Lost* lost = std::get_if<Lost>(&state)) {
    std::string text = "lost";
    if (lost->is_asking) text += " asking";
    if (lost->start) text += lost->start->is_found ? " with a found start" : " with a founded start";
    return text + (lost->course ? "" : " for ever");
  }
  if (const AwaitingMap* awaiting = std::get_if<AwaitingMap>(&state)) {
    return "awaiting " + std::to_string(awaiting->proposal) + (awaiting->course ? "" : " for the first time");
  }
  return "tracking in " + std::to_string(std::get<Tracking>(state).course.map_id);
}

TEST(TrackerState, RepliesLeadWhereTheTableSays) {
  const MapReply founded = MapFounded{7, kElsewhere, kPose}, founded_other = MapFounded{6, kElsewhere, kPose};
  const MapReply refused = MapRefused{7}, refused_other = MapRefused{6};
  const MapReply found = FrameFound{42, kElsewhere, kPose}, not_found = FrameNotFound{};
  const MapReply moved = Reframing{kHere, kElsewhere, kMove}, moved_other = Reframing{99, 99, kMove};
  struct Row {
    TrackerState before;
    MapReply reply;
    std::string after;
  };
  const std::vector<Row> table = {
      // A founding that was overtaken by a found frame is refused when nobody waits any more.
      {Asking(), founded, "lost asking"},
      {Asking(), refused, "lost asking"},
      {Asking(), found, "lost with a found start"},
      {Asking(), not_found, "lost"},
      {Asking(), moved, "lost asking"},
      {NoMapYet(), found, "lost with a found start for ever"},
      {WithStart(), found, "lost with a found start"},
      {WithStart(), refused, "lost with a found start"},
      {Awaiting(), founded, "lost with a founded start"},
      {Awaiting(), founded_other, "awaiting 7"},
      {Awaiting(), refused, "lost"},
      {Awaiting(), refused_other, "awaiting 7"},
      {Awaiting(), found, "lost with a found start"},
      {Awaiting(), not_found, "awaiting 7"},
      {Awaiting(), moved, "awaiting 7"},
      {InSight(), founded, "tracking in 3"},
      {InSight(), refused, "tracking in 3"},
      {InSight(), found, "tracking in 3"},
      {InSight(), not_found, "tracking in 3"},
      {InSight(), moved, "tracking in 8"},
      {InSight(), moved_other, "tracking in 3"},
  };
  for (const Row& row : table) {
    TrackerState state = row.before;
    Hear(row.reply, &state);
    EXPECT_EQ(Say(state), row.after) << Say(row.before) << ", reply " << row.reply.index();
  }
}

TEST(TrackerState, OwnFindingsLeadWhereTheTableSays) {
  const TimePoint now(std::chrono::milliseconds(2000));
  const std::pair<TrackerState, std::string> table[] = {
      {GoOnFrom(AStart(true), now), "tracking in 8"},  {GoOnFrom(AStart(false), now), "tracking in 8"},
      {Regain(Asking(), kElsewhere), "tracking in 8"}, {LostFrom(InSight()), "lost"},
      {Await(Asking(), 9, 50), "awaiting 9"},          {Await(NoMapYet(), 9, 50), "awaiting 9 for the first time"},
  };
  for (const auto& [state, text] : table) EXPECT_EQ(Say(state), text);
}

TEST(TrackerState, FramesAreAnsweredAsInitialisingUntilAMapWasTracked) {
  EXPECT_EQ(StateOf(NoMapYet()), TrackingState::kInitialising);
  EXPECT_EQ(StateOf(Await(NoMapYet(), 1, 0)), TrackingState::kInitialising);
  EXPECT_EQ(StateOf(Asking()), TrackingState::kLost);
  EXPECT_EQ(StateOf(Awaiting()), TrackingState::kLost);
  EXPECT_EQ(StateOf(InSight()), TrackingState::kTracking);
  EXPECT_EQ(StateOf(LostFrom(GoOnFrom(AStart(false), TimePoint{}))), TrackingState::kLost);
}

TEST(TrackerState, FoundedMapStartsAtItsSecondViewAndAFoundFrameAtItself) {
  TrackerState state = Awaiting();
  Hear(MapFounded{7, kElsewhere, kPose}, &state);
  const Start founded = std::get<Lost>(state).start.value();
  EXPECT_EQ(founded.frame_index, 44u);
  EXPECT_EQ(founded.map_id, kElsewhere);
  EXPECT_EQ(founded.cam_from_map.translation, kPose.translation);
  state = Awaiting();
  Hear(FrameFound{42, kElsewhere, kPose}, &state);
  EXPECT_EQ(std::get<Lost>(state).start.value().frame_index, 42u);
}

// Map by map: what is held in the one that was moved, and nothing else.
TEST(TrackerState, PosesGoAlongWithTheirMapInEveryState) {
  const SE3 pose = TransformPose(kPose, kMove), other = TransformPose(kOther, kMove);
  const auto expect_moved = [&](const Course& course) {
    EXPECT_EQ(course.map_id, kElsewhere);
    EXPECT_EQ(course.cam_from_map.translation, pose.translation);
    EXPECT_EQ(course.keyframe_from_map.translation, other.translation);
    EXPECT_EQ(course.frame_index, 40u);
  };
  const Reframing moved{kHere, kElsewhere, kMove};
  TrackerState state = InSight();
  Hear(moved, &state);
  expect_moved(std::get<Tracking>(state).course);
  EXPECT_EQ(std::get<Tracking>(state).velocity->translation, kMove.scale * kOther.translation);
  state = Awaiting();
  Hear(moved, &state);
  expect_moved(*std::get<AwaitingMap>(state).course);
  state = WithStart();
  Hear(moved, &state);
  expect_moved(*std::get<Lost>(state).course);
  EXPECT_EQ(std::get<Lost>(state).start->cam_from_map.translation, kOther.translation) << "it is in another map";
  Hear(Reframing{kElsewhere, kHere, kMove}, &state);
  EXPECT_EQ(std::get<Lost>(state).start->map_id, kHere);
  EXPECT_EQ(std::get<Lost>(state).start->cam_from_map.translation, other.translation);
}

TEST(TrackerState, StartThatIsTriedBeginsACourseOfItsOwn) {
  const TimePoint now(std::chrono::milliseconds(2000));
  const Tracking tracking = GoOnFrom(AStart(true), now);
  EXPECT_EQ(tracking.course.frame_index, 41u);
  EXPECT_EQ(tracking.course.keyframe_time, now);
  EXPECT_EQ(tracking.course.keyframe_from_map.translation, kOther.translation);
  EXPECT_FALSE(tracking.velocity.has_value());
  EXPECT_FALSE(tracking.has_last_frame);
  // A found pose is to be confirmed; the map began with that of its second view.
  EXPECT_FALSE(tracking.is_confirmed);
  EXPECT_TRUE(GoOnFrom(AStart(false), now).is_confirmed);
  EXPECT_FALSE(Regain(Asking(), kHere).is_confirmed);
  // Found again by itself it goes on with the old one.
  EXPECT_EQ(Regain(Asking(), kHere).course.keyframe_time, ACourse().keyframe_time);
}

}  // namespace
}  // namespace haustra
