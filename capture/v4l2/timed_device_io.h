// Hands system calls on, and says when the newest one began. thread-bound(the owner of the descriptors), but for what
// is marked.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "capture/v4l2/device_io.h"

namespace haustra::capture::internal {

class TimedDeviceIo final : public DeviceIo {
 public:
  // `io` outlives it.
  explicit TimedDeviceIo(DeviceIo& io) : io_(io) { Begin(); }

  // As if a call began now.
  void Begin() { newest_ns_.store(io_.Now().time_since_epoch().count(), std::memory_order_relaxed); }
  // thread-safe.
  TimePoint newest() const { return TimePoint(Duration(newest_ns_.load(std::memory_order_relaxed))); }

  std::vector<std::string> DevicePaths() override {
    Begin();
    return io_.DevicePaths();
  }
  int Open(const std::string& path) override {
    Begin();
    return io_.Open(path);
  }
  void Close(int fd) override {
    Begin();
    io_.Close(fd);
  }
  int Ioctl(int fd, unsigned long request, void* argument) override {  // NOLINT(google-runtime-int): ioctl's type
    Begin();
    return io_.Ioctl(fd, request, argument);
  }
  int Poll(int fd, short events, Duration timeout, short* found) override {  // NOLINT(google-runtime-int): poll's type
    Begin();
    return io_.Poll(fd, events, timeout, found);
  }
  void* Map(int fd, std::size_t length, std::int64_t offset) override {
    Begin();
    return io_.Map(fd, length, offset);
  }
  void Unmap(void* address, std::size_t length) override {
    Begin();
    io_.Unmap(address, length);
  }
  TimePoint Now() override { return io_.Now(); }
  void Sleep(Duration duration) override {
    Begin();
    io_.Sleep(duration);
  }

 private:
  DeviceIo& io_;
  std::atomic<std::int64_t> newest_ns_{0};
};

}  // namespace haustra::capture::internal
