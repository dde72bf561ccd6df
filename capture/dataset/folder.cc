#include "capture/dataset/folder.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <system_error>

#include "capture/number.h"

namespace haustra::capture::internal {
namespace {

namespace fs = std::filesystem;

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
  return text;
}

// Cuts the run of digits that `text` begins with, leading zeros left out of the result.
std::string_view TakeDigits(std::string_view* text) {
  std::size_t size = 0;
  while (size < text->size() && IsDigit((*text)[size])) ++size;
  std::string_view digits = text->substr(0, size);
  text->remove_prefix(size);
  while (digits.size() > 1 && digits.front() == '0') digits.remove_prefix(1);
  return digits;
}

template <std::size_t N>
bool HasExtension(std::string_view name, const std::array<std::string_view, N>& extensions) {
  const std::string extension = Extension(std::string(name));
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
}

}  // namespace

bool IsFolder(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

bool IsFile(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

std::string Joined(const std::string& folder, std::string_view name) { return (fs::path(folder) / name).string(); }

std::string FileName(const std::string& path) { return fs::path(path).filename().string(); }

std::string Extension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return extension;
}

Status CheckFolder(const std::string& folder) {
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (status.type() == fs::file_type::not_found) return NotFound(folder + ": no such folder");
  if (!fs::status_known(status)) return Unavailable(folder + ": cannot be reached: " + error.message());
  if (!fs::is_directory(status)) return InvalidArgument(folder + ": not a folder");
  const fs::directory_iterator entries(folder, error);
  return error ? Unavailable(folder + ": cannot be read: " + error.message()) : Status::Ok();
}

Result<std::vector<std::string>> FileNames(const std::string& folder) {
  HAUSTRA_TRY(CheckFolder(folder));
  std::error_code error;
  std::vector<std::string> names;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code type_error;
    if (!entry->is_regular_file(type_error)) continue;
    std::string name = entry->path().filename().string();
    if (!name.starts_with('.')) names.push_back(std::move(name));
  }
  if (error) return Unavailable(folder + ": cannot be read: " + error.message());
  std::sort(names.begin(), names.end(), NaturalLess);
  return names;
}

bool NaturalLess(std::string_view a, std::string_view b) {
  std::string_view rest_a = a;
  std::string_view rest_b = b;
  while (!rest_a.empty() && !rest_b.empty()) {
    if (IsDigit(rest_a.front()) && IsDigit(rest_b.front())) {
      const std::string_view digits_a = TakeDigits(&rest_a);
      const std::string_view digits_b = TakeDigits(&rest_b);
      if (digits_a.size() != digits_b.size()) return digits_a.size() < digits_b.size();
      if (digits_a != digits_b) return digits_a < digits_b;
      continue;
    }
    if (rest_a.front() != rest_b.front()) return rest_a.front() < rest_b.front();
    rest_a.remove_prefix(1);
    rest_b.remove_prefix(1);
  }
  if (rest_a.empty() != rest_b.empty()) return rest_a.empty();
  return a < b;  // the same but for leading zeros
}

bool HasImageExtension(std::string_view name) {
  return HasExtension(name, std::array<std::string_view, 3>{".png", ".jpg", ".jpeg"});
}

bool HasVideoExtension(std::string_view name) {
  return HasExtension(name, std::array<std::string_view, 5>{".mp4", ".mov", ".avi", ".mkv", ".m4v"});
}

std::vector<TextLine> ContentLines(std::string_view text) {
  std::vector<TextLine> lines;
  int number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++number;
    if (!line.empty() && line.front() != '#') lines.push_back({number, line});
  }
  return lines;
}

std::vector<std::string_view> SplitFields(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  if (separator == ' ') {
    while (true) {
      line = Trimmed(line);
      if (line.empty()) return fields;
      std::size_t size = 0;
      while (size < line.size() && !IsBlank(line[size])) ++size;
      fields.push_back(line.substr(0, size));
      line.remove_prefix(size);
    }
  }
  for (;;) {
    const std::size_t end = line.find(separator);
    fields.push_back(Trimmed(line.substr(0, end)));
    if (end == std::string_view::npos) return fields;
    line.remove_prefix(end + 1);
  }
}

Status StampList::Add(int line, std::int64_t timestamp_ns) {
  if (!values_.empty() && timestamp_ns <= values_.back()) {
    const std::string_view what =
        timestamp_ns == values_.back() ? " repeats that of line " : " is earlier than that of line ";
    return InvalidArgument(path_ + ":" + std::to_string(line) + ": time stamp " + FormatSeconds(timestamp_ns) + " s" +
                           std::string(what) + std::to_string(last_line_) + " (" + FormatSeconds(values_.back()) +
                           " s); time stamps must increase");
  }
  values_.push_back(timestamp_ns);
  last_line_ = line;
  return Status::Ok();
}

}  // namespace haustra::capture::internal
