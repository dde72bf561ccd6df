// What the run is compared with: the true poses, and which frames show the scene at all.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "capture/ground_truth.h"
#include "engine/geometry/se3.h"
#include "tools/evaluate/run_output.h"

namespace haustra::evaluate {

// Frames first to last (both included) of the sequence in which something happens.
struct SequenceEvent {
  std::int64_t first_frame = 0;
  std::int64_t last_frame = 0;
  std::string kind;
  bool is_visible = true;  // whether the scene can be seen
};

struct Reference {
  std::vector<GroundTruthPose> poses;                // by time
  std::string unit = "units";                        // of the poses' lengths: mm, m, or not known
  std::optional<std::vector<SequenceEvent>> events;  // nothing: not known, all frames count as clear
  std::vector<std::int64_t> frame_stamps_ns;         // times.txt of the sequence, if it lies beside the events
};

// groundtruth: any trajectory that capture/ground_truth.h reads; empty: no poses. events: file with first_frame,
// last_frame, kind, visible (0 or 1); empty: events.csv beside the ground truth, if it is there and is such a file. The
// unit is taken from the ground truth's comments ("millimetres", "mm", "metres"). times.txt beside the events says
// which frame of the sequence has which time, for runs that use only some of them. kNotFound, kUnavailable,
// kInvalidArgument: with file and line.
Result<Reference> ReadReference(const std::string& groundtruth_path, const std::string& events_path);

// Median time between frames; 0 for fewer than two.
std::int64_t FramePeriodNs(const std::vector<RunFrame>& frames);

// For each frame of the run the nearest true pose in time, at most half a frame period away (40 ms for a single frame).
// Poses are world_from_cam.
std::vector<std::optional<SE3>> Associate(const std::vector<RunFrame>& frames,
                                          const std::vector<GroundTruthPose>& poses);

// Whether the scene can be seen in a frame of a run. `part` is what the run read of the sequence, whose frames the
// events name; where the times of these are known they go before it. True when the events are not known.
bool IsClear(const RunFrame& frame, const SequenceOptions& part, const Reference& reference);

// The same for each of these frames.
std::vector<bool> FindClearFrames(const std::vector<RunFrame>& frames, const SequenceOptions& part,
                                  const Reference& reference);

}  // namespace haustra::evaluate
