#include "tests/kernels/lock_counter.h"

#include <dlfcn.h>
#include <pthread.h>

#include "tests/sanitized.h"

namespace {

thread_local std::uint64_t num_locks = 0;

}  // namespace

namespace haustra::testing {

std::uint64_t NumLocksOfThisThread() { return num_locks; }

}  // namespace haustra::testing

// A sanitizer has a pthread_mutex_lock of its own here.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) {
  using Lock = int (*)(pthread_mutex_t*);
  static const Lock next = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  ++num_locks;
  return next(mutex);
}
#endif
