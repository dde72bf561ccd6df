// What the plots of a page show, as JSON for page/report.js:
//   coverage  rows of segments [begin s, end s, map or state]; neighbouring frames of one map are one segment
//   marks     merges, loops, relocalisations and losses
//   views     for each frame of reference: trajectories, points and the true path along its three principal axes; rgb:
//             colours of the points, three bytes each, in base64; pins: label and place of the doctor's marks
//   errors    distance of each localised frame from its true position
//   times     each stage's durations in ms
// Times are in seconds from the first frame. reentrant, deterministic.
#pragma once

#include <map>
#include <string>

#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/reference.h"
#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"

namespace haustra::report {

// So many maps at most that could not be aligned to a ground truth have a view, the largest.
inline constexpr std::size_t kMaxMapsOnTheirOwn = 6;

// models: of the maps that were exported, by map id.
std::string MakeChartData(const evaluate::RunOutput& run, const evaluate::Reference& reference,
                          const evaluate::Evaluation& evaluation, const std::map<int, MapModel>& models);

}  // namespace haustra::report
