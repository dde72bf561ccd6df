#include "tools/command/output_folder.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <system_error>
#include <utility>
#include <vector>

#include "capture/files/file_sink.h"
#include "tools/command/stop_signal.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAsidePrefix = "replaced-";

// The names of `content`, what FileSink leaves when it is killed, and earlier results that were set aside.
std::string NamesIn(const FolderContent& content) {
  const std::string mark = content.mark.empty() ? "" : "|" + std::string(content.mark);
  return "((" + std::string(content.names) + mark + R"()(\.partial-\d+(-\d+)?)?|)" + kAsidePrefix + R"(\d+(/.*)?))";
}

std::regex OwnNames(const FolderContent& content) {
  std::string names = NamesIn(content);
  if (content.inner != nullptr) names += "|" + std::string(content.inner_name) + "(/" + NamesIn(*content.inner) + ")?";
  return std::regex(names);
}

struct Found {
  bool has_files = false;
  std::string foreign;  // the first name that is not of the content; empty: there is none
  bool has_mark = false;
};

Result<Found> LookInto(const std::string& path, const FolderContent& content) {
  const std::regex own = OwnNames(content);
  std::error_code error;
  Found found;
  fs::recursive_directory_iterator entry(path, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    const std::string name = entry->path().lexically_relative(path).generic_string();
    if (!std::regex_match(name, own)) {
      found.foreign = name;
      return found;
    }
    found.has_mark = found.has_mark || name == content.mark;
    found.has_files = found.has_files || entry->symlink_status().type() != fs::file_type::directory;
  }
  if (error) return Unavailable(path + ": cannot be read: " + error.message());
  return found;
}

// Entries of the folder itself.
std::vector<fs::path> Entries(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) entries.push_back(entry.path());
  return entries;
}

// Moves what is in one folder into another, but for that other itself. False: something could not be moved.
bool MoveEntries(const fs::path& from, const fs::path& to) {
  std::error_code error;
  for (const fs::path& entry : Entries(from)) {
    if (entry == to) continue;
    fs::rename(entry, to / entry.filename(), error);
    if (error) return false;
  }
  return true;
}

bool HoldsFiles(const fs::path& folder, const fs::path& but) {
  std::error_code error;
  for (const fs::path& entry : Entries(folder)) {
    if (entry == but) continue;
    if (fs::symlink_status(entry, error).type() != fs::file_type::directory || HoldsFiles(entry, but)) return true;
  }
  return false;
}

// One for all spellings, also of what is not there yet.
fs::path OneSpelling(const std::string& path) {
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  const fs::path canonical = fs::weakly_canonical(absolute, error);
  return error ? absolute.lexically_normal() : canonical;
}

std::string OptionText(const NamedOutput& output) { return std::string(output.option) + " " + output.path; }

// Whether `path` lies in `folder`, or is it.
bool IsIn(const fs::path& folder, const fs::path& path) {
  std::error_code error;
  const fs::path outer = fs::weakly_canonical(folder, error), inner = fs::weakly_canonical(path, error);
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

// Whether a file is empty, or one of the content.
Result<bool> IsReplaceable(const std::string& path, const FileContent& content) {
  std::size_t longest = 0;
  for (const std::string_view beginning : content.beginnings) longest = std::max(longest, beginning.size());
  std::string bytes(longest, '\0');
  std::ifstream file(path, std::ios::binary);
  if (!file) return Unavailable(path + ": exists and cannot be read");
  file.read(bytes.data(), static_cast<std::streamsize>(longest));
  if (file.bad()) return Unavailable(path + ": exists and cannot be read");
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes.empty() || std::any_of(content.beginnings.begin(), content.beginnings.end(),
                                      [&bytes](std::string_view beginning) { return bytes.starts_with(beginning); });
}

}  // namespace

Status OutputFolder::Check(const std::string& path, const FolderContent& content, bool overwrite) {
  if (path.empty()) return InvalidArgument("the name of the output folder is empty");
  std::error_code error;
  if (!fs::exists(path, error)) return Status::Ok();
  if (!fs::is_directory(path, error)) return FailedPrecondition(path + ": exists and is not a folder");
  HAUSTRA_ASSIGN(const Found found, LookInto(path, content));
  if (!found.foreign.empty()) {
    return FailedPrecondition(path + ": holds '" + found.foreign + "', which is not part of " +
                              std::string(content.what) + "; choose an empty or a new folder");
  }
  if (found.has_files && !content.mark.empty() && !found.has_mark) {
    return FailedPrecondition(path + ": has no '" + std::string(content.mark) + "', so its files need not be " +
                              std::string(content.what) + "; choose an empty or a new folder");
  }
  if (found.has_files && !overwrite) {
    return FailedPrecondition(path + ": holds " + std::string(content.what) + " already; --overwrite replaces it");
  }
  return Status::Ok();
}

