// What an exported map (COLMAP text, engine/io/colmap_writer.h) says about the camera and the distance of the scene.
#pragma once

#include <string>

#include "tools/evaluate/run_output.h"

namespace haustra::evaluate {

// Reads cameras.txt, images.txt and points3D.txt of one folder. Camera models OPENCV_FISHEYE, OPENCV, FULL_OPENCV.
// kNotFound, kUnavailable: a file; kInvalidArgument with file and line: not what it should be.
Result<MapGeometry> ReadColmapGeometry(const std::string& folder);

}  // namespace haustra::evaluate
