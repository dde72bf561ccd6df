// The output folder of a run: trajectories, tables, map exports, summary.json. See README.md beside this file.
#pragma once

#include <string>
#include <vector>

#include "engine/export_map.h"
#include "tools/command/output_folder.h"
#include "tools/report/surface_folder.h"
#include "tools/run/mark_log.h"
#include "tools/run/run_record.h"
#include "tools/run/run_summary.h"
#include "tools/surface/surface_content.h"

namespace haustra {

inline constexpr FolderContent kRunContent{
    "a run",
    R"((frames|maps|events|times|marks)\.csv|summary\.json|report\.html|calib\.yaml|mask\.png|trajectory(/(live|map_\d{4,})\.tum)?|)"
    R"(maps(/map_\d{4,}(\.ply|/((cameras|images|points3D)\.txt|depth\.bin))?)?)",
    report::kSurfaceFolder, &surface::kSurfaceContent};

// The folders in it. kUnavailable.
Status MakeResultFolders(const std::string& folder);

// Writes everything; files that hold no times are the same bytes for the same run. `source`: names the pictures of the
// keyframes. has_own_mask: that of the source is not the sequence's, so that it is kept.
Status WriteOutputs(const std::string& folder, const RunRecord& record, const std::vector<FinalPose>& poses,
                    const RunSummary& summary, const Engine& engine, const MarkLog& marks, const FrameSource& source,
                    bool has_own_mask, const PointColour& colour);

// summary.json alone, as WriteOutputs does: the one that is there stays until the new one is whole.
Status WriteSummary(const std::string& folder, const RunSummary& summary);

}  // namespace haustra
