// Looking into folders and line-based text files. reentrant.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra::capture::internal {

bool IsFolder(const std::string& path);
bool IsFile(const std::string& path);
std::string Joined(const std::string& folder, std::string_view name);
// Last part of a path; lower-case extension with its dot.
std::string FileName(const std::string& path);
std::string Extension(const std::string& path);

// Whether its entries can be listed. kNotFound, kInvalidArgument (not a folder), kUnavailable (rights, I/O).
Status CheckFolder(const std::string& folder);

// Names of the files (not folders) directly inside, hidden ones left out, in natural order. Errors of
// CheckFolder.
Result<std::vector<std::string>> FileNames(const std::string& folder);

// Compares names as people count: runs of digits by their value, so that 2_color.png comes before 10_color.png.
bool NaturalLess(std::string_view a, std::string_view b);

bool HasImageExtension(std::string_view name);
bool HasVideoExtension(std::string_view name);

struct TextLine {
  int number = 0;  // from 1
  std::string_view text;
};
// Lines that hold something other than a comment (#), without surrounding blanks. Views into `text`.
std::vector<TextLine> ContentLines(std::string_view text);
// Fields between separators, without surrounding blanks. With a blank as separator, runs of blanks and tabs count as
// one.
std::vector<std::string_view> SplitFields(std::string_view line, char separator);

// Collects time stamps, which must increase from line to line.
class StampList {
 public:
  explicit StampList(std::string path) : path_(std::move(path)) {}
  // kInvalidArgument: not after the one before; names both lines.
  Status Add(int line, std::int64_t timestamp_ns);
  std::vector<std::int64_t>& values() { return values_; }

 private:
  std::string path_;
  int last_line_ = 0;
  std::vector<std::int64_t> values_;
};

}  // namespace haustra::capture::internal
