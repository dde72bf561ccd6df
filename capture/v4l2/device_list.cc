#include "capture/v4l2/device_list.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

#include "capture/v4l2/device_text.h"
#include "capture/v4l2/v4l2_options.h"
#include "hal/core/errno_text.h"

namespace haustra {
namespace capture::internal {
namespace {

// Of each list that a driver gives, in case it never says that there are no more.
constexpr std::uint32_t kMaxEntries = 256;

double Rate(const v4l2_fract& interval) {
  return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0.0;
}

std::vector<V4l2FormatInfo::Size> ListSizes(int fd, std::uint32_t fourcc, DeviceIo& io) {
  std::vector<V4l2FormatInfo::Size> sizes;
  for (std::uint32_t i = 0; i < kMaxEntries; ++i) {
    v4l2_frmsizeenum entry{};
    entry.index = i;
    entry.pixel_format = fourcc;
    if (io.Ioctl(fd, VIDIOC_ENUM_FRAMESIZES, &entry) < 0) break;
    V4l2FormatInfo::Size size;
    if (entry.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      size.width_px = static_cast<int>(entry.discrete.width);
      size.height_px = static_cast<int>(entry.discrete.height);
    } else {
      size.width_px = static_cast<int>(entry.stepwise.max_width);
      size.height_px = static_cast<int>(entry.stepwise.max_height);
      size.step_px = static_cast<int>(std::max<__u32>(1, entry.stepwise.step_width));
    }
    size.rates_hz = ListRates(fd, fourcc, size.width_px, size.height_px, io);
    sizes.push_back(size);
    if (size.step_px > 0) break;
  }
  return sizes;
}

std::string RatesText(const std::vector<double>& rates_hz) {
  std::string text;
  for (const double rate : rates_hz) {
    char number[32];
    std::snprintf(number, sizeof(number), "%s%.4g", text.empty() ? "" : ", ", rate);
    text += number;
  }
  return text;
}

}  // namespace

bool IsReadable(std::uint32_t fourcc) {
  return fourcc == V4L2_PIX_FMT_NV12 || fourcc == V4L2_PIX_FMT_GREY || fourcc == V4L2_PIX_FMT_YUYV ||
         fourcc == V4L2_PIX_FMT_UYVY || fourcc == V4L2_PIX_FMT_MJPEG;
}

std::vector<double> ListRates(int fd, std::uint32_t fourcc, int width_px, int height_px, DeviceIo& io) {
  std::vector<double> rates;
  for (std::uint32_t i = 0; i < kMaxEntries; ++i) {
    v4l2_frmivalenum entry{};
    entry.index = i;
    entry.pixel_format = fourcc;
    entry.width = static_cast<__u32>(width_px);
    entry.height = static_cast<__u32>(height_px);
    if (io.Ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, &entry) < 0) break;
    // Of a range, the fastest: whatever is slower can be had.
    const bool is_range = entry.type != V4L2_FRMIVAL_TYPE_DISCRETE;
    const double rate = Rate(is_range ? entry.stepwise.min : entry.discrete);
    if (rate > 0.0) rates.push_back(rate);
    if (is_range) break;
  }
  std::sort(rates.rbegin(), rates.rend());
  return rates;
}

std::vector<V4l2FormatInfo> ListFormats(int fd, DeviceIo& io) {
  std::vector<V4l2FormatInfo> formats;
  for (std::uint32_t i = 0; i < kMaxEntries; ++i) {
    v4l2_fmtdesc entry{};
    entry.index = i;
    entry.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (io.Ioctl(fd, VIDIOC_ENUM_FMT, &entry) < 0) break;
    formats.push_back({entry.pixelformat, IsReadable(entry.pixelformat), ListSizes(fd, entry.pixelformat, io)});
  }
  return formats;
}

std::string FormatsText(const std::vector<V4l2FormatInfo>& formats) {
  std::string text;
  for (const V4l2FormatInfo& format : formats) {
    if (!format.is_readable) continue;
    const std::string name = FourccText(format.fourcc);
    if (format.sizes.empty()) text += (text.empty() ? "" : ", ") + name;
    for (const V4l2FormatInfo::Size& size : format.sizes) {
      text += (text.empty() ? "" : ", ") + name + (size.step_px > 0 ? " up to " : " ") + std::to_string(size.width_px) +
              "x" + std::to_string(size.height_px);
      if (!size.rates_hz.empty()) text += " (" + RatesText(size.rates_hz) + " Hz)";
    }
  }
  return text.empty() ? "no format that is read here" : text;
}

namespace {

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

// Name and bus; kNotFound for what is no camera.
Result<V4l2DeviceInfo> Identify(const std::string& path, int fd, DeviceIo& io) {
  v4l2_capability capability{};
  if (const int error = io.Ioctl(fd, VIDIOC_QUERYCAP, &capability); error < 0) {
    return Unavailable(path + ": " + ErrnoText(-error));
  }
  const __u32 has =
      (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps : capability.capabilities;
  if ((has & V4L2_CAP_VIDEO_CAPTURE) == 0 || (has & V4L2_CAP_STREAMING) == 0) return NotFound(path + ": not a camera");
  V4l2DeviceInfo info;
  info.path = path;
  info.name = DeviceText(capability.card);
  info.bus = DeviceText(capability.bus_info);
  info.driver = DeviceText(capability.driver);
  return info;
}

// Calls `see` with each camera while it is open.
template <typename See>
void ForEachDevice(DeviceIo& io, std::vector<std::string>* unreadable, See&& see) {
  for (const std::string& path : io.DevicePaths()) {
    const int fd = io.Open(path);
    if (fd < 0) {
      if (unreadable != nullptr) unreadable->push_back(path + ": " + ErrnoText(-fd));
      continue;
    }
    Result<V4l2DeviceInfo> info = Identify(path, fd, io);
    if (info.ok()) see(*info, fd);
    if (info.code() == StatusCode::kUnavailable && unreadable != nullptr)
      unreadable->push_back(info.status().message());
    io.Close(fd);
  }
}

}  // namespace
}  // namespace capture::internal

std::vector<V4l2DeviceInfo> ListV4l2Devices(DeviceIo& io, std::vector<std::string>* unreadable) {
  using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library
  std::vector<V4l2DeviceInfo> devices;
  ForEachDevice(io, unreadable, [&](V4l2DeviceInfo& info, int fd) {
    for (std::uint32_t i = 0; i < kMaxEntries; ++i) {
      v4l2_input input{};
      input.index = i;
      if (io.Ioctl(fd, VIDIOC_ENUMINPUT, &input) < 0) break;
      info.inputs.push_back(DeviceText(input.name));
    }
    info.formats = ListFormats(fd, io);
    devices.push_back(info);
  });
  return devices;
}

Result<std::string> FindV4l2Device(const std::string& wanted, DeviceIo& io) {
  using namespace capture::internal;  // NOLINT(google-build-using-namespace): the parts of this library
  if (!wanted.empty() && wanted.front() == '/') return wanted;
  std::vector<std::string> fitting;
  std::string all;
  ForEachDevice(io, nullptr, [&](V4l2DeviceInfo& info, int) {
    all += (all.empty() ? "" : ", ") + info.path + " '" + info.name + "' (" + info.bus + ")";
    const std::string part = Lower(wanted);
    if (Lower(info.name).find(part) != std::string::npos || Lower(info.bus).find(part) != std::string::npos) {
      fitting.push_back(info.path);
    }
  });
  if (fitting.size() == 1) return fitting.front();
  const std::string there = all.empty() ? "there is no camera" : "there are " + all;
  if (fitting.empty()) return Unavailable("no camera has '" + wanted + "' in its name; " + there);
  return Unavailable("several cameras have '" + wanted + "' in their names; " + there);
}

}  // namespace haustra
