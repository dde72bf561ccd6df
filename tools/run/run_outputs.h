// The output folder of a run: trajectories, tables, map exports, summary.json. See README.md beside this file.
#pragma once

#include <string>
#include <vector>

#include "engine/export_map.h"
#include "tools/run/run_record.h"
#include "tools/run/run_summary.h"

namespace haustra {

// Makes the folder (and those above it). kUnavailable when that fails, kInvalidArgument when something that is not a
// folder, or a folder holding files that are not a run's, has the name.
Status PrepareOutputFolder(const std::string& folder);

// Writes everything; files that hold no times are the same bytes for the same run.
Status WriteOutputs(const std::string& folder, const RunRecord& record, const std::vector<FinalPose>& poses,
                    const RunSummary& summary, const Engine& engine, const PointColour& colour);

}  // namespace haustra
