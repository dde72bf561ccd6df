// The page of a run from its output folder: what `haustra report` and the end of `haustra run` write.
// thread-bound(caller).
#pragma once

#include <string>

#include "hal/core/status.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/report/join_pictures.h"

namespace haustra::report {

struct ReportRequest {
  std::string run;          // output folder of `haustra run`
  std::string groundtruth;  // empty: none
  std::string events;       // empty: events.csv beside the ground truth
  PictureOptions pictures;  // without a sequence: none
  std::string surface;      // folder of `haustra surface`; empty: RUN/surface where one lies there as a whole
  evaluate::EvaluateOptions options;
};

// HTML. Errors of what it reads: evaluate::ReadRunOutput, ReadReference, ReadMapModel, JoinPicturesHtml,
// WallPicturesHtml, ReadSurfaceMeshes.
Result<std::string> MakeRunReport(const ReportRequest& request);

}  // namespace haustra::report
