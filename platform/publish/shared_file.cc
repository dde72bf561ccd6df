#include "platform/publish/shared_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <utility>

#include "capture/files/owned_descriptor.h"
#include "hal/core/errno_text.h"
#include "platform/publish/slot_writer.h"

namespace haustra {
namespace {

// Null when it cannot be mapped.
void* MapShared(int descriptor, std::size_t num_bytes) {
  void* memory = ::mmap(nullptr, num_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, descriptor, 0);
  return memory == MAP_FAILED ? nullptr : memory;
}

}  // namespace

Result<SharedFile> CreateSharedFile(const std::string& path, mode_t mode, gid_t group, std::size_t num_bytes,
                                    const std::function<void(void* memory)>& prepare,
                                    const std::function<void(void* memory)>& close_former) {
  const std::string temporary_path = path + ".new";
  ::unlink(temporary_path.c_str());
  OwnedDescriptor file{::open(temporary_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600)};
  if (file.value < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": its folder does not exist");
    return Unavailable(path + ": cannot be created: " + ErrnoText(error));
  }
  const auto fail = [&](int error) {
    ::unlink(temporary_path.c_str());
    return Unavailable(path + ": cannot be created: " + ErrnoText(error));
  };
  // Not ftruncate: memory that is not there would be missed at the first frame, with SIGBUS.
  const auto size = static_cast<off_t>(num_bytes);
  if (const int error = ::posix_fallocate(file.value, 0, size); error != 0) return fail(error);
  if (group != static_cast<gid_t>(-1) && ::fchown(file.value, static_cast<uid_t>(-1), group) != 0) return fail(errno);
  if (::fchmod(file.value, mode) != 0) return fail(errno);
  void* memory = MapShared(file.value, num_bytes);
  if (memory == nullptr) return fail(errno);
  prepare(memory);
  Status status = WipeFormerFile(path, close_former);
  if (status.ok() && std::rename(temporary_path.c_str(), path.c_str()) != 0) status = fail(errno);
  if (!status.ok()) {
    ::munmap(memory, num_bytes);
    ::unlink(temporary_path.c_str());
    return status;
  }
  return SharedFile{std::exchange(file.value, -1), memory};
}

Result<void*> AttachSharedFile(int descriptor, std::size_t num_bytes, const std::string& what) {
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode) || info.st_size != static_cast<off_t>(num_bytes)) {
    return DataLoss(what + " has another size");
  }
  void* memory = MapShared(descriptor, num_bytes);
  if (memory == nullptr) return Unavailable(what + " cannot be mapped: " + ErrnoText(errno));
  return memory;
}

Status WipeFormerFile(const std::string& path, const std::function<void(void* memory)>& close_former) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode) || info.st_size == 0) return Status::Ok();
  const auto num_bytes = static_cast<std::size_t>(info.st_size);
  const auto fail = [&](const std::string& why) {
    return Unavailable(path + ": what a former run left cannot be overwritten: " + why);
  };
  const OwnedDescriptor file{::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW)};
  if (file.value < 0) return fail(ErrnoText(errno));
  const Result<void*> memory = AttachSharedFile(file.value, num_bytes, path);
  if (!memory.ok()) return fail(memory.status().message());
  // Word by word, as its records were written: a reader in the middle of one finds that it is gone.
  auto* words = static_cast<std::uint64_t*>(*memory);
  for (std::size_t i = 0; i < num_bytes / 8; ++i) StoreWord(words + i, 0);
  std::memset(words + num_bytes / 8, 0, num_bytes % 8);
  if (close_former) close_former(*memory);
  ::munmap(*memory, num_bytes);
  return Status::Ok();
}

Status RemoveFormerFile(const std::string& path) {
  HAUSTRA_TRY(WipeFormerFile(path));
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) {
    return Unavailable(path + ": what a former run left cannot be removed: " + ErrnoText(errno));
  }
  return Status::Ok();
}

}  // namespace haustra
