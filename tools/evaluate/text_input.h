// Lines, fields and numbers of text files, strictly: the whole field is the number or there is none. reentrant.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace haustra::evaluate {

// Lines without their ends ("\n" or "\r\n"); line i of the file is lines[i - 1].
std::vector<std::string_view> SplitLines(std::string_view text);
// Fields between separators; blanks around a field are not part of it.
std::vector<std::string_view> SplitFields(std::string_view line, char separator);
// Fields between runs of blanks.
std::vector<std::string_view> SplitBlanks(std::string_view line);

std::optional<std::int64_t> ParseInteger(std::string_view text);
// Finite numbers only.
std::optional<double> ParseNumber(std::string_view text);

}  // namespace haustra::evaluate
