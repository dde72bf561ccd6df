// What is asked of a camera, and how it is written in one word on a command line or in a configuration file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra {

// Which rows of an interlaced picture are used; the other field was taken half a period earlier or later.
enum class FieldChoice { kProgressive, kTop, kBottom };

// Where the camera writes its pictures.
enum class BufferMemory {
  kMapped,  // memory of the driver, mapped
  // Memory of the system's DMA heap, which the driver imports (DMA-BUF): cached, where the driver's own is often not on
  // an embedded board, and then slow to read. Where the heap or the driver does not have it: kMapped.
  kDmaBuf,
};

// Part of the picture in pixels, before halving.
struct PictureRegion {
  int x_px = 0;
  int y_px = 0;
  int width_px = 0;  // 0: the whole picture
  int height_px = 0;

  bool is_whole() const { return width_px == 0; }
};

struct V4l2Options {
  std::string device;  // node or link (/dev/video0, /dev/v4l/by-id/...), or a part of the name that only one device has
  std::string input;   // name or number of a connector; empty: the one that is set
  std::uint32_t format = 0;  // V4L2's four characters: GREY NV12 YUYV UYVY MJPG; 0: the one that costs least
  int width_px = 0;          // of the picture that the camera sends; 0: the calibration's, else as it is set
  int height_px = 0;
  double rate_hz = 0.0;  // 0: the calibration's, else max_rate_hz, or what comes nearest
  // Frames beyond this rate are left out. The engine is made for 25 Hz.
  double max_rate_hz = 25.0;                      // > 0
  FieldChoice field = FieldChoice::kProgressive;  // a field goes together with halving: it has every other row
  PictureRegion region;
  BufferMemory memory = BufferMemory::kMapped;
  int num_buffers = 4;  // [2, 32]; one is with the reader, the camera always has one to fill
  // The camera may be plugged in later. Otherwise it must be there when the source is made.
  bool may_come_later = false;
  // After a pause of the reader only the newest picture counts; a recorder wants all that there are.
  bool skip_stale = true;

  // kInvalidArgument, naming the value.
  Status Validate() const;
};

inline constexpr std::string_view kV4l2Prefix = "v4l2:";

// Whether a path names a camera.
bool IsV4l2Spec(std::string_view path);

// "v4l2:DEVICE[,key=value...]", for example v4l2:/dev/video0,size=1440x1080,rate=50,format=NV12. Keys: size=WxH,
// rate=HZ, max-rate=HZ, format=NV12|YUYV|UYVY|GREY|MJPEG, input=NAME|NUMBER, region=WxH+X+Y, field=top|bottom,
// buffers=N, memory=mapped|dmabuf, wait=yes|no. kInvalidArgument quotes the part that is wrong.
Result<V4l2Options> ParseV4l2Spec(std::string_view spec);

// "NV12" of its number, and back; other characters than printable ones become '?'. kInvalidArgument: not a format that
// is read here.
std::string FourccText(std::uint32_t fourcc);
Result<std::uint32_t> ParseV4l2Format(std::string_view text);

}  // namespace haustra
