#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <ctime>
#include <string_view>

#include "capture/v4l2/device_io.h"

namespace haustra {
namespace {

timespec ToTimespec(Duration duration) {
  const std::int64_t ns = std::max<std::int64_t>(0, duration.count());
  return {static_cast<std::time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};  // NOLINT: its type
}

class SystemIo final : public DeviceIo {
 public:
  std::vector<std::string> DevicePaths() override {
    constexpr std::string_view kPrefix = "video";
    std::vector<int> numbers;
    DIR* folder = opendir("/dev");
    if (folder == nullptr) return {};
    while (const dirent* entry = readdir(folder)) {
      const std::string_view name(entry->d_name);
      if (name.substr(0, kPrefix.size()) != kPrefix) continue;
      const std::string_view digits = name.substr(kPrefix.size());
      int number = 0;
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
      if (error == std::errc() && end == digits.data() + digits.size()) numbers.push_back(number);
    }
    closedir(folder);
    std::sort(numbers.begin(), numbers.end());
    std::vector<std::string> paths;
    for (const int number : numbers) paths.push_back("/dev/video" + std::to_string(number));
    return paths;
  }

  int Open(const std::string& path) override {
    const int fd = open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return fd >= 0 ? fd : -errno;
  }

  void Close(int fd) override { close(fd); }

  int Ioctl(int fd, unsigned long request, void* argument) override {  // NOLINT(google-runtime-int)
    int result = 0;
    do {
      result = ioctl(fd, request, argument);
    } while (result < 0 && errno == EINTR);
    return result >= 0 ? result : -errno;
  }

  int Poll(int fd, short events, Duration timeout, short* found) override {  // NOLINT(google-runtime-int)
    pollfd descriptor{fd, events, 0};
    const timespec limit = ToTimespec(timeout);
    const int result = ppoll(&descriptor, 1, &limit, nullptr);
    *found = descriptor.revents;
    // Interrupted by a signal: the caller looks at the clock, and at what the handler has changed.
    if (result < 0 && errno == EINTR) return 0;
    return result >= 0 ? result : -errno;
  }

  void* Map(int fd, std::size_t length, std::int64_t offset) override {
    void* address = mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<off_t>(offset));
    return address != MAP_FAILED ? address : nullptr;
  }

  void Unmap(void* address, std::size_t length) override { munmap(address, length); }

  TimePoint Now() override {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return TimePoint(std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec));
  }

  void Sleep(Duration duration) override {
    const timespec time = ToTimespec(duration);
    nanosleep(&time, nullptr);
  }
};

}  // namespace

DeviceIo& SystemDeviceIo() {
  static SystemIo io;
  return io;
}

}  // namespace haustra
