// Frames from image files: a folder in our own layout or any listing that a data-set reader made.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "capture/codec/image_codec.h"
#include "capture/dataset/sequence_listing.h"
#include "capture/deinterlace.h"
#include "capture/image.h"
#include "capture/sequence_options.h"
#include "hal/frame_source.h"

namespace haustra {

// Decodes on demand, one file a call, into buffers that are reused. A file that cannot be read or decoded, or whose
// size is not that of the calibration, takes its index with it: Next returns kDataLoss with the file's name for it, and
// goes on with the next file. Files are always there, so the deadline is not looked at. thread-bound(the reader), not
// rt-safe.
class ImageFolderSource final : public FrameSource {
 public:
  // kInvalidArgument: options, or frames or mask that do not have the size of the calibration. kDataLoss: not one of
  // the images can be read. Errors of ReadStaticMask.
  static Result<std::unique_ptr<FrameSource>> Create(SequenceListing listing, const SequenceOptions& options);

  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return num_frames_; }
  ImageView static_mask() const override { return mask_.view(); }
  std::string FrameName(std::uint32_t frame_index) const override;
  Result<Frame> Next(TimePoint deadline) override;

 private:
  ImageFolderSource(SequenceListing listing, const SequenceOptions& options);

  // Of the image as it is stored.
  Status CheckSize(const std::string& path, int width_px, int height_px) const;
  // A calibration without a size takes it from there.
  Status CheckFirstReadableSize();
  std::size_t StoredIndex(std::uint32_t index) const;
  std::int64_t TimestampNs(std::size_t stored_index) const;

  SequenceListing listing_;
  SequenceOptions options_;
  CameraCalibration calibration_;  // of the frames that are handed out
  std::size_t num_folder_chars_;   // of every path, up to its name
  std::uint32_t num_frames_ = 0;
  std::uint32_t next_index_ = 0;
  Deinterlacer deinterlacer_;
  Image mask_;
  ImageReader reader_;
  Image stored_;
  Image half_;
};

// A folder in our own layout (see ListSequenceFolder); errors of both.
Result<std::unique_ptr<FrameSource>> OpenImageFolder(const std::string& folder, const SequenceOptions& options);

}  // namespace haustra
