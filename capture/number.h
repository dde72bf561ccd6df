// Numbers from text and back, strictly: the whole of it or nothing, '.' as the decimal point whatever the locale.
// reentrant.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra::capture::internal {

inline bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// Errors (kInvalidArgument) quote the text: "'1.2.3' is not a number", "'nan' is not finite".
Result<double> ParseDouble(std::string_view text);
Result<std::int64_t> ParseInteger(std::string_view text);

// Decimal seconds to nanoseconds without a detour through floating point, rounded to nearest: "1403636579.763555527"
// keeps its last digit. Also accepts an exponent, then at the precision of a double.
Result<std::int64_t> ParseSeconds(std::string_view text);

// Shortest text that ParseDouble turns into the same double.
std::string FormatDouble(double value);
// Nanoseconds as seconds with nine decimals.
std::string FormatSeconds(std::int64_t nanoseconds);

// "640x480".
std::string SizeText(int width_px, int height_px);

}  // namespace haustra::capture::internal
