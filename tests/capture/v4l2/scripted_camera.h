// A V4L2 device that follows a script, with a clock of its own that only waiting moves: every answer that a driver may
// give, without hardware.
#pragma once

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "capture/v4l2/device_io.h"

namespace haustra::test {

struct CameraMode {
  std::uint32_t fourcc = V4L2_PIX_FMT_YUYV;
  int width_px = 64;
  int height_px = 48;
  std::vector<double> rates_hz{25.0};
};

// What is wrong with one picture.
struct PictureFault {
  bool is_lost = false;  // never comes; the count goes on
  bool has_error_flag = false;
  bool is_short = false;      // a byte is missing
  bool is_unstamped = false;  // the stamp is not on CLOCK_MONOTONIC
  Duration stamp_shift{0};
  int dequeue_error = 0;  // negative errno in place of the picture
};

class ScriptedCamera final : public DeviceIo {
 public:
  // What the device is.
  std::string path = "/dev/video0";
  std::string name = "Tower Camera";
  bool has_twin = false;  // there is another one of that name
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<CameraMode> modes{CameraMode{}};
  std::uint32_t field = V4L2_FIELD_NONE;  // what S_FMT answers
  int extra_pitch_bytes = 0;
  bool says_rate = true;            // G_PARM
  int rate_error = 0;               // of S_PARM
  bool has_sizes = true;            // ENUM_FRAMESIZES, ENUM_FRAMEINTERVALS
  std::uint32_t height_answer = 0;  // of S_FMT; 0: what was asked
  std::vector<std::string> inputs;
  bool has_timings = false;  // the input follows a signal
  int timings_error = 0;     // of QUERY_DV_TIMINGS
  // What happens.
  bool is_present = true;
  bool is_silent = false;                        // sends nothing
  std::map<std::uint32_t, PictureFault> faults;  // by the number of the picture since the stream began
  bool is_woven = false;                         // odd rows show the scene further on
  bool has_source_change = false;                // an event is waiting
  int failing_call = -1;                         // that call, counted from 0, fails ...
  int failure = 0;                               // ... with this
  std::function<void(unsigned long)> on_call;    // before a call is answered: an ioctl, or 0 for another, but for poll
  std::vector<std::uint8_t> jpeg;                // what an MJPEG camera sends
  // DMA-BUF: the system's heap, and what the driver can do with it.
  bool has_heap = true;
  bool can_import = true;
  bool can_attach = true;  // takes the memory of the heap
  bool can_export = true;
  TimePoint now = TimePoint(std::chrono::seconds(1000));

  // What has been seen of the caller.
  int num_calls = 0;
  int num_opened = 0;
  int num_maps = 0;     // now
  int num_left = 0;     // buffers that were given up with something in them
  int num_synced = 0;   // pictures of the heap that were read between the two calls that it takes
  int num_streams = 0;  // begun
  int set_input = -1;

  double rate_hz() const { return rate_hz_; }
  bool is_open() const { return is_open_; }
  bool is_streaming() const { return is_streaming_; }
  static constexpr int kWovenShift = 20;
  // The luma that picture `sequence` has at a place.
  static std::uint8_t Luma(std::uint32_t sequence, int x, int y) {
    return static_cast<std::uint8_t>(
        16 + (sequence * 7 + static_cast<std::uint32_t>(x) * 3 + static_cast<std::uint32_t>(y) * 5) % 200);
  }

  std::vector<std::string> DevicePaths() override;
  int Open(const std::string& wanted) override;
  void Close(int fd) override;
  int Ioctl(int fd, unsigned long request, void* argument) override;
  int Poll(int fd, short events, Duration timeout, short* found) override;
  void* Map(int fd, std::size_t length, std::int64_t offset) override;
  void Unmap(void* address, std::size_t length) override;
  TimePoint Now() override { return now; }
  void Sleep(Duration duration) override { MoveTo(now + std::max(Duration(0), duration)); }

 private:
  static constexpr int kFd = 17;
  static constexpr int kHeapFd = 18;
  static constexpr int kFirstDmaFd = 100;
  struct Filled {
    std::uint32_t buffer = 0;
    std::uint32_t sequence = 0;
    std::uint32_t bytes = 0;
    std::uint32_t field = V4L2_FIELD_NONE;
    TimePoint stamp;
    PictureFault fault;
  };

  bool Fails(int* error);
  int Answer(unsigned long request, void* argument);
  int AnswerOfHeap(unsigned long request, void* argument);
  int Sync(int fd, void* argument);
  std::vector<std::uint8_t>& MemoryOf(std::uint32_t buffer);
  int SetFormat(v4l2_format* format);
  const CameraMode* ModeOf(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const;
  std::size_t PictureBytes() const;
  // Fills buffers until then.
  void MoveTo(TimePoint then);
  void TakePicture(TimePoint stamp);
  void Paint(std::uint32_t sequence, std::uint8_t* to) const;
  // To the event of the input that is set.
  bool IsSubscribed() const { return subscribed_input_ == static_cast<std::uint32_t>(std::max(0, set_input)); }
  Duration period() const { return Duration(static_cast<std::int64_t>(1e9 / rate_hz_)); }

  bool is_open_ = false;
  bool is_streaming_ = false;
  double rate_hz_ = 25.0;
  std::uint32_t fourcc_ = 0;
  std::uint32_t width_ = 0, height_ = 0, pitch_ = 0;
  std::uint32_t memory_ = V4L2_MEMORY_MMAP;
  std::vector<std::vector<std::uint8_t>> buffers_;
  std::map<int, std::vector<std::uint8_t>> heap_;  // by descriptor
  std::map<std::uint32_t, int> imported_;          // descriptor of each buffer
  std::set<int> exported_;
  std::set<int> read_now_;  // between the two calls
  std::deque<std::uint32_t> queued_;
  std::deque<Filled> filled_;
  std::uint32_t num_taken_ = 0;
  std::optional<std::uint32_t> subscribed_input_;
  TimePoint next_picture_;
};

}  // namespace haustra::test
