// What the tracker knows between two frames, as a state machine: a pose in a map, none, or none while a map is being
// made. Each state has its own data and no other. The mapper's replies (map_reply.h) change the state through Hear
// alone, what the tracker finds by the functions below it; tracker_state_test.cc has all of it as a table.
//
//   Lost         no pose. It may have a start: a pose in a map from which the next good frame tries to go on
//   AwaitingMap  no pose; two views were proposed as a new map, and the mapper has not answered
//   Tracking     the last measured frame had a pose
//
// Plain data, nothing is allocated. thread-bound(tracking).
#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "engine/atlas/handles.h"
#include "engine/geometry/se3.h"
#include "engine/tracking/frame_result.h"
#include "engine/tracking/map_reply.h"
#include "hal/core/time.h"

namespace haustra {

// Where the scope was last, in map `map_id` as of the last reply heard.
struct Course {
  MapId map_id = kNoId;
  SE3 cam_from_map;
  std::uint32_t frame_index = 0;
  // The last keyframe that was proposed, or where the course began.
  SE3 keyframe_from_map;
  TimePoint keyframe_time;
};

// A pose of an earlier frame that the mapper has answered with.
struct Start {
  bool is_found = false;  // in a stored map; else it is the second view of a new one
  MapId map_id = kNoId;
  SE3 cam_from_map;
  std::uint32_t frame_index = 0;
};

struct Lost {
  std::optional<Course> course;  // none: no map was ever tracked
  std::optional<Start> start;
  bool is_asking = false;  // the mapper looks for a frame of ours and has not answered
};

struct AwaitingMap {
  std::uint64_t proposal = 0;
  std::uint32_t frame_index = 0;  // of the second view
  std::optional<Course> course;
};

struct Tracking {
  Course course;
  std::optional<SE3> velocity;   // cam_now_from_cam_before, one frame
  KeyframeId reference = kNoId;  // keyframe that the last pose was given relative to
  bool has_last_frame = false;   // what it showed can be searched in the next one
  // The last pose is one that the map knows: the map began with it, or it was tracked. One that was chosen without a
  // prediction is not before the next frame confirms it.
  bool is_confirmed = false;
};

using TrackerState = std::variant<Lost, AwaitingMap, Tracking>;

// What a frame in this state is answered with.
TrackingState StateOf(const TrackerState& state);

// The mapper's reply. What does not concern the state leaves it as it is: the refusal of a founding that was overtaken
// by a found frame, say.
void Hear(const MapReply& reply, TrackerState* state);

// Lost, a start is tried: as if its frame had just been tracked. `now`: of the frame that tries.
Tracking GoOnFrom(const Start& start, TimePoint now);
// Lost, and found again in map `map_id` by the tracker itself. Needs a course: without one there was no map.
Tracking Regain(const Lost& lost, MapId map_id);
// Tracking, and no pose.
Lost LostFrom(const Tracking& tracking);
// Lost, and a new map was proposed.
AwaitingMap Await(const Lost& lost, std::uint64_t proposal, std::uint32_t frame_index);

}  // namespace haustra
