// The tables of the paper (CudaSIFT-SLAM, its tables of mapping results and of running times), of one run or of several
// with their mean and standard deviation; and every join with its verdict. reentrant.
#pragma once

#include <span>

#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/text_table.h"

namespace haustra::evaluate {

// A row a run; for several, "mean" and "std" (of the sample) below. Groups: mean over the maps, largest map, global.
TextTable MakePaperTable(std::span<const Evaluation> evaluations);

// The maps of one run: the paper's values, error and scale of each.
TextTable MakeMapTable(const Evaluation& evaluation);

// A row for each stretch of the true path; no rows when no length was asked for.
TextTable MakeSegmentTable(const Evaluation& evaluation);

// A row a stage: how often it ran, median, 99th percentile, maximum, mean and standard deviation in ms. Over several
// runs each figure is the mean of the runs' figures.
TextTable MakeStageTable(std::span<const Evaluation> evaluations);

// Every merge, loop, relocalisation and recovery against the ground truth.
TextTable MakeJoinTable(std::span<const Evaluation> evaluations);

// How many were made, judged and false; precision; and how many of the occasions were taken.
TextTable MakePrecisionTable(std::span<const Evaluation> evaluations);

// The last part of the path; a separator at its end does not count.
std::string ShortName(const std::string& folder);

}  // namespace haustra::evaluate
