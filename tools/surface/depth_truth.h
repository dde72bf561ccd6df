// Depth of keyframes against what a rendered sequence knows.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/core/status.h"
#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/reference.h"
#include "tools/surface/map_surface.h"

namespace haustra::surface {

// Over the cells of the keyframes of one map, or of several, whose true range is known.
struct DepthScore {
  std::size_t keyframes = 0;
  std::size_t known_cells = 0;     // with a true range
  std::size_t seen_cells = 0;      // of these: two keyframes see the wall there under more than kMinAngleDeg
  std::size_t answered_cells = 0;  // of these: with a depth
  // Of the answered ones.
  double median_error = 0.0;                               // relative
  double within_2 = 0.0, within_5 = 0.0, within_10 = 0.0;  // shares
  double rms_mm = 0.0, median_mm = 0.0;
  double completeness() const { return seen_cells > 0 ? double(answered_cells) / double(seen_cells) : 0.0; }
};

inline constexpr double kMinAngleDeg = 2.0;

// truth: folder with NNNNNN.pgm (tools/command/range_picture.h). Depths are multiplied by the scale that `evaluation`
// has found for the map; maps without one are left out. Visible is what the true range of the other keyframe confirms
// within 5 %. Nothing when no map can be judged. Errors of ReadRangePicture; kInvalidArgument: another size.
Result<std::optional<DepthScore>> JudgeDepths(const std::vector<SurfaceMap>& maps,
                                              const std::vector<MapSurface>& surfaces, const evaluate::RunOutput& run,
                                              const evaluate::Evaluation& evaluation,
                                              const evaluate::Reference& reference, const std::string& truth);

}  // namespace haustra::surface
