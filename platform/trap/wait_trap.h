// Catches what may make a thread wait that must not: locks and system calls. For tests only:
// linking this replaces pthread_mutex_lock and its like in the whole program.
//
// A lock (mutex or read-write lock of POSIX threads, which those of the standard library are) is caught before it is
// taken, also when nobody holds it. To try a lock is no wait. A system call is told by the kernel (seccomp(2), user
// notification, Linux 5.5); waking another thread and reading the clock are none here.
#pragma once

#include <cstdint>

#include "platform/session/thread_use.h"

namespace haustra {

// Arms the calling thread while it lives. thread-bound(its maker).
class WaitTrap {
 public:
  enum class Mode {
    kOff,    // nothing is caught: around what may wait inside of an armed scope
    kCount,  // counts
    kAbort,  // the first one is named on standard error, a lock with a backtrace, and the process aborts
  };

  // Locks are caught: not under a sanitizer, which has locks of its own.
  static bool CatchesLocks();
  // From now on to the end of the calling thread, and of threads and processes that it starts, system calls go by way
  // of a thread that counts those of the calling one. For one that need not be quick. False: the kernel does not allow
  // it.
  static bool CatchSystemCalls();

  explicit WaitTrap(Mode mode);
  ~WaitTrap();
  WaitTrap(const WaitTrap&) = delete;
  WaitTrap& operator=(const WaitTrap&) = delete;

  // Of this thread, since it was first armed.
  static std::uint32_t num_locks();
  static std::uint32_t num_system_calls();
  // Its number (syscall(2)); -1: there was none.
  static int last_system_call();

 private:
  Mode former_;
};

// For a session (SessionObserver::thread_watch): each call to Engine::Track in a trap of its own. What comes out is the
// number of locks and system calls.
const ThreadWatch& CountingWaitWatch();
const ThreadWatch& AbortingWaitWatch();

}  // namespace haustra
