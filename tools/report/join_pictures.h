// The pictures in which merges and loops were found: the frame and the one that it met again, side by side, joined by
// the map points that both keyframes see in the final map. thread-bound(caller).
#pragma once

#include <map>
#include <string>

#include "capture/deinterlace.h"
#include "hal/core/status.h"
#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"

namespace haustra::report {

struct PictureOptions {
  std::string sequence;                                      // folder or video that the run was made from
  DeinterlaceChoice deinterlace = DeinterlaceChoice::kAuto;  // as in the run
  std::size_t max_joins = 12;                                // evenly chosen when there are more
};

// HTML, with the pictures as JPEG inside. Errors of OpenSequence; kInvalidArgument when a frame of the sequence is
// missing, or does not have the time that the run gives it.
Result<std::string> JoinPicturesHtml(const evaluate::RunOutput& run, const evaluate::Evaluation& evaluation,
                                     const std::map<int, MapModel>& models, const PictureOptions& options);

}  // namespace haustra::report
