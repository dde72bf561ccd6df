// Scripted events that make tracking hard: what happens, when, and which frames it hides. reentrant.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra::render {

enum class EventKind {
  kRedout,      // the wall or a fold lies on the lens: red, bright, no detail
  kWater,       // a film of water runs over the lens
  kBubbles,     // water jet: foam and drops
  kDebris,      // turbid water and flecks
  kBlur,        // shaking hand and a long exposure
  kJump,        // the scope slips and turns fast, and the hand makes it up
  kSlip,        // the scope slides along the lumen by centimetres and goes on from there
  kNarrowBand,  // another light: the scene is seen, in other colours
  kInstrument,  // forceps in view: the scene is seen beside them
};
std::string_view ToString(EventKind kind);
std::vector<std::string_view> EventKindNames();
// Whether its frames count as such in which the scene cannot be seen. Events that do not hide it leave the path of the
// scope as it is.
bool HidesScene(EventKind kind);

struct Event {
  EventKind kind = EventKind::kRedout;
  double start_s = 0.0;
  double duration_s = 1.0;

  // 0 outside, 1 in the middle, with ramps of at most 0.16 s inside of the event.
  double Envelope(double time_s) const;
};

// "redout@8+1.4" or "redout@8" (with the kind's usual duration); several joined by commas; "none" or nothing: no
// events. kInvalidArgument names the part that is wrong.
Result<std::vector<Event>> ParseEvents(std::string_view script);

struct FrameSpan {
  int first_frame = 0, last_frame = 0;
  EventKind kind = EventKind::kRedout;
};
// The frames that each event touches, within [0, num_frames); in order. Events wholly outside are left out.
std::vector<FrameSpan> FrameSpans(const std::vector<Event>& events, double rate_hz, int num_frames);
// Those that hide the scene.
std::vector<FrameSpan> HiddenSpans(const std::vector<FrameSpan>& spans);

}  // namespace haustra::render
