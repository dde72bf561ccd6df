// What `haustra surface` writes into its folder, also where that lies in the folder of a run.
#pragma once

#include "tools/command/output_folder.h"

namespace haustra::surface {

inline constexpr FolderContent kSurfaceContent{
    "a surface", R"(map_\d{4,}(\.(ply|glb)|_wall\.(png|csv)|(/\d{6,}\.pgm)?)|surface\.json)"};

}  // namespace haustra::surface
