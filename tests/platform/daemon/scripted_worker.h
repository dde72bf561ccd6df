// What a test and the scripted worker that it starts (scripted_worker.cc) tell each other: a file that both have
// mapped.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

namespace haustra::test {

struct WorkerScript {
  // Of the vision device.
  std::atomic<bool> is_lost{false};    // each call is answered so; a new device works
  std::atomic<bool> is_silent{false};  // a wait is never over
  std::atomic<bool> is_stuck{false};   // a call does not return
  // Of the rest.
  std::atomic<bool> is_live{false};         // a camera, not a recording
  std::atomic<bool> is_dark{false};         // its frames show nothing
  std::atomic<int> num_waits{0};            // that often there is no camera
  std::atomic<int> open_error{0};           // the StatusCode that opening the camera gives
  std::atomic<bool> is_unplugged{false};    // the camera, while it runs
  std::atomic<bool> do_stamps_jump{false};  // they lie an hour ahead
  std::atomic<bool> are_all_torn{false};    // pictures that cannot be read
  std::atomic<int> first_frame_ms{0};       // that it takes, as where the session first locks much memory
  std::atomic<int> num_slow_calls{0};       // of the camera's driver, a second each, to bring it back
  std::atomic<bool> has_stuck_call{false};  // likewise, and it does not return
  std::atomic<bool> is_making_held{false};  // the device is not made
  std::atomic<bool> talks_nonsense{false};  // instead of doing anything
  std::atomic<bool> cannot_start{false};    // dies while it makes itself ready
  // What it did.
  std::atomic<int> num_opens{0};
  std::atomic<int> num_stuck{0};
  std::atomic<int> num_extractions{0};
  std::atomic<int> num_devices{0};
  std::atomic<int> pid{0};                                  // of the worker that made the last one
  std::atomic<int> num_races{0};                            // that the thread sanitizer has reported
  std::array<std::atomic<std::int64_t>, 4096> stamps_ns{};  // of a live camera, by frame
};

// The file is made when it is not there.
inline WorkerScript* MapScript(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (file < 0 || ftruncate(file, sizeof(WorkerScript)) != 0) return nullptr;
  void* memory = mmap(nullptr, sizeof(WorkerScript), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  return memory == MAP_FAILED ? nullptr : static_cast<WorkerScript*>(memory);
}

}  // namespace haustra::test
