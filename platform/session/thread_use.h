// What the kernel did to a thread while it worked on one frame, from the kernel's own counters (getrusage(2),
// RUSAGE_THREAD), and what the thread did that it must not. Two system calls a frame, about a microsecond.
// thread-bound(the thread measured).
#pragma once

#include <sys/resource.h>

#include <cstdint>

namespace haustra {

struct ThreadUse {
  std::uint32_t minor_faults = 0;          // pages that had to be mapped
  std::uint32_t major_faults = 0;          // pages that had to be read from a disk
  std::uint32_t voluntary_switches = 0;    // the thread waited: for the vision device's helpers, for a lock, for I/O
  std::uint32_t involuntary_switches = 0;  // the processor was taken from it
  std::uint32_t trapped_calls = 0;         // what a ThreadWatch counts; 0 without one

  ThreadUse& operator+=(const ThreadUse& other) {
    minor_faults += other.minor_faults;
    major_faults += other.major_faults;
    voluntary_switches += other.voluntary_switches;
    involuntary_switches += other.involuntary_switches;
    trapped_calls += other.trapped_calls;
    return *this;
  }
};

// Who counts calls that the calling thread must not make, or stops the process at the first: of the heap
// (platform/trap/allocation_trap.h), or such as may wait (platform/trap/wait_trap.h). Made by the program that wants
// it.
struct ThreadWatch {
  void (*begin)() = nullptr;
  std::uint32_t (*end)() = nullptr;  // calls since begin
};

class ThreadUseMeter {
 public:
  // `watch` may be null.
  explicit ThreadUseMeter(const ThreadWatch* watch) : watch_(watch) {
    getrusage(RUSAGE_THREAD, &before_);
    if (watch_ != nullptr) watch_->begin();
  }
  ThreadUse Read() const {
    ThreadUse use;
    if (watch_ != nullptr) use.trapped_calls = watch_->end();
    rusage now{};
    getrusage(RUSAGE_THREAD, &now);
    use.minor_faults = static_cast<std::uint32_t>(now.ru_minflt - before_.ru_minflt);
    use.major_faults = static_cast<std::uint32_t>(now.ru_majflt - before_.ru_majflt);
    use.voluntary_switches = static_cast<std::uint32_t>(now.ru_nvcsw - before_.ru_nvcsw);
    use.involuntary_switches = static_cast<std::uint32_t>(now.ru_nivcsw - before_.ru_nivcsw);
    return use;
  }

 private:
  const ThreadWatch* watch_;
  rusage before_{};
};

}  // namespace haustra
