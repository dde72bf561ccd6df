#include "capture/dataset/endomapper.h"

#include <vector>

#include "capture/dataset/folder.h"
#include "capture/video_source.h"

namespace haustra {
namespace {

using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library

std::vector<std::string> Recordings(const std::string& folder) {
  std::vector<std::string> recordings;
  const Result<std::vector<std::string>> names = FileNames(folder);
  if (!names.ok()) return recordings;
  for (const std::string& name : *names) {
    if (HasVideoExtension(name)) recordings.push_back(Joined(folder, name));
  }
  return recordings;
}

std::vector<std::string> LoosePictures(const std::string& folder) {
  std::vector<std::string> pictures;
  const Result<std::vector<std::string>> names = FileNames(folder);
  if (!names.ok()) return pictures;
  for (const std::string& name : *names) {
    if (HasImageExtension(name) && name != "mask.png") pictures.push_back(name);
  }
  return pictures;
}

}  // namespace

bool LooksLikeEndomapper(const std::string& folder) { return !Recordings(folder).empty(); }

Result<std::unique_ptr<FrameSource>> OpenEndomapper(const std::string& folder, const SequenceOptions& options) {
  const std::vector<std::string> recordings = Recordings(folder);
  if (recordings.empty()) return NotFound(folder + ": no recorded video");
  if (recordings.size() > 1) {
    return InvalidArgument(folder + ": " + std::to_string(recordings.size()) + " recordings (" +
                           FileName(recordings[0]) + ", " + FileName(recordings[1]) + ", ..); name the one to read");
  }
  // Each would be a sequence of its own, and nobody could tell from the result which one was read.
  const std::vector<std::string> pictures = LoosePictures(folder);
  if (!pictures.empty()) {
    return InvalidArgument(folder + ": holds a video (" + FileName(recordings[0]) + ") and pictures (" +
                           std::to_string(pictures.size()) + ", the first is " + pictures.front() +
                           "); name the video, or put the pictures into " + Joined(folder, "frames"));
  }
  return OpenVideo(recordings[0], options);
}

}  // namespace haustra
