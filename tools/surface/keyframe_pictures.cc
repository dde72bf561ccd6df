#include "tools/surface/keyframe_pictures.h"

#include <algorithm>
#include <cstdlib>
#include <memory>

#include "capture/image_transform.h"
#include "capture/open_sequence.h"
#include "tools/evaluate/number_text.h"

namespace haustra::surface {
namespace {

constexpr std::int64_t kSameStampNs = 1000;

std::string SizeText(int width_px, int height_px) { return std::to_string(width_px) + "x" + std::to_string(height_px); }

// The sequence, halved where the run halved it.
Result<std::unique_ptr<FrameSource>> Open(const CameraCalibration& camera, const std::string& sequence,
                                          SequenceOptions options) {
  options.channels = ChannelChoice::kAsStored;
  // The run knows the camera. Its size is that of the frames, whatever it is.
  options.calibration = camera;
  options.calibration->width_px = options.calibration->height_px = 0;
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

// kInvalidArgument: the run gives the frame another time.
Status CheckTime(const evaluate::RunOutput& run, const Frame& frame, const std::string& sequence) {
  const auto row = std::lower_bound(run.frames.begin(), run.frames.end(), frame.index,
                                    [](const evaluate::RunFrame& f, std::int64_t idx) { return f.frame_idx < idx; });
  if (row == run.frames.end() || row->frame_idx != frame.index) return Status::Ok();
  const std::int64_t stamp_ns = frame.timestamp.time_since_epoch().count();
  if (std::abs(row->timestamp_ns - stamp_ns) <= kSameStampNs) return Status::Ok();
  return InvalidArgument(sequence + ": frame " + std::to_string(frame.index) + " has the time " +
                         evaluate::Fixed(static_cast<double>(stamp_ns) * 1e-9, 6) + " s, the run says " +
                         evaluate::Fixed(static_cast<double>(row->timestamp_ns) * 1e-9, 6) +
                         " s: not the sequence of this run, or run with another --first-frame or --every-nth");
}

}  // namespace

Result<KeyframePictures> ReadKeyframePictures(const evaluate::RunOutput& run, const std::set<std::string>& names,
                                              const CameraCalibration& camera, const std::string& sequence,
                                              const SequenceOptions& options) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, Open(camera, sequence, options));
  KeyframePictures pictures;
  if (!source->static_mask().is_empty()) CopyImage(source->static_mask(), &pictures.mask);
  while (pictures.by_name.size() < names.size()) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) break;
    if (frame.code() == StatusCode::kDataLoss) continue;
    HAUSTRA_TRY(frame.status());
    std::string name = source->FrameName(frame->index);
    std::replace(name.begin(), name.end(), ' ', '_');
    if (!names.contains(name)) continue;
    HAUSTRA_TRY(CheckTime(run, *frame, sequence));
    KeyframePicture& picture = pictures.by_name[name];
    picture.frame_idx = frame->index;
    picture.stored_frame = options.first_frame + static_cast<std::int64_t>(frame->index) * options.every_nth;
    CopyImage(frame->image, &picture.colour);
    ToGrey(picture.colour.view(), &picture.grey);
  }
  return pictures;
}

}  // namespace haustra::surface
