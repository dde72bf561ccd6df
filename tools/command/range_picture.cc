#include "tools/command/range_picture.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "capture/files/whole_file.h"

namespace haustra {
namespace {

constexpr int kMaxValue = 65535;
constexpr int kMaxSide = 1 << 14;
constexpr std::size_t kMaxRangePictureBytes = std::size_t{2} * kMaxSide * kMaxSide + 4096;

// The next number of the header, behind blanks and comments.
bool NextNumber(std::string_view* text, int* number) {
  while (!text->empty()) {
    if (text->front() == '#') {
      text->remove_prefix(std::min(text->find('\n'), text->size()));
    } else if (text->front() == ' ' || text->front() == '\n' || text->front() == '\t' || text->front() == '\r') {
      text->remove_prefix(1);
    } else {
      break;
    }
  }
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), *number);
  if (error != std::errc()) return false;
  text->remove_prefix(end - text->data());
  return true;
}

}  // namespace

std::string RangePictureBytes(const RangePicture& picture) {
  std::string bytes = "P5\n# range along the ray, 1/256 mm; 0: not known\n" + std::to_string(picture.width) + " " +
                      std::to_string(picture.height) + "\n" + std::to_string(kMaxValue) + "\n";
  bytes.reserve(bytes.size() + 2 * picture.range_mm.size());
  for (const float range_mm : picture.range_mm) {
    const double rounded = std::round(range_mm / RangePicture::kUnitMm);
    const int value = rounded >= 1.0 && rounded <= kMaxValue ? static_cast<int>(rounded) : 0;
    bytes.push_back(static_cast<char>(value >> 8));
    bytes.push_back(static_cast<char>(value & 0xff));
  }
  return bytes;
}

Result<RangePicture> ReadRangePicture(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string bytes, ReadWholeText(path, kMaxRangePictureBytes));
  std::string_view rest = bytes;
  RangePicture picture;
  int max_value = 0;
  if (!rest.starts_with("P5")) return InvalidArgument(path + ": not a PGM file (it does not begin with P5)");
  rest.remove_prefix(2);
  if (!NextNumber(&rest, &picture.width) || !NextNumber(&rest, &picture.height) || !NextNumber(&rest, &max_value)) {
    return InvalidArgument(path + ": width, height and largest value expected after P5");
  }
  if (picture.width < 1 || picture.height < 1 || picture.width > kMaxSide || picture.height > kMaxSide) {
    return InvalidArgument(path + ": size " + std::to_string(picture.width) + "x" + std::to_string(picture.height));
  }
  if (max_value != kMaxValue) {
    return InvalidArgument(path + ": largest value " + std::to_string(max_value) + ", 65535 expected");
  }
  const std::size_t count = std::size_t(picture.width) * picture.height;
  if (rest.size() != 1 + 2 * count) {
    return InvalidArgument(path + ": " + std::to_string(rest.size()) + " bytes of values, " +
                           std::to_string(1 + 2 * count) + " expected");
  }
  picture.range_mm.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto high = static_cast<unsigned char>(rest[1 + 2 * i]), low = static_cast<unsigned char>(rest[2 + 2 * i]);
    picture.range_mm.push_back(static_cast<float>((high * 256 + low) * RangePicture::kUnitMm));
  }
  return picture;
}

}  // namespace haustra
