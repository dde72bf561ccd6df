// A scope that is a recording: plays a sequence into the output side of a v4l2loopback device, each frame at its time.
//
//     loopback_feed SEQUENCE DEVICE GROUNDTRUTH
//
// The first frame is sent a second ahead, too: until there is one, the other side has no format. The poses of
// SEQUENCE/groundtruth.txt are written to GROUNDTRUTH with the times at which their frames were sent. Exit code 0, or 1
// and a message.
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "capture/open_sequence.h"
#include "capture/v4l2/device_io.h"

namespace haustra {
namespace {

int Fail(const std::string& message) {
  std::fprintf(stderr, "loopback_feed: %s\n", message.c_str());
  return 1;
}

int Feed(const std::string& sequence, const std::string& device, const std::string& groundtruth) {
  SequenceOptions options;
  options.channels = ChannelChoice::kGrey;
  const Result<std::unique_ptr<FrameSource>> source = OpenSequence(sequence, options);
  if (!source.ok()) return Fail(source.status().message());
  const CameraCalibration& camera = (*source)->calibration();
  std::ifstream poses(sequence + "/groundtruth.txt");
  std::ofstream sent(groundtruth);
  if (!poses || !sent) return Fail("ground truth: " + std::string(std::strerror(errno)));

  const int fd = open(device.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return Fail(device + ": " + std::strerror(errno));
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  format.fmt.pix.width = static_cast<__u32>(camera.width_px);
  format.fmt.pix.height = static_cast<__u32>(camera.height_px);
  format.fmt.pix.pixelformat = V4L2_PIX_FMT_GREY;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (ioctl(fd, VIDIOC_S_FMT, &format) != 0) return Fail(device + ": VIDIOC_S_FMT: " + std::strerror(errno));
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  parameters.parm.output.timeperframe = {1000, static_cast<__u32>(1000 * camera.rate_hz)};
  if (ioctl(fd, VIDIOC_S_PARM, &parameters) != 0) return Fail(device + ": VIDIOC_S_PARM: " + std::strerror(errno));

  DeviceIo& io = SystemDeviceIo();
  const TimePoint start = io.Now() + std::chrono::seconds(1);
  TimePoint first;
  std::vector<std::uint8_t> picture;
  for (int num_frames = 0;; ++num_frames) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) return num_frames > 0 ? 0 : Fail("no frames");
    if (!frame.ok()) return Fail(frame.status().message());
    picture.clear();
    for (int y = 0; y < camera.height_px; ++y) {
      picture.insert(picture.end(), frame->image.row(y), frame->image.row(y) + camera.width_px);
    }
    const auto send = [&] { return write(fd, picture.data(), picture.size()) == static_cast<ssize_t>(picture.size()); };
    if (num_frames == 0) {
      first = frame->timestamp;
      if (!send()) return Fail(device + ": write: " + std::strerror(errno));
    }
    io.Sleep(start + (frame->timestamp - first) - io.Now());
    const double now_s = ToSeconds(io.Now().time_since_epoch());
    if (!send()) return Fail(device + ": write: " + std::strerror(errno));
    std::string pose;
    do {
      if (!std::getline(poses, pose)) return Fail("fewer poses than frames");
    } while (pose.empty() || pose[0] == '#');
    char text[32];
    std::snprintf(text, sizeof text, "%.6f", now_s);
    sent << text << pose.substr(pose.find(' ')) << '\n';
  }
}

}  // namespace
}  // namespace haustra

int main(int argc, char** argv) {
  if (argc != 4) return haustra::Fail("usage: loopback_feed SEQUENCE DEVICE GROUNDTRUTH");
  return haustra::Feed(argv[1], argv[2], argv[3]);
}
