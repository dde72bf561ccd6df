// What top, gdb and /proc call a thread.
#pragma once

#include <pthread.h>

namespace haustra {

// At most 15 letters. Once, at the start of the thread.
inline void NameThisThread(const char* name) { ::pthread_setname_np(::pthread_self(), name); }

}  // namespace haustra