Result<OutputFolder> OutputFolder::Create(const std::string& path, const FolderContent& content, bool overwrite) {
  HAUSTRA_TRY(Check(path, content, overwrite));
  CatchStopSignals();
  std::error_code error;
  OutputFolder folder(path, content);
  folder.is_new_ = !fs::exists(path, error);
  fs::create_directories(path, error);
  if (error) return Unavailable(path + ": cannot be made: " + error.message());
  HAUSTRA_TRY(folder.SetAside());
  if (!content.mark.empty()) {
    HAUSTRA_TRY(WriteFile((fs::path(path) / content.mark).string(), std::string(content.what) + " of haustra\n"));
  }
  return folder;
}

Status OutputFolder::SetAside() {
  if (Entries(path_).empty()) return Status::Ok();
  std::error_code error;
  const fs::path aside = fs::path(path_) / (kAsidePrefix + std::to_string(::getpid()));
  fs::create_directory(aside, error);
  if (error) return Unavailable(path_ + ": cannot be written to: " + error.message());
  aside_ = aside.string();
  return MoveEntries(path_, aside) ? Status::Ok() : Unavailable(path_ + ": the earlier results cannot be set aside");
}

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : path_(std::move(other.path_)),
      content_(other.content_),
      is_new_(other.is_new_),
      aside_(std::exchange(other.aside_, {})) {}

OutputFolder::~OutputFolder() { PutBack(); }

std::string OutputFolder::PutBack() {
  if (aside_.empty() || HoldsFiles(path_, aside_)) return aside_;
  std::error_code error;
  for (const fs::path& entry : Entries(path_)) {
    if (entry != fs::path(aside_)) fs::remove_all(entry, error);
  }
  if (!MoveEntries(aside_, path_)) return aside_;
  fs::remove(aside_, error);
  aside_.clear();
  return {};
}

void OutputFolder::Discard() {
  const std::regex own = OwnNames(content_);
  std::error_code error;
  std::vector<fs::path> written;
  fs::recursive_directory_iterator entry(path_, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (entry->path() == aside_) {
      entry.disable_recursion_pending();
    } else if (std::regex_match(entry->path().lexically_relative(path_).generic_string(), own)) {
      written.push_back(entry->path());
    }
  }
  // What lies in a folder comes after it. A folder that holds something else stays.
  for (auto path = written.rbegin(); path != written.rend(); ++path) fs::remove(*path, error);
  PutBack();
  if (is_new_) fs::remove(path_, error);
}

void OutputFolder::Commit() {
  std::error_code error;
  if (!aside_.empty()) fs::remove_all(aside_, error);
  aside_.clear();
}

Status CheckInputsOutside(const std::string& folder, const std::vector<std::string>& inputs) {
  std::error_code error;
  const auto held = std::find_if(inputs.begin(), inputs.end(), [&](const std::string& input) {
    return fs::exists(input, error) && IsIn(folder, input);
  });
  if (held == inputs.end()) return Status::Ok();
  return FailedPrecondition(folder + ": holds " + *held + ", which is read; choose another folder");
}

Status CheckOutputFile(const std::string& path, const FileContent& content, bool overwrite,
                       const std::vector<std::string>& inputs) {
  if (path.empty()) return InvalidArgument("the name of the output file is empty");
  std::error_code error;
  const fs::path folder = fs::path(path).parent_path();
  if (!folder.empty() && !fs::is_directory(folder, error)) return NotFound(path + ": its folder does not exist");
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) return Status::Ok();
  if (!fs::is_regular_file(status)) return FailedPrecondition(path + ": exists and is not a file");
  for (const std::string& input : inputs) {
    if (fs::equivalent(path, input, error)) return FailedPrecondition(path + ": is read; choose another file");
  }
  const auto around = std::find_if(inputs.begin(), inputs.end(), [&](const std::string& input) {
    return fs::is_directory(input, error) && IsIn(input, path);
  });
  if (!content.is_told_by_beginning && around != inputs.end()) {
    return FailedPrecondition(path + ": lies in " + *around + ", which is read; choose another file");
  }
  HAUSTRA_ASSIGN(const bool is_replaceable, IsReplaceable(path, content));
  if (!is_replaceable) {
    return FailedPrecondition(path + ": exists already and is not " + std::string(content.what) +
                              "; choose another file");
  }
  if (!overwrite) return FailedPrecondition(path + ": exists already; --overwrite replaces it");
  return Status::Ok();
}

Status CheckOutputsDiffer(const NamedOutput& one, const NamedOutput& other) {
  if (one.path.empty() || other.path.empty()) return Status::Ok();
  std::error_code error;
  const bool is_same = OneSpelling(one.path) == OneSpelling(other.path) || fs::equivalent(one.path, other.path, error);
  if (!is_same) return Status::Ok();
  return InvalidArgument(OptionText(one) + " and " + OptionText(other) + " name the same file");
}

Status CheckNotOfFolder(const NamedOutput& output, const std::string& folder, const FolderContent& content) {
  const std::string name = OneSpelling(output.path).lexically_relative(OneSpelling(folder)).generic_string();
  if (output.path.empty() || !std::regex_match(name, OwnNames(content))) return Status::Ok();
  return InvalidArgument(OptionText(output) + " is a file of " + std::string(content.what) + ", which " + folder +
                         " is to hold; choose another file");
}

Status WriteFile(const std::string& path, std::string_view bytes) {
  CatchStopSignals();
  return WriteWholeFile(path, bytes);
}

}  // namespace haustra
