#include "platform/publish/shared_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

namespace haustra {
namespace {

std::string ErrorText(int error) { return std::generic_category().message(error); }

struct OwnedDescriptor {
  int value = -1;
  ~OwnedDescriptor() {
    if (value >= 0) ::close(value);
  }
};

// Null when it cannot be mapped.
void* MapShared(int descriptor, std::size_t num_bytes) {
  void* memory = ::mmap(nullptr, num_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, descriptor, 0);
  return memory == MAP_FAILED ? nullptr : memory;
}

}  // namespace

Result<SharedFile> CreateSharedFile(const std::string& path, mode_t mode, gid_t group, std::size_t num_bytes,
                                    const std::function<void(void* memory)>& prepare) {
  const std::string temporary_path = path + ".new";
  ::unlink(temporary_path.c_str());
  OwnedDescriptor file{::open(temporary_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600)};
  if (file.value < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": its folder does not exist");
    return Unavailable(path + ": cannot be created: " + ErrorText(error));
  }
  const auto fail = [&](int error) {
    ::unlink(temporary_path.c_str());
    return Unavailable(path + ": cannot be created: " + ErrorText(error));
  };
  // Not ftruncate: memory that is not there would be missed at the first frame, with SIGBUS.
  const auto size = static_cast<off_t>(num_bytes);
  if (const int error = ::posix_fallocate(file.value, 0, size); error != 0) return fail(error);
  if (group != static_cast<gid_t>(-1) && ::fchown(file.value, static_cast<uid_t>(-1), group) != 0) return fail(errno);
  if (::fchmod(file.value, mode) != 0) return fail(errno);
  void* memory = MapShared(file.value, num_bytes);
  if (memory == nullptr) return fail(errno);
  prepare(memory);
  if (std::rename(temporary_path.c_str(), path.c_str()) != 0) {
    const int error = errno;
    ::munmap(memory, num_bytes);
    return fail(error);
  }
  return SharedFile{std::exchange(file.value, -1), memory};
}

Result<void*> AttachSharedFile(int descriptor, std::size_t num_bytes, const std::string& what) {
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode) || info.st_size != static_cast<off_t>(num_bytes)) {
    return DataLoss(what + " has another size");
  }
  void* memory = MapShared(descriptor, num_bytes);
  if (memory == nullptr) return Unavailable(what + " cannot be mapped: " + ErrorText(errno));
  return memory;
}

void ChangeFormerFile(const std::string& path, std::size_t num_bytes, const std::function<void(void* memory)>& change) {
  const OwnedDescriptor file{::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW)};
  if (file.value < 0) return;
  const Result<void*> memory = AttachSharedFile(file.value, num_bytes, path);
  if (!memory.ok()) return;
  change(*memory);
  ::munmap(*memory, num_bytes);
}

}  // namespace haustra
