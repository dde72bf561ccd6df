#include "capture/v4l2/v4l2_options.h"

#include <linux/videodev2.h>

#include <charconv>
#include <cmath>
#include <utility>

namespace haustra {
namespace {

constexpr int kMaxSide = 16384;

Status Wrong(std::string_view part, std::string_view expected) {
  return InvalidArgument("camera option '" + std::string(part) + "': " + std::string(expected));
}

template <typename Number>
bool Parse(std::string_view text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

bool ParseSize(std::string_view text, int* width, int* height) {
  const std::size_t x = text.find('x');
  if (x == std::string_view::npos) return false;
  return Parse(text.substr(0, x), width) && Parse(text.substr(x + 1), height) && *width > 0 && *height > 0 &&
         *width <= kMaxSide && *height <= kMaxSide;
}

bool ParseRegion(std::string_view text, PictureRegion* region) {
  const std::size_t first = text.find('+');
  if (first == std::string_view::npos) return false;
  const std::size_t second = text.find('+', first + 1);
  if (second == std::string_view::npos) return false;
  return ParseSize(text.substr(0, first), &region->width_px, &region->height_px) &&
         Parse(text.substr(first + 1, second - first - 1), &region->x_px) &&
         Parse(text.substr(second + 1), &region->y_px) && region->x_px >= 0 && region->y_px >= 0 &&
         region->x_px <= kMaxSide && region->y_px <= kMaxSide;
}

bool IsRate(double rate_hz) { return std::isfinite(rate_hz) && rate_hz > 0.0 && rate_hz <= 1000.0; }

Status SetOption(std::string_view part, V4l2Options* options) {
  const std::size_t equals = part.find('=');
  if (equals == std::string_view::npos) {
    return Wrong(
        part,
        "expected key=value with one of size, rate, max-rate, format, input, region, field, buffers, memory, wait");
  }
  const std::string_view key = part.substr(0, equals);
  const std::string_view value = part.substr(equals + 1);
  if (key == "size") {
    if (!ParseSize(value, &options->width_px, &options->height_px))
      return Wrong(part, "expected a size like 1440x1080");
  } else if (key == "rate" || key == "max-rate") {
    double& rate = key == "rate" ? options->rate_hz : options->max_rate_hz;
    if (!Parse(value, &rate) || !IsRate(rate)) return Wrong(part, "expected frames a second, more than 0, up to 1000");
  } else if (key == "format") {
    HAUSTRA_ASSIGN(options->format, ParseV4l2Format(value));
  } else if (key == "input") {
    if (value.empty()) return Wrong(part, "expected the name or the number of an input");
    options->input = value;
  } else if (key == "region") {
    if (!ParseRegion(value, &options->region)) return Wrong(part, "expected a region like 1350x1080+45+0");
  } else if (key == "field") {
    if (value != "top" && value != "bottom") return Wrong(part, "expected top or bottom");
    options->field = value == "top" ? FieldChoice::kTop : FieldChoice::kBottom;
  } else if (key == "buffers") {
    if (!Parse(value, &options->num_buffers)) return Wrong(part, "expected a number from 2 to 32");
  } else if (key == "memory") {
    if (value != "mapped" && value != "dmabuf") return Wrong(part, "expected mapped or dmabuf");
    options->memory = value == "dmabuf" ? BufferMemory::kDmaBuf : BufferMemory::kMapped;
  } else if (key == "wait") {
    if (value != "yes" && value != "no") return Wrong(part, "expected yes or no");
    options->may_come_later = value == "yes";
  } else {
    return Wrong(part, "unknown; there are size, rate, max-rate, format, input, region, field, buffers, memory, wait");
  }
  return Status::Ok();
}

}  // namespace

Status V4l2Options::Validate() const {
  if (device.empty()) return InvalidArgument("the camera has no name; expected v4l2:/dev/video0 or v4l2:NAME");
  if (num_buffers < 2 || num_buffers > 32) {
    return InvalidArgument("camera option 'buffers=" + std::to_string(num_buffers) +
                           "': expected a number from 2 to 32");
  }
  if (format == V4L2_PIX_FMT_MJPEG && field != FieldChoice::kProgressive) {
    return InvalidArgument("camera option 'field': fields of MJPEG pictures are not read; choose another format");
  }
  if (!IsRate(max_rate_hz)) return InvalidArgument("camera option 'max-rate': more than 0, up to 1000");
  return Status::Ok();
}

bool IsV4l2Spec(std::string_view path) { return path.substr(0, kV4l2Prefix.size()) == kV4l2Prefix; }

Result<V4l2Options> ParseV4l2Spec(std::string_view spec) {
  if (!IsV4l2Spec(spec)) return InvalidArgument("'" + std::string(spec) + "' does not begin with v4l2:");
  std::string_view rest = spec.substr(kV4l2Prefix.size());
  V4l2Options options;
  options.device = rest.substr(0, rest.find(','));
  while (rest.find(',') != std::string_view::npos) {
    rest.remove_prefix(rest.find(',') + 1);
    HAUSTRA_TRY(SetOption(rest.substr(0, rest.find(',')), &options));
  }
  HAUSTRA_TRY(options.Validate());
  return options;
}

std::string FourccText(std::uint32_t fourcc) {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    const char c = static_cast<char>((fourcc >> (8 * i)) & 0xff);
    text.push_back(c > ' ' && c <= '~' ? c : (c == ' ' ? ' ' : '?'));
  }
  return text;
}

Result<std::uint32_t> ParseV4l2Format(std::string_view text) {
  constexpr std::pair<std::string_view, std::uint32_t> kNames[] = {
      {"NV12", V4L2_PIX_FMT_NV12}, {"YUYV", V4L2_PIX_FMT_YUYV},   {"UYVY", V4L2_PIX_FMT_UYVY},
      {"GREY", V4L2_PIX_FMT_GREY}, {"MJPEG", V4L2_PIX_FMT_MJPEG}, {"MJPG", V4L2_PIX_FMT_MJPEG},
  };
  for (const auto& [name, fourcc] : kNames) {
    if (text == name) return fourcc;
  }
  return Wrong("format=" + std::string(text), "expected NV12, YUYV, UYVY, GREY or MJPEG");
}

}  // namespace haustra
