#include "capture/files/file_sink.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <utility>

#include "capture/files/rename.h"
#include "capture/files/wipe_file.h"
#include "hal/core/errno_text.h"

namespace haustra {
namespace {

// Names of temporary files that lie in the way: leftovers of a process with the same number.
constexpr int kMaxAttempts = 1000;

std::atomic<std::uint64_t> num_names{0};  // in this process

}  // namespace

Result<FileSink> FileSink::Create(const std::string& path) { return Create(path, FormerFile::kFreed); }

Result<FileSink> FileSink::Create(const std::string& path, FormerFile former, Outlasts outlasts) {
  // No two writers of one file meet in a temporary one, of this process or another; the last to commit wins.
  std::string temporary_path;
  int descriptor = -1;
  int error = EEXIST;
  for (int i = 0; descriptor < 0 && error == EEXIST && i < kMaxAttempts; ++i) {
    temporary_path = path + ".partial-" + std::to_string(::getpid()) + "-" + std::to_string(++num_names);
    descriptor = ::open(temporary_path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    error = errno;
  }
  if (descriptor < 0) {
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": its folder does not exist");
    return Unavailable(path + ": cannot be created: " + ErrnoText(error));
  }
  return FileSink(path, std::move(temporary_path), descriptor, former, outlasts);
}

FileSink::FileSink(std::string path, std::string temporary_path, int descriptor, FormerFile former, Outlasts outlasts)
    : path_(std::move(path)),
      temporary_path_(std::move(temporary_path)),
      descriptor_(descriptor),
      former_(former),
      outlasts_(outlasts) {}

FileSink::FileSink(FileSink&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_path_(std::move(other.temporary_path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      former_(other.former_),
      outlasts_(other.outlasts_),
      buffer_(std::move(other.buffer_)),
      status_(std::move(other.status_)) {}

FileSink::~FileSink() { Discard(); }

void FileSink::Discard() {
  if (descriptor_ < 0) return;
  ::close(std::exchange(descriptor_, -1));
  RemoveTemporary();
}

void FileSink::RemoveTemporary() {
  if (former_ == FormerFile::kFreed) {
    ::unlink(temporary_path_.c_str());
  } else {
    (void)WipeFile(temporary_path_);
  }
}

Status FileSink::FailWriting(int error) {
  status_ = Unavailable(path_ + ": cannot be written: " + ErrnoText(error));
  Discard();
  return status_;
}

Status FileSink::Write(std::string_view bytes) {
  if (!status_.ok()) return status_;
  if (descriptor_ < 0) return FailedPrecondition(path_ + ": written to after it was committed");
  const int error = buffer_.Write(descriptor_, bytes);
  return error == 0 ? Status::Ok() : FailWriting(error);
}

Status FileSink::Commit() {
  if (!status_.ok()) return status_;
  if (descriptor_ < 0) return FailedPrecondition(path_ + ": committed twice");
  const bool waits_for_disk = outlasts_ == Outlasts::kPowerCut;
  int error = buffer_.Flush(descriptor_);
  // The bytes must be on the disk before the name is, or a power cut leaves an empty file under the right name.
  if (error == 0 && waits_for_disk && ::fsync(descriptor_) != 0 && errno != EINVAL && errno != EROFS) error = errno;
  if (error != 0) return FailWriting(error);
  Former former;
  const bool is_closed = ::close(std::exchange(descriptor_, -1)) == 0;
  if (!is_closed || !PutIntoPlace(&former)) {
    status_ = Unavailable(path_ + ": cannot be put into place: " + ErrnoText(errno));
    RemoveTemporary();
    return status_;
  }
  if (waits_for_disk) status_ = SyncFolderOf(path_);
  const Status wiped = Wipe(former);
  if (status_.ok()) status_ = wiped;
  return status_;
}

Status FileSink::CommitAs(const std::string& path) {
  path_ = path;
  return Commit();
}

// What is to be wiped changes names with the new file in one step, so a crash leaves it under the temporary name or in
// place, and never under none. Where that cannot be, the new file takes its name, in one step too, and what had it is
// reached by a descriptor.
bool FileSink::PutIntoPlace(Former* former) const {
  if (former_ == FormerFile::kStays) return RenameToFreeName(temporary_path_, path_);
  if (former_ == FormerFile::kWiped) {
    if (::renameat2(AT_FDCWD, temporary_path_.c_str(), AT_FDCWD, path_.c_str(), RENAME_EXCHANGE) == 0) {
      former->has_temporary_name = true;
      return true;
    }
    if (errno != ENOENT) {
      if (!LacksRenameFlags(errno)) return false;
      former->descriptor = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
      // One that cannot be overwritten stays where it is.
      if (former->descriptor < 0 && errno != ENOENT) return false;
    }
  }
  if (std::rename(temporary_path_.c_str(), path_.c_str()) == 0) return true;
  const int error = errno;
  if (former->descriptor >= 0) ::close(former->descriptor);
  errno = error;
  return false;
}

Status FileSink::Wipe(const Former& former) const {
  if (former.has_temporary_name) return WipeFile(temporary_path_);
  return former.descriptor < 0 ? Status::Ok() : WipeUnnamedFile(former.descriptor, path_ + ": what it replaces");
}

Status WriteWholeFile(const std::string& path, std::string_view bytes, Outlasts outlasts) {
  HAUSTRA_ASSIGN(FileSink sink, FileSink::Create(path, FormerFile::kFreed, outlasts));
  HAUSTRA_TRY(sink.Write(bytes));
  return sink.Commit();
}

Status WriteWholeFile(const std::string& path, std::span<const std::uint8_t> bytes, Outlasts outlasts) {
  return WriteWholeFile(path, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()), outlasts);
}

}  // namespace haustra
