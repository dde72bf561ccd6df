// The answer to one frame.
#pragma once

#include <cstdint>
#include <string_view>

#include "engine/atlas/handles.h"
#include "engine/geometry/se3.h"
#include "engine/scheduler/frame_budget.h"
#include "hal/core/time.h"

namespace haustra {

enum class TrackingState : std::uint8_t { kInitialising, kTracking, kLost };

// Why there is no pose, or how it came about.
enum class TrackingReason : std::uint8_t {
  kTracked,             // guided search around the prediction
  kRecovered,           // brute force against the local map while tracking
  kRelocalised,         // brute force against the last map after a loss
  kPredicted,           // not measured: there was no time, and the scope is taken to keep its course
  kDamagedFrame,        // the frame could not be read or extracted
  kFewFeatures,         // the picture shows too little (occlusion, blur)
  kFewMatches,          // hardly anything of the map was found
  kFewInliers,          // no pose agrees with enough of what was found
  kWeakEvidence,        // no more of the map agrees with the pose than chance would give (film, bubbles, wrong place)
  kInconsistentMotion,  // the pose jumped further than a scope can move
  kDeniedByFlow,        // optical flow since the last certain pose says otherwise
  kFirstView,           // initialisation: nothing to compare with yet; the first view of what may become a new map
  kLowParallax,         // initialisation: the views are too near each other
  kNoEpipolarGeometry,  // initialisation: no motion explains the matches
  kUncertainMotion,     // initialisation: the matches leave open in which direction the scope travelled
  kLowSpread,           // initialisation: the points cover too little of the image
  kMapProposed,         // initialisation: two views were handed to the mapper
  kAwaitingMap,         // initialisation: the mapper has not answered yet
  kNoTime,              // the deadline left no time to look
};

// What became of the search for the frame by brute force in all of the map that was tracked last: the gate that it
// failed at, in the order in which they are asked.
enum class SearchOutcome : std::uint8_t {
  kNotSearched,     // there was no need or no time, or the mapper looks already
  kFound,           // there is a pose; the reason of the frame says whether it counts
  kNoAnswer,        // the device failed, or the deadline came first
  kFewMatches,      // the descriptors agree in too few places
  kNoPose,          // no pose explains enough of the matches
  kFewInliers,      // with what else should be in sight no pose agrees any more
  kWeakEvidence,    // too little agrees, or hardly more than would by chance
  kLowMatchShare,   // the wall looks alike, but most matches contradict the pose
  kLowSpread,       // what agrees covers too little of the picture
  kFewEstablished,  // hardly any point that has proved itself agrees
  kUncertain,       // what agrees does not hold all six degrees of freedom
  kDeniedByFlow,    // optical flow since the last certain pose says otherwise
};

std::string_view ToString(TrackingState state);
std::string_view ToString(TrackingReason reason);
std::string_view ToString(SearchOutcome outcome);

struct FrameResult {
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  TrackingState state = TrackingState::kInitialising;
  TrackingReason reason = TrackingReason::kFirstView;
  SearchOutcome search = SearchOutcome::kNotSearched;
  // While tracking: pose in the map that is active now, and relative to a keyframe, so that the final pose can be had
  // from Engine::Resolve when the map has been optimised, merged or moved since.
  MapId map_id = kNoId;
  // Reframings (engine/atlas/reframing.h) so far. Two poses compare only when map and epoch agree.
  std::uint64_t map_epoch = 0;
  SE3 cam_from_map;
  KeyframeId reference_keyframe = kNoId;
  SE3 cam_from_reference;
  double reference_scale = 1.0;
  int num_features = 0;
  int num_matches = 0;
  int num_inliers = 0;
  int num_expected = 0;     // established points of the map that should have been seen
  int num_established = 0;  // those that were
  bool is_keyframe = false;
  // Real-time mode: how far down the ladder the frame went to keep its deadline, and what its stages took (0 without a
  // clock).
  Rung rung = Rung::kFull;
  StageTimes times{};
};

}  // namespace haustra
