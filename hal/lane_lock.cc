#include "hal/lane_lock.h"

#include <mutex>

#include "hal/core/check.h"

namespace haustra {

// A mutex of the standard library inherits no priority, so it is one of POSIX threads, which come with <mutex>.
struct LaneLock::Native {
  pthread_mutex_t mutex;
};

LaneLock::LaneLock() : native_(std::make_unique<Native>()) {
  pthread_mutexattr_t attributes;
  HAUSTRA_CHECK(pthread_mutexattr_init(&attributes) == 0);
  HAUSTRA_CHECK(pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_RECURSIVE) == 0);
  HAUSTRA_CHECK(pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT) == 0);
  HAUSTRA_CHECK(pthread_mutex_init(&native_->mutex, &attributes) == 0);
  pthread_mutexattr_destroy(&attributes);
}

LaneLock::~LaneLock() { pthread_mutex_destroy(&native_->mutex); }

void LaneLock::Lock() { HAUSTRA_CHECK(pthread_mutex_lock(&native_->mutex) == 0); }
void LaneLock::Unlock() { HAUSTRA_CHECK(pthread_mutex_unlock(&native_->mutex) == 0); }

}  // namespace haustra
