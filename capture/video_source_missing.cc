// Stands in for video_source.cc where FFmpeg's libraries were not found at build time.
#include "capture/video_source.h"

namespace haustra {

bool HasVideoSupport() { return false; }

std::string StampRemark(const FrameSource&) { return ""; }

Result<std::unique_ptr<FrameSource>> OpenVideo(const std::string& path, const SequenceOptions&) {
  return Unavailable(path +
                     ": built without video support (FFmpeg's libavformat, libavcodec, libavutil and libswscale)");
}

}  // namespace haustra
