// Frames from a live camera through V4L2.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "capture/codec/jpeg_codec.h"
#include "capture/deinterlace.h"
#include "capture/image.h"
#include "capture/sequence_options.h"
#include "capture/v4l2/device_io.h"
#include "capture/v4l2/frame_counter.h"
#include "capture/v4l2/timed_device_io.h"
#include "capture/v4l2/v4l2_options.h"
#include "capture/v4l2/v4l2_stream.h"
#include "hal/frame_source.h"

namespace haustra {

// What has happened to a camera's pictures since the source was made.
struct V4l2Counters {
  std::uint64_t num_frames = 0;     // given out
  std::uint64_t num_left_out = 0;   // beyond max_rate_hz, or of the other field
  std::uint64_t num_stale = 0;      // overtaken by newer ones while the reader was away
  std::uint64_t num_lost = 0;       // gaps in the camera's count
  std::uint64_t num_damaged = 0;    // marked by the driver, cut short, or with a time stamp that is not later
  std::uint64_t num_unstamped = 0;  // without a kernel time on CLOCK_MONOTONIC, or with one that cannot be
  std::uint64_t num_timeouts = 0;   // calls that ended without a frame
  std::uint64_t num_restarts = 0;   // streams begun again after an error, a changed signal, silence or a replug
};

// Time stamps are the kernel's, on CLOCK_MONOTONIC. One that lies ahead, or before the stream began, is replaced by the
// time at which the picture was fetched, and so are those that have gone back for more than a few pictures. A whole
// picture that is not halved is given out where the camera wrote it, in the camera's format, without a copy; the buffer
// goes back at the next call of Next. Halving gives grey pictures, MJPEG those that ChannelChoice asks for.
//
// Grabbers weave fields and call them progressive: such pictures are shown by their top field (SequenceOptions), from a
// copy. With field=top or field=bottom a single field comes, and nothing is looked for.
//
// The camera takes no picture before the first call of Next. When the source ends nothing stays in its buffers.
//
// Whatever happens to the camera, the source lives on: Next answers kUnavailable, with the reason, while the device is
// gone or brings no signal, looks for it four times a second, and goes on with frames when it is back. After three
// seconds without a picture the stream is begun again. A camera that comes, or comes back, with pictures of another
// size or in a format that the region cannot be cut out of stays unavailable. Next never waits longer than a second for
// a picture, even with kNoDeadline. A driver may take its time to bring a device back: recovering_since tells of each
// call. thread-bound(the reader), not rt-safe: restarting allocates, and so does a damaged picture, for its message. A
// whole one asks nothing of the heap.
class V4l2Source final : public FrameSource {
 public:
  // The calibration (of the file that `sequence` names) is that of the picture or of the region. Without a file the
  // source only knows the size: enough to record, not to map. `io` must outlive the source. kInvalidArgument: options,
  // calibration and mask do not fit each other, or no such camera can do what is asked. kUnavailable: it is not there,
  // or does not do what is asked now (unless it may come later, and the size of its pictures is known without it).
  static Result<std::unique_ptr<V4l2Source>> Create(const V4l2Options& options, const SequenceOptions& sequence,
                                                    DeviceIo& io);

  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return 0; }
  bool is_live() const override { return true; }
  // Nothing while the camera is gone.
  std::optional<PixelFormat> pixel_format() const override;
  ImageView static_mask() const override { return mask_.view(); }
  Result<Frame> Next(TimePoint deadline) override;
  std::optional<TimePoint> recovering_since() const override;

  const V4l2Counters& counters() const { return counters_; }
  // The newest frame as an MJPEG camera encoded it, the whole picture; empty for other formats. Valid as long as the
  // frame.
  std::span<const std::uint8_t> encoded() const;
  // The buffer of the newest frame, as the camera wrote it (both fields of an interlaced picture), for a device that
  // reads it where it lies (DMA-BUF). The source owns the descriptor; the picture in it is valid as long as the frame.
  // kUnavailable: there is no frame, or the driver does not export its buffers.
  Result<int> ExportBuffer();
  // "UVC Camera (/dev/video0), YUYV 1920x1080 at 30 Hz, mapped buffers"; while it is gone, why.
  std::string Describe() const;

 private:
  V4l2Source(const V4l2Options& options, const SequenceOptions& sequence, DeviceIo& io)
      : options_(options), sequence_(sequence), io_(io), deinterlacer_(sequence.deinterlace) {}

  // While there is one.
  class Recovery;

  Status Initialise();
  Status ResolveGeometry(const CameraCalibration* file);
  Status Connect();
  Status Start();
  // Tries again when it is time to; kUnavailable with the reason.
  Status Reconnect(TimePoint limit);
  void Disconnect(std::string reason);
  void GiveBack();
  // The newest picture that is to become a frame, with its index; it is held. kDeadlineExceeded, kUnavailable,
  // kDataLoss.
  Result<std::uint32_t> Wait(TimePoint limit);
  // They get the time at which the picture was fetched.
  void RefuseStampsThatWentBack(capture::internal::V4l2Picture* picture);
  // The frame's picture, and what is shown of it. kDataLoss.
  Status Show(const capture::internal::V4l2Picture& picture, Frame* frame);

  const V4l2Options options_;
  const SequenceOptions sequence_;
  capture::internal::TimedDeviceIo io_;
  std::atomic<bool> is_recovering_{false};
  int width_px_ = 0;  // of the whole progressive picture
  int height_px_ = 0;
  double preferred_rate_hz_ = 0.0;
  CameraCalibration calibration_;
  Image mask_;

  std::unique_ptr<capture::internal::V4l2Stream> stream_;
  std::optional<capture::internal::V4l2Picture> held_;
  capture::internal::FrameCounter counter_;
  std::string gone_;  // why there is no stream
  TimePoint next_attempt_;
  TimePoint last_picture_;  // when one last came, or the stream began
  TimePoint last_stamp_;
  bool has_stamp_ = false;
  int num_not_later_ = 0;  // stamps in a row that were not later than last_stamp_
  V4l2Counters counters_;
  std::optional<capture::internal::JpegDecoder> decoder_;  // of an MJPEG camera, as decoded_ is
  Image decoded_;
  Deinterlacer deinterlacer_;
  Image deinterlaced_;
  Image prepared_;
};

// The source for "v4l2:..." (ParseV4l2Spec) on this machine. Needs a calibration; errors of both.
Result<std::unique_ptr<FrameSource>> OpenV4l2(const std::string& spec, const SequenceOptions& options);

}  // namespace haustra
