// A run against its ground truth. A function of what was read; it opens no file.
#pragma once

#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/join_judge.h"
#include "tools/evaluate/reference.h"
#include "tools/evaluate/run_output.h"

namespace haustra::evaluate {

struct EvaluateOptions {
  JoinOptions joins;
  double scene_depth = 0.0;  // ground-truth units; 0: from the maps' exported points
  double deadline_ms = 0.0;  // 0: the frame period at the pace of the run
  double segment = 0.0;      // length of the stretches that errors are given for, ground-truth units; 0: none
};

Evaluation EvaluateRun(const RunOutput& run, const Reference& reference, const EvaluateOptions& options);

}  // namespace haustra::evaluate
