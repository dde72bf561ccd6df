// The cameras of this machine and what they can send.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "capture/v4l2/device_io.h"
#include "hal/core/status.h"

namespace haustra {

struct V4l2FormatInfo {
  std::uint32_t fourcc = 0;
  bool is_readable = false;  // one of those that V4l2Source reads
  struct Size {
    int width_px = 0;
    int height_px = 0;
    int step_px = 0;               // 0: just this size; else every size up to this one in such steps
    std::vector<double> rates_hz;  // largest first; empty: the device does not say
  };
  std::vector<Size> sizes;  // empty: the device does not say
};

struct V4l2DeviceInfo {
  std::string path;
  std::string name;  // as the driver calls the device
  std::string bus;
  std::string driver;
  std::vector<std::string> inputs;
  std::vector<V4l2FormatInfo> formats;
};

// Devices that capture pictures to mapped memory, by number. What cannot be opened (no right, in use) is left out, with
// "PATH: reason" in `unreadable` when that is not null.
std::vector<V4l2DeviceInfo> ListV4l2Devices(DeviceIo& io, std::vector<std::string>* unreadable);

// The node for a path (given back as it is) or a part of a name or bus, capitals or not. kUnavailable: no device has
// it now, or several have. The message lists the devices that are there.
Result<std::string> FindV4l2Device(const std::string& wanted, DeviceIo& io);

namespace capture::internal {

// Of an open device.
std::vector<V4l2FormatInfo> ListFormats(int fd, DeviceIo& io);
std::vector<double> ListRates(int fd, std::uint32_t fourcc, int width_px, int height_px, DeviceIo& io);
// "YUYV 1920x1080 (30, 5 Hz), MJPG 1920x1080 (60 Hz)"
std::string FormatsText(const std::vector<V4l2FormatInfo>& formats);
bool IsReadable(std::uint32_t fourcc);

}  // namespace capture::internal
}  // namespace haustra
