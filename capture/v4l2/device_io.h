// The system calls that a V4L2 device is driven with, and nothing else: tests put a device there that follows a script.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/core/time.h"

namespace haustra {

// Errors are negative errno values. thread-bound(the owner of the descriptor).
class DeviceIo {
 public:
  virtual ~DeviceIo() = default;

  // The nodes of video devices, /dev/videoN, by number.
  virtual std::vector<std::string> DevicePaths() = 0;
  // A descriptor that does not block.
  virtual int Open(const std::string& path) = 0;
  virtual void Close(int fd) = 0;
  // 0 or more on success; begun again when a signal interrupts it.
  virtual int Ioctl(int fd, unsigned long request, void* argument) = 0;  // NOLINT(google-runtime-int): ioctl's type
  // Waits for `events` (poll's) for at most `timeout`: their number, 0 when it has passed.
  virtual int Poll(int fd, short events, Duration timeout, short* found) = 0;  // NOLINT(google-runtime-int)
  // Shared memory of a buffer; null on error.
  virtual void* Map(int fd, std::size_t length, std::int64_t offset) = 0;
  virtual void Unmap(void* address, std::size_t length) = 0;
  // CLOCK_MONOTONIC, which the kernel's time stamps count in.
  virtual TimePoint Now() = 0;
  virtual void Sleep(Duration duration) = 0;
};

// Those of this machine. thread-safe: it has no state.
DeviceIo& SystemDeviceIo();

}  // namespace haustra
