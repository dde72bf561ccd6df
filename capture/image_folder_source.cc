#include "capture/image_folder_source.h"

#include <algorithm>
#include <utility>

#include "capture/image_transform.h"
#include "capture/number.h"
#include "capture/static_mask.h"

namespace haustra {
namespace {

using capture::internal::SizeText;

// How many of `num_stored` frames the options choose.
std::uint32_t NumChosen(std::size_t num_stored, const SequenceOptions& options) {
  if (options.first_frame >= num_stored) return 0;
  const std::size_t last = std::min<std::size_t>(options.last_frame, num_stored - 1);
  return static_cast<std::uint32_t>((last - options.first_frame) / options.every_nth + 1);
}

// Length of the folder that all paths have in common, with its slash.
std::size_t CommonFolder(const std::vector<std::string>& paths) {
  if (paths.empty()) return 0;
  std::size_t length = paths.front().rfind('/') + 1;  // 0 without a slash
  for (const std::string& path : paths) {
    while (length > 0 && path.compare(0, length, paths.front(), 0, length) != 0) {
      length = length < 2 ? 0 : paths.front().rfind('/', length - 2) + 1;
    }
  }
  return length;
}

}  // namespace

ImageFolderSource::ImageFolderSource(SequenceListing listing, const SequenceOptions& options)
    : listing_(std::move(listing)),
      options_(options),
      calibration_(options.CalibrationOfFrames(listing_.calibration)),
      num_folder_chars_(CommonFolder(listing_.image_paths)),
      num_frames_(NumChosen(listing_.image_paths.size(), options)),
      deinterlacer_(options.deinterlace) {}

Result<std::unique_ptr<FrameSource>> ImageFolderSource::Create(SequenceListing listing,
                                                               const SequenceOptions& options) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_CHECK(listing.image_paths.size() == listing.timestamps_ns.size());
  std::unique_ptr<ImageFolderSource> source(new ImageFolderSource(std::move(listing), options));
  if (source->num_frames_ == 0) {
    return InvalidArgument(source->listing_.folder + ": the sequence is empty from frame " +
                           std::to_string(options.first_frame) + " on; it has " +
                           std::to_string(source->listing_.image_paths.size()) + " frames");
  }
  HAUSTRA_TRY(source->CheckFirstReadableSize());
  HAUSTRA_ASSIGN(source->mask_, capture::internal::ReadStaticMask(source->listing_.mask_path,
                                                                  source->listing_.calibration, options.halve));
  return std::unique_ptr<FrameSource>(std::move(source));
}

Result<Frame> ImageFolderSource::Next(TimePoint) {
  if (next_index_ >= num_frames_) return NotFound(listing_.folder + ": the sequence is over");
  Frame frame;
  frame.index = next_index_++;
  const std::size_t stored_index = StoredIndex(frame.index);
  const std::string& path = listing_.image_paths[stored_index];
  frame.timestamp = TimePoint(Duration(TimestampNs(stored_index)));
  Status status = reader_.Read(path, options_.channels, &stored_);
  if (status.ok()) status = CheckSize(path, stored_.width(), stored_.height());
  // Whatever is wrong with one file, it is a lost frame and not the end of the sequence.
  if (!status.ok()) return DataLoss(status.message());
  frame.shows_one_field = deinterlacer_.WantsTopField(stored_.view());
  if (frame.shows_one_field) KeepTopField(&stored_);
  if (options_.halve) HalveImage(stored_.view(), &half_);
  frame.image = options_.halve ? half_.view() : stored_.view();
  return frame;
}

std::string ImageFolderSource::FrameName(std::uint32_t frame_index) const {
  return listing_.image_paths[StoredIndex(frame_index)].substr(num_folder_chars_);
}

Status ImageFolderSource::CheckSize(const std::string& path, int width_px, int height_px) const {
  if (width_px == listing_.calibration.width_px && height_px == listing_.calibration.height_px) return Status::Ok();
  return InvalidArgument(path + ": the image is " + SizeText(width_px, height_px) + ", the calibration (" +
                         listing_.calibration_path + ") is for " +
                         SizeText(listing_.calibration.width_px, listing_.calibration.height_px));
}

Status ImageFolderSource::CheckFirstReadableSize() {
  Status first_error;
  for (std::uint32_t index = 0; index < num_frames_; ++index) {
    const std::string& path = listing_.image_paths[StoredIndex(index)];
    const Result<ImageSize> size = reader_.ReadSize(path);
    if (size.ok() && listing_.calibration.width_px == 0) {
      listing_.calibration.width_px = size->width_px;
      listing_.calibration.height_px = size->height_px;
      calibration_ = options_.CalibrationOfFrames(listing_.calibration);
    }
    if (size.ok()) return CheckSize(path, size->width_px, size->height_px);
    if (first_error.ok()) first_error = size.status();
  }
  return DataLoss(listing_.folder + ": not one image can be read; the first: " + first_error.message());
}

std::size_t ImageFolderSource::StoredIndex(std::uint32_t index) const {
  const std::uint32_t position = options_.reversed ? num_frames_ - 1 - index : index;
  return options_.first_frame + std::size_t{position} * options_.every_nth;
}

std::int64_t ImageFolderSource::TimestampNs(std::size_t stored_index) const {
  const std::vector<std::int64_t>& stamps = listing_.timestamps_ns;
  if (!options_.reversed) return stamps[stored_index];
  // Mirrored between the first and the last.
  return stamps[StoredIndex(num_frames_ - 1)] + stamps[StoredIndex(0)] - stamps[stored_index];
}

Result<std::unique_ptr<FrameSource>> OpenImageFolder(const std::string& folder, const SequenceOptions& options) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_ASSIGN(SequenceListing listing, ListSequenceFolder(folder, options));
  return ImageFolderSource::Create(std::move(listing), options);
}

}  // namespace haustra
