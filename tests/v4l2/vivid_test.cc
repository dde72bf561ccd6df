// The camera source against a real kernel: Linux' virtual video driver (vivid). tests/v4l2/run_vivid.sh boots a kernel
// that has it; elsewhere every test is skipped. Input 0 of the driver must be a webcam, input 1 HDMI.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <set>
#include <string>

#include "capture/v4l2/device_list.h"
#include "capture/v4l2/v4l2_source.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr char kName[] = "vivid";

// The driver's own switches, found by their names.
class Switches {
 public:
  explicit Switches(const std::string& path) : fd_(open(path.c_str(), O_RDWR | O_NONBLOCK)) {}
  ~Switches() { close(fd_); }
  Switches(const Switches&) = delete;
  Switches& operator=(const Switches&) = delete;

  void Set(const std::string& name, int value) const {
    v4l2_query_ext_ctrl control{};
    control.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (ioctl(fd_, VIDIOC_QUERY_EXT_CTRL, &control) == 0) {
      if (name == control.name) {
        v4l2_control setting{control.id, value};
        EXPECT_EQ(ioctl(fd_, VIDIOC_S_CTRL, &setting), 0) << name << ": " << std::strerror(errno);
        return;
      }
      control.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    ADD_FAILURE() << "the driver has no switch '" << name << "'";
  }
  // What the connector HDMI is sent. The switches are those of the input that is chosen.
  enum Signal { kAsSet = 0, kNoSignal = 1, kSelected = 4 };
  void SetSignal(Signal signal, const char* timings) const {
    int input = 1;
    EXPECT_EQ(ioctl(fd_, VIDIOC_S_INPUT, &input), 0);
    Set("DV Timings Signal Mode", signal);
    if (timings == nullptr) return;
    const int entry = Entry("DV Timings", timings);
    EXPECT_GE(entry, 0) << timings;
    Set("DV Timings", entry);
  }

  // The number of the first entry of a menu with these words; -1: none.
  int Entry(const std::string& name, const std::string& words) const {
    v4l2_query_ext_ctrl control{};
    control.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (ioctl(fd_, VIDIOC_QUERY_EXT_CTRL, &control) == 0) {
      for (__s64 i = control.minimum; name == control.name && i <= control.maximum; ++i) {
        v4l2_querymenu entry{};
        entry.id = control.id;
        entry.index = static_cast<__u32>(i);
        if (ioctl(fd_, VIDIOC_QUERYMENU, &entry) != 0) continue;
        if (std::string(reinterpret_cast<const char*>(entry.name)).find(words) != std::string::npos) {
          return static_cast<int>(i);
        }
      }
      control.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return -1;
  }

 private:
  int fd_;
};

class Vivid : public testing::Test {
 protected:
  void SetUp() override {
    for (const V4l2DeviceInfo& device : ListV4l2Devices(SystemDeviceIo(), nullptr)) {
      if (device.driver == kName) path_ = device.path;
    }
    if (path_.empty()) GTEST_SKIP() << "no vivid device: tests/v4l2/run_vivid.sh boots a kernel that has one";
    const Switches switches(path_);
    switches.Set("Timestamp Source", 1);  // the moment of exposure, which does not wait for the generator
    switches.Set("Percentage of Dropped Buffers", 0);
  }

  V4l2Options Options(int width_px, int height_px, double rate_hz, const char* input = "0") const {
    V4l2Options options;
    options.device = path_;
    options.width_px = width_px;
    options.height_px = height_px;
    options.rate_hz = rate_hz;
    options.input = input;
    options.num_buffers = 8;
    return options;
  }

  static std::unique_ptr<V4l2Source> Open(const V4l2Options& options, const SequenceOptions& sequence = {}) {
    Result<std::unique_ptr<V4l2Source>> source = V4l2Source::Create(options, sequence, SystemDeviceIo());
    EXPECT_TRUE(source.ok()) << source.status().ToString();
    return source.ok() ? std::move(*source) : nullptr;
  }

  static Result<Frame> Next(V4l2Source& source) { return source.Next(SystemDeviceIo().Now() + milliseconds(900)); }

  // The first frame that comes; the codes of the answers before it.
  static Result<Frame> NextFrame(V4l2Source& source, std::set<StatusCode>* before) {
    Result<Frame> frame = Next(source);
    for (int i = 0; i < 100 && !frame.ok(); ++i) {
      before->insert(frame.code());
      frame = Next(source);
    }
    return frame;
  }

  std::string path_;
};

// The test picture has bars: many levels of brightness, whatever the format.
void ExpectBars(const ImageView& image) {
  std::set<int> levels;
  const int step = BytesPerPixel(image.format);
  const int offset = image.format == PixelFormat::kUyvy ? 1 : 0;
  for (int x = 0; x < image.width; x += 8) levels.insert(image.row(image.height / 2)[x * step + offset]);
  EXPECT_GE(levels.size(), 6u);
}

TEST_F(Vivid, EveryFormatIsNegotiatedAndRead) {
  for (const std::uint32_t fourcc : {V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_GREY}) {
    V4l2Options options = Options(640, 360, 0);
    options.format = fourcc;
    const auto source = Open(options);
    ASSERT_NE(source, nullptr);
    EXPECT_THAT(source->Describe(), HasSubstr(FourccText(fourcc) + " 640x360"));
    TimePoint before;
    for (int i = 0; i < 4; ++i) {
      const Result<Frame> frame = Next(*source);
      ASSERT_TRUE(frame.ok()) << frame.status().ToString();
      ExpectBars(frame->image);
      if (i > 0) {
        EXPECT_GT(frame->timestamp, before);
      }
      before = frame->timestamp;
      EXPECT_LT(SystemDeviceIo().Now() - frame->timestamp, std::chrono::seconds(1)) << "not on CLOCK_MONOTONIC";
    }
    EXPECT_EQ(source->counters().num_unstamped, 0u);
  }
}

TEST_F(Vivid, BuffersOfTheDmaHeapAreImported) {
  if (access("/dev/dma_heap/system", R_OK | W_OK) != 0) GTEST_SKIP() << "this kernel has no DMA heap";
  V4l2Options options = Options(640, 360, 0);
  options.memory = BufferMemory::kDmaBuf;
  const auto source = Open(options);
  ASSERT_NE(source, nullptr);
  EXPECT_THAT(source->Describe(), HasSubstr("imported buffers"));
  for (std::uint32_t i = 0; i < 20; ++i) {
    const Result<Frame> frame = Next(*source);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->index, i);
    ExpectBars(frame->image);
    EXPECT_TRUE(source->ExportBuffer().ok());
  }
}

TEST_F(Vivid, TheSizesAndRatesOfTowersAreNegotiated) {
  struct Mode {
    int width_px, height_px;
    const char* timings;
    double rate_hz;
  };
  // HDMI follows the signal; its scaler gives the sizes of processors that cut their picture.
  const Switches switches(path_);
  for (const Mode& mode : {Mode{1920, 1080, "1920x1080p25", 25}, Mode{1920, 1080, "1920x1080p50", 50},
                           Mode{1920, 1080, "1920x1080p60", 60}, Mode{1440, 1080, "1920x1080p50", 50},
                           Mode{1350, 1080, "1920x1080p30", 30}}) {
    switches.SetSignal(Switches::kSelected, mode.timings);
    V4l2Options options = Options(mode.width_px, mode.height_px, 0, "1");
    options.format = V4L2_PIX_FMT_YUYV;
    const auto source = Open(options);
    ASSERT_NE(source, nullptr);
    char text[80];
    std::snprintf(text, sizeof(text), "YUYV %dx%d at %.4g Hz", mode.width_px, mode.height_px, mode.rate_hz);
    EXPECT_THAT(source->Describe(), HasSubstr(text));
    const Result<Frame> frame = Next(*source);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    EXPECT_EQ(frame->image.width, mode.width_px);
    EXPECT_EQ(frame->image.height, mode.height_px);
  }
}

TEST_F(Vivid, InterlacedIsRefusedAndAFieldIsRead) {
  const Switches switches(path_);
  switches.SetSignal(Switches::kSelected, "1920x1080i");
  V4l2Options options = Options(0, 0, 0, "1");
  EXPECT_THAT(V4l2Source::Create(options, {}, SystemDeviceIo()).status().message(), HasSubstr("field=top"));
  options.field = FieldChoice::kTop;
  SequenceOptions sequence;
  sequence.halve = true;
  const auto source = Open(options, sequence);
  ASSERT_NE(source, nullptr);
  const Result<Frame> frame = Next(*source);
  ASSERT_TRUE(frame.ok()) << frame.status().ToString();
  EXPECT_EQ(frame->image.width, 960);
  EXPECT_EQ(frame->image.height, 540);
  ExpectBars(frame->image);
}

TEST_F(Vivid, AMissingSignalIsSaid) {
  const Switches switches(path_);
  switches.SetSignal(Switches::kNoSignal, nullptr);
  const auto source = V4l2Source::Create(Options(0, 0, 0, "1"), {}, SystemDeviceIo());
  EXPECT_EQ(source.code(), StatusCode::kUnavailable);
  EXPECT_THAT(source.status().message(), HasSubstr("no signal"));
  switches.SetSignal(Switches::kAsSet, nullptr);
}

TEST_F(Vivid, TenSecondsAt25HzAreWithoutLoss) {
  const Switches switches(path_);
  switches.SetSignal(Switches::kSelected, "1920x1080p25");
  V4l2Options options = Options(1440, 1080, 0, "1");
  options.skip_stale = false;
  const auto source = Open(options);
  ASSERT_NE(source, nullptr);
  TimePoint first, last;
  for (std::uint32_t i = 0; i < 250; ++i) {
    const Result<Frame> frame = Next(*source);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    ASSERT_EQ(frame->index, i);
    if (i == 0) first = frame->timestamp;
    last = frame->timestamp;
  }
  EXPECT_NEAR(ToSeconds(last - first), 249 * 0.04, 0.1);
  EXPECT_EQ(source->counters().num_lost, 0u);
}

TEST_F(Vivid, DroppedBuffersAreCounted) {
  const Switches switches(path_);
  V4l2Options options = Options(640, 360, 0);
  options.skip_stale = false;
  const auto source = Open(options);
  ASSERT_NE(source, nullptr);
  switches.Set("Percentage of Dropped Buffers", 40);
  std::uint32_t first = 0, last = 0;
  constexpr std::uint32_t kNum = 30;
  for (std::uint32_t i = 0; i < kNum; ++i) {
    std::set<StatusCode> silent;
    const Result<Frame> frame = NextFrame(*source, &silent);
    ASSERT_TRUE(frame.ok()) << frame.status().ToString();
    if (i == 0) first = frame->index;
    last = frame->index;
  }
  switches.Set("Percentage of Dropped Buffers", 0);
  EXPECT_GT(source->counters().num_lost, 0u);
  EXPECT_EQ(last - first + 1, kNum + source->counters().num_lost);
}

TEST_F(Vivid, ErrorFlagsAndFatalErrorsAreSurvived) {
  const Switches switches(path_);
  const auto source = Open(Options(640, 360, 0));
  ASSERT_NE(source, nullptr);
  ASSERT_TRUE(Next(*source).ok());
  std::set<StatusCode> codes;
  switches.Set("Inject V4L2_BUF_FLAG_ERROR", 1);
  ASSERT_TRUE(NextFrame(*source, &codes).ok());
  ASSERT_TRUE(NextFrame(*source, &codes).ok());
  EXPECT_EQ(source->counters().num_damaged, 1u);
  switches.Set("Inject Fatal Streaming Error", 1);
  codes.clear();
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(NextFrame(*source, &codes).ok());
  EXPECT_EQ(codes.count(StatusCode::kUnavailable), 1u);
  EXPECT_EQ(source->counters().num_restarts, 1u);
}

// The driver comes back by itself when nobody has it open any more.
TEST_F(Vivid, DisconnectAndReturn) {
  const auto source = Open(Options(640, 360, 0));
  ASSERT_NE(source, nullptr);
  const Result<Frame> before = Next(*source);
  ASSERT_TRUE(before.ok());
  Switches(path_).Set("Disconnect", 1);
  std::set<StatusCode> codes;
  Result<Frame> gone = Next(*source);
  for (int i = 0; i < 10 && gone.ok(); ++i) gone = Next(*source);
  EXPECT_EQ(gone.code(), StatusCode::kUnavailable);
  const Result<Frame> after = NextFrame(*source, &codes);
  ASSERT_TRUE(after.ok()) << after.status().ToString();
  EXPECT_GT(after->index, before->index);
  EXPECT_GT(after->timestamp, before->timestamp);
  EXPECT_EQ(source->counters().num_restarts, 1u);
}

// Last, because the driver is bound anew: the device goes from the bus, and its node with it.
TEST_F(Vivid, ZzUnplugAndReplug) {
  const auto source = Open(Options(640, 360, 0));
  ASSERT_NE(source, nullptr);
  ASSERT_TRUE(Next(*source).ok());
  std::ofstream("/sys/bus/platform/drivers/vivid/unbind") << "vivid.0" << std::flush;
  Result<Frame> gone = Next(*source);
  for (int i = 0; i < 10 && gone.ok(); ++i) gone = Next(*source);
  EXPECT_EQ(gone.code(), StatusCode::kUnavailable);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Next(*source).code(), StatusCode::kUnavailable);
  std::ofstream("/sys/bus/platform/drivers/vivid/bind") << "vivid.0" << std::flush;
  std::set<StatusCode> codes;
  const Result<Frame> after = NextFrame(*source, &codes);
  ASSERT_TRUE(after.ok()) << after.status().ToString();
  EXPECT_EQ(source->counters().num_restarts, 1u);
}

}  // namespace
}  // namespace haustra
