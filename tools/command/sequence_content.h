// What the commands write that make a sequence: render and capture.
#pragma once

#include "tools/command/output_folder.h"

namespace haustra {

inline constexpr FolderContent kSequenceContent{
    "a sequence",
    R"(depth(/\d{6,}\.pgm)?|frames(/\d{6,}\.(jpg|png))?|normals(/\d{6,}\.png)?|times\.(txt|recording)|calib(_true)?\.yaml|mask\.png|groundtruth\.txt|(events|revisits|seen_wall)\.csv)"};

}  // namespace haustra
