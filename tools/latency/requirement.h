// What a vendor requires of a board: a YAML file of limits, such as
//   p99.9_ms: 25     # of the time from capture to pose
//   misses: 0        # deadlines missed
//   frames: 30000    # at least so many frames have to be measured
// and whether a measurement meets it.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

// The figures of a measurement that can be limited.
struct LatencyFigureValues {
  double p50_ms = 0, p99_ms = 0, p999_ms = 0, max_ms = 0;
  double misses = 0, drops = 0, reduced = 0, predicted = 0, page_faults = 0, frames = 0;
};

struct RequirementKey {
  std::string_view name;
  double LatencyFigureValues::*value;
  bool is_minimum;  // else the largest value that is allowed
  std::string_view meaning;
};
inline constexpr std::array<RequirementKey, 10> kRequirementKeys = {{
    {"p50_ms", &LatencyFigureValues::p50_ms, false, "median from capture to pose"},
    {"p99_ms", &LatencyFigureValues::p99_ms, false, "99 of 100 frames take no longer"},
    {"p99.9_ms", &LatencyFigureValues::p999_ms, false, "999 of 1000 frames take no longer"},
    {"max_ms", &LatencyFigureValues::max_ms, false, "no frame takes longer"},
    {"misses", &LatencyFigureValues::misses, false, "frames answered after their deadline"},
    {"drops", &LatencyFigureValues::drops, false, "frames never looked at"},
    {"reduced", &LatencyFigureValues::reduced, false, "frames that left something out to be in time"},
    {"predicted", &LatencyFigureValues::predicted, false, "frames answered without a measurement"},
    {"page_faults", &LatencyFigureValues::page_faults, false, "of the tracking thread"},
    {"frames", &LatencyFigureValues::frames, true, "measured"},
}};

struct Requirement {
  // As kRequirementKeys; nothing: not limited.
  std::array<std::optional<double>, kRequirementKeys.size()> limits;
};

// kNotFound, kUnavailable: the file. kFailedPrecondition: "file:line:column: what is wrong", one line a problem:
// unknown or repeated key, not a number of at least 0, not a map of keys to numbers; no key at all.
Result<Requirement> LoadRequirement(const std::string& path);
Result<Requirement> ParseRequirement(const std::string& text, const std::string& name);

struct RequirementLine {
  std::string_view name;
  double limit = 0;
  double value = 0;
  bool is_minimum = false;
  bool is_met = false;
};
std::vector<RequirementLine> Judge(const Requirement& requirement, const LatencyFigureValues& values);

}  // namespace haustra
