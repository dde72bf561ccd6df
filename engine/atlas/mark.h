// A place on the wall that a doctor has marked: a point and the patch of wall around it, held by a keyframe. Whatever
// moves the keyframe (bundles, loops, joins) moves the mark, and a keyframe that goes hands its marks to the one that
// stands in for it. Plain data; lengths are map units.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "engine/atlas/handles.h"
#include "hal/core/time.h"

namespace haustra {

// The most that an atlas may hold (memory.max_marks) and that is answered with a frame.
inline constexpr int kMaxMarks = 32;
inline constexpr std::size_t kMaxMarkLabelBytes = 31;

// 1 to 31 letters, digits, '.', '_' or '-', the first a letter or digit: it goes into tables, pages and commands.
class MarkLabel {
 public:
  MarkLabel() = default;
  // Nothing when the text is no label.
  static std::optional<MarkLabel> From(std::string_view text) {
    const auto is_alphanumeric = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; };
    const bool is_label = !text.empty() && text.size() <= kMaxMarkLabelBytes && is_alphanumeric(text.front()) &&
                          std::all_of(text.begin(), text.end(),
                                      [&](char c) { return is_alphanumeric(c) || c == '.' || c == '_' || c == '-'; });
    if (!is_label) return std::nullopt;
    MarkLabel label;
    std::copy(text.begin(), text.end(), label.bytes_.begin());
    return label;
  }

  std::string_view view() const { return bytes_.data(); }
  // Zeros fill what the text leaves, one at least.
  const std::array<char, kMaxMarkLabelBytes + 1>& bytes() const { return bytes_; }
  friend bool operator==(const MarkLabel&, const MarkLabel&) = default;

 private:
  std::array<char, kMaxMarkLabelBytes + 1> bytes_{};
};

struct Mark {
  MarkId id = 0;  // never given twice, not in later runs either
  MarkLabel label;
  // When it was set: the run, and the frame that the doctor saw.
  std::uint32_t session = 0;
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  KeyframeHandle keyframe;                                       // that holds it, alive
  Eigen::Vector3d point_in_anchor = Eigen::Vector3d::Zero();     // camera frame of that keyframe
  Eigen::Vector3d normal_in_anchor = -Eigen::Vector3d::UnitZ();  // of the wall, towards the side that was seen, unit
  double radius = 0.0;                                           // of the patch
  double scale = 1.0;  // KeyframeTrace::scale of the keyframe when these lengths were measured
};

// Where a mark is now, in the frame of its map.
struct PlacedMark {
  MapHandle map;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

}  // namespace haustra
