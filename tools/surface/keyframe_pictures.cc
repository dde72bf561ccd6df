#include "tools/surface/keyframe_pictures.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "capture/codec/image_codec.h"
#include "capture/image_transform.h"
#include "capture/open_sequence.h"
#include "tools/evaluate/sequence_of_run.h"

namespace haustra::surface {
namespace {

std::string SizeText(int width_px, int height_px) { return std::to_string(width_px) + "x" + std::to_string(height_px); }

// The sequence, halved where the run halved it.
Result<std::unique_ptr<FrameSource>> Open(const CameraCalibration& camera, const std::string& sequence,
                                          SequenceOptions options) {
  HAUSTRA_ASSIGN(std::unique_ptr<FrameSource> source, OpenSequence(sequence, options));
  const auto has_size = [&](int factor) {
    const CameraCalibration& found = source->calibration();
    // Halving leaves out an odd last row or column.
    return found.width_px / factor == camera.width_px && found.height_px / factor == camera.height_px;
  };
  if (has_size(1)) return source;
  if (has_size(2)) {
    options.halve = true;
    return OpenSequence(sequence, options);
  }
  const CameraCalibration& found = source->calibration();
  return InvalidArgument(sequence + ": frames have " + SizeText(found.width_px, found.height_px) + ", the run had " +
                         SizeText(camera.width_px, camera.height_px) + ": not the sequence of this run");
}

}  // namespace

Result<Image> ReadMaskOfRun(const evaluate::RunOutput& run, const CameraCalibration& camera) {
  const std::string path = (std::filesystem::path(run.folder) / "mask.png").string();
  if (!std::filesystem::exists(path)) return Image();
  HAUSTRA_ASSIGN(Image mask, ReadImage(path, ChannelChoice::kGrey));
  if (mask.width() == camera.width_px && mask.height() == camera.height_px) return mask;
  return InvalidArgument(path + ": not of the size of this run's frames");
}

Result<KeyframePictures> ReadKeyframePictures(const evaluate::RunOutput& run, const std::set<std::string>& names,
                                              const CameraCalibration& camera, const std::string& sequence,
                                              DeinterlaceChoice deinterlace) {
  SequenceOptions options = evaluate::OptionsForPictures(run);
  options.deinterlace = deinterlace;
  HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, Open(camera, sequence, options));
  KeyframePictures pictures;
  HAUSTRA_ASSIGN(pictures.mask, ReadMaskOfRun(run, camera));
  if (pictures.mask.is_empty() && !source->static_mask().is_empty()) CopyImage(source->static_mask(), &pictures.mask);
  while (pictures.by_name.size() < names.size()) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) break;
    if (frame.code() == StatusCode::kDataLoss) continue;
    HAUSTRA_TRY(frame.status());
    std::string name = source->FrameName(frame->index);
    std::replace(name.begin(), name.end(), ' ', '_');
    if (!names.contains(name)) continue;
    HAUSTRA_TRY(evaluate::CheckIsOfRun(run, frame->index, frame->timestamp, sequence));
    KeyframePicture& picture = pictures.by_name[name];
    picture.frame_idx = frame->index;
    picture.stored_frame = options.StoredFrame(frame->index);
    CopyImage(frame->image, &picture.colour);
    ToGrey(picture.colour.view(), &picture.grey);
  }
  return pictures;
}

}  // namespace haustra::surface
