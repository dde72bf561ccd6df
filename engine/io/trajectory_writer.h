// Trajectories in the TUM format, which evo and most evaluation tools read as it is: one pose a line, eight columns
// separated by single blanks: time in seconds (nine decimals), tx ty tz, qx qy qz qw. Here alone poses change
// direction: in memory they are cam_from_world, in the file world_from_cam (tx ty tz is the camera centre). Lengths are
// map units: a monocular map has no metric scale. reentrant, not rt-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "engine/geometry/se3.h"
#include "hal/core/byte_sink.h"

namespace haustra {

struct StampedPose {
  std::int64_t timestamp_ns = 0;
  SE3 cam_from_world;
};

// Every line of `comment` is written behind a '#', before the column names.
// kInvalidArgument: a pose is not finite (the message says which), the sink is untouched then; otherwise what the sink
// returns.
Status WriteTum(ByteSink& sink, std::span<const StampedPose> poses, std::string_view comment = {});

// The pieces of it, for files that grow while the run goes on.
void AppendTumHeader(std::string_view comment, std::string* text);
void AppendTumLine(const StampedPose& pose, std::string* text);

}  // namespace haustra
