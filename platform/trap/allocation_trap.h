// Catches the use of the heap by a thread that must not use it. Linking this library replaces malloc and its family,
// which operator new calls, in the whole program; threads that are not armed pay for one test of a thread's flag. So
// only programs and tests link it, never a library that others build upon.
// Works with glibc; under a sanitizer, which owns malloc, nothing is caught (IsAvailable says so).
#pragma once

#include <cstdint>

#include "platform/session/thread_use.h"

namespace haustra {

// Arms the calling thread while it lives. Scopes may nest; the innermost counts. thread-bound(its maker).
class AllocationTrap {
 public:
  enum class Mode {
    kCount,  // counts calls
    kAbort,  // the first call writes its name and a backtrace to standard error and aborts the process
  };

  static bool IsAvailable();

  explicit AllocationTrap(Mode mode);
  ~AllocationTrap();
  AllocationTrap(const AllocationTrap&) = delete;
  AllocationTrap& operator=(const AllocationTrap&) = delete;

  // malloc, calloc, realloc, free of something, and the aligned ones, since the trap was set.
  std::uint32_t count() const;

 private:
  int former_mode_;
  std::uint32_t former_count_;
};

// For a session (SessionObserver::thread_watch): each call to Engine::Track in a trap of its own.
const ThreadWatch& CountingHeapWatch();
const ThreadWatch& AbortingHeapWatch();

}  // namespace haustra
