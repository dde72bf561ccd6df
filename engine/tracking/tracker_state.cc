#include "engine/tracking/tracker_state.h"

#include "hal/core/check.h"

namespace haustra {
namespace {

void Carry(const Reframing& reframing, Course* course) {
  MapId map_id = course->map_id;
  reframing.Carry(&map_id, &course->keyframe_from_map);
  reframing.Carry(&course->map_id, &course->cam_from_map);
}

void Carry(const Reframing& reframing, std::optional<Course>* course) {
  if (course->has_value()) Carry(reframing, &**course);
}

// What each state makes of each reply. A state that a reply does not concern has no function for it.
struct Listener {
  TrackerState& state;

  template <typename State, typename Reply>
  void operator()(const State&, const Reply&) const {}

  void operator()(Lost& lost, const FrameFound& found) const {
    lost.start = Start{true, found.map_id, found.cam_from_map, found.frame_index};
    lost.is_asking = false;
  }
  void operator()(Lost& lost, const FrameNotFound&) const { lost.is_asking = false; }
  void operator()(Lost& lost, const Reframing& reframing) const {
    Carry(reframing, &lost.course);
    if (lost.start) reframing.Carry(&lost.start->map_id, &lost.start->cam_from_map);
  }

  void operator()(AwaitingMap& awaiting, const MapFounded& founded) const {
    if (founded.proposal != awaiting.proposal) return;
    state = Lost{awaiting.course, Start{false, founded.map_id, founded.cam_from_map, awaiting.frame_index}, false};
  }
  void operator()(AwaitingMap& awaiting, const MapRefused& refused) const {
    if (refused.proposal == awaiting.proposal) state = Lost{awaiting.course, std::nullopt, false};
  }
  // The mapper refuses the proposal when it comes to it.
  void operator()(AwaitingMap& awaiting, const FrameFound& found) const {
    state = Lost{awaiting.course, Start{true, found.map_id, found.cam_from_map, found.frame_index}, false};
  }
  void operator()(AwaitingMap& awaiting, const Reframing& reframing) const { Carry(reframing, &awaiting.course); }

  void operator()(Tracking& tracking, const Reframing& reframing) const {
    if (tracking.course.map_id != reframing.old_map_id) return;
    Carry(reframing, &tracking.course);
    if (!reframing.keeps_shape) tracking.velocity.reset();
    if (tracking.velocity) tracking.velocity->translation *= reframing.new_from_old.scale;
  }
};

}  // namespace

TrackingState StateOf(const TrackerState& state) {
  if (std::holds_alternative<Tracking>(state)) return TrackingState::kTracking;
  const Lost* lost = std::get_if<Lost>(&state);
  const std::optional<Course>& course = lost != nullptr ? lost->course : std::get<AwaitingMap>(state).course;
  return course ? TrackingState::kLost : TrackingState::kInitialising;
}

void Hear(const MapReply& reply, TrackerState* state) { std::visit(Listener{*state}, *state, reply); }

Tracking GoOnFrom(const Start& start, TimePoint now) {
  Tracking tracking;
  tracking.course = {start.map_id, start.cam_from_map, start.frame_index, start.cam_from_map, now};
  tracking.is_confirmed = !start.is_found;
  return tracking;
}

Tracking Regain(const Lost& lost, MapId map_id) {
  HAUSTRA_CHECK(lost.course.has_value());
  Tracking tracking;
  tracking.course = *lost.course;
  tracking.course.map_id = map_id;
  return tracking;
}

Lost LostFrom(const Tracking& tracking) { return {tracking.course, std::nullopt, false}; }

AwaitingMap Await(const Lost& lost, std::uint64_t proposal, std::uint32_t frame_index) {
  return {proposal, frame_index, lost.course};
}

}  // namespace haustra
