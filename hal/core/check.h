// Programmer errors stop the process; the supervisor restarts it. Never use these on input data, devices, files or
// capacity: those are Status (hal/core/status.h).
#pragma once

namespace haustra {

using FatalHook = void (*)(const char* condition, const char* file, int line);

// Replaces what happens on a failed check (tests); returns the former hook. The default prints and aborts.
FatalHook SetFatalHook(FatalHook hook);

void FailCheck(const char* condition, const char* file, int line);

}  // namespace haustra

#define HAUSTRA_CHECK(condition)                            \
  do {                                                      \
    if (!(condition)) [[unlikely]] {                        \
      ::haustra::FailCheck(#condition, __FILE__, __LINE__); \
    }                                                       \
  } while (false)

#ifdef NDEBUG
#define HAUSTRA_DCHECK(condition) \
  do {                            \
  } while (false && (condition))
#else
#define HAUSTRA_DCHECK(condition) HAUSTRA_CHECK(condition)
#endif
