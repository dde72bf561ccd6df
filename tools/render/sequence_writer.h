// Text files and folder of a rendered sequence. reentrant. Errors: kUnavailable names the path.
#pragma once

#include <string>
#include <vector>

#include "engine/geometry/se3.h"
#include "hal/core/status.h"
#include "tools/render/event_script.h"
#include "tools/render/revisits.h"

namespace haustra::render {

Status MakeFramesFolder(const std::string& folder);
Status MakeDepthFolder(const std::string& folder);
Status MakeNormalsFolder(const std::string& folder);
// "FOLDER/depth/000042.pgm"
std::string DepthPath(const std::string& folder, int frame);
// "FOLDER/normals/000042.png"
std::string NormalsPath(const std::string& folder, int frame);
// "FOLDER/frames/000042.jpg"
std::string FramePath(const std::string& folder, int frame);

Status WriteTimes(const std::string& folder, const std::vector<double>& times_s);
Status WriteGroundTruth(const std::string& folder, const std::vector<double>& times_s,
                        const std::vector<SE3>& world_from_cam);
Status WriteEvents(const std::string& folder, const std::vector<FrameSpan>& spans);
Status WriteRevisits(const std::string& folder, const std::vector<Revisit>& revisits);

}  // namespace haustra::render
