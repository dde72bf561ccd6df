// One stream of a camera: opened, negotiated, buffers mapped; it runs from Start on, and takes no picture before. It
// ends with the object, which leaves nothing in the buffers; whatever went wrong is put right by making a new one.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/v4l2/device_io.h"
#include "capture/v4l2/v4l2_options.h"
#include "hal/core/status.h"

struct v4l2_pix_format;  // <linux/videodev2.h>

namespace haustra::capture::internal {

// What was agreed with the camera.
struct V4l2Format {
  std::uint32_t fourcc = 0;
  int width_px = 0;  // of the buffers: with kOneField each holds half the rows of the picture
  int height_px = 0;
  int pitch_bytes = 0;           // 0 for MJPEG
  std::size_t min_bytes = 0;     // what a whole picture takes; 1 for MJPEG
  std::size_t buffer_bytes = 0;  // what the driver wants a buffer to have
  double rate_hz = 0.0;          // 0: the camera does not say
  enum class Rows { kProgressive, kInterleaved, kTopThenBottom, kBottomThenTop, kOneField };
  Rows rows = Rows::kProgressive;
};

// Valid until it is given back.
struct V4l2Picture {
  std::uint32_t buffer = 0;
  std::span<const std::uint8_t> bytes;  // what the camera wrote
  std::uint32_t sequence = 0;
  TimePoint timestamp;
  // The driver's, where it calls it one of CLOCK_MONOTONIC and it cannot be.
  std::optional<TimePoint> refused_stamp = std::nullopt;
  bool is_stamped = true;   // by the kernel, on CLOCK_MONOTONIC, since the stream began; else the time of the dequeue
  bool is_damaged = false;  // the driver says so, or bytes are missing
  bool is_other_field = false;  // cameras that send fields one by one
};

// thread-bound(its owner). Errors of all calls: kUnavailable: the device is not there or has gone, brings no signal, or
// does not offer what the options ask, which it may do later (the signal decides). kInvalidArgument: it is no camera
// that is read here, or has no such input. Each message begins with the device's name.
class V4l2Stream {
 public:
  // wanted_width_px and wanted_height_px: where the options do not say; 0: as the camera is set. preferred_rate_hz:
  // likewise, and no error when it cannot be had.
  static Result<std::unique_ptr<V4l2Stream>> Open(const V4l2Options& options, int wanted_width_px, int wanted_height_px,
                                                  double preferred_rate_hz, DeviceIo& io);
  ~V4l2Stream();
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;

  const V4l2Format& format() const { return format_; }
  const std::string& path() const { return path_; }
  // What the driver calls the device.
  const std::string& name() const { return name_; }

  Status Start();
  bool is_streaming() const { return is_streaming_; }

  // Once it runs. The next picture; kDeadlineExceeded: none until `deadline`. After kUnavailable the stream is of no
  // more use.
  Result<V4l2Picture> Dequeue(TimePoint deadline);
  // Errors show at the next Dequeue.
  void GiveBack(const V4l2Picture& picture);

  // The picture's buffer as a DMA-BUF, for a device that reads it where it lies; the stream owns the descriptor.
  // kUnavailable: the driver does not export its buffers.
  Result<int> Export(const V4l2Picture& picture);
  // Where the pictures lie, and when that is not what was asked for, why: "mapped buffers (no DMA-BUF: ...)".
  std::string MemoryText() const;

 private:
  struct Buffer {
    void* address = nullptr;
    std::size_t length = 0;
    int dma_fd = -1;  // imported, or exported
  };

  V4l2Stream(std::string path, const V4l2Options& options, DeviceIo& io)
      : path_(std::move(path)), options_(options), io_(io) {}

  Status OpenDevice();
  Status ChooseInput();
  // Connectors that follow the signal of another device (HDMI, SDI) have to be told what that is.
  Status FollowSignal();
  Status ChooseFormat(int width_px, int height_px, double preferred_rate_hz);
  Status SetFormat(std::uint32_t fourcc, int width_px, int height_px);
  // Sizes of rows and pictures, of a format that was accepted.
  Status TakeLayout(const v4l2_pix_format& pix);
  Status SetRate(double preferred_rate_hz);
  // Buffers as the options ask, or mapped ones, all queued.
  Status TakeBuffers();
  Status ImportBuffers();
  Status MapBuffers();
  Status QueueBuffers();
  int Queue(std::uint32_t index);
  void ReleaseBuffers();
  std::uint32_t memory() const;  // V4L2_MEMORY_...
  // As many as were asked for, or what the driver has.
  Result<std::uint32_t> RequestBuffers(std::uint32_t memory);
  // Brackets what the processor reads of an imported buffer, or writes.
  void Sync(const Buffer& buffer, std::uint64_t flags);
  // kDeadlineExceeded: nothing there.
  Result<V4l2Picture> TryDequeue();
  Status HandleEvents();

  // `call` for the message, errno negative.
  Status Failed(const char* call, int error) const;

  const std::string path_;
  const V4l2Options options_;
  DeviceIo& io_;
  int fd_ = -1;
  std::string name_;
  std::uint32_t input_ = 0;
  V4l2Format format_;
  bool is_imported_ = false;
  std::string not_imported_;  // why
  std::vector<Buffer> buffers_;
  bool is_streaming_ = false;
  TimePoint begin_;  // of the stream: no picture is older
  int give_back_error_ = 0;
};

}  // namespace haustra::capture::internal
