#include "hal/core/check.h"

#include <atomic>
#include <cstdio>
#include <cstdlib>

namespace haustra {
namespace {

void PrintAndAbort(const char* condition, const char* file, int line) {
  std::fprintf(stderr, "haustra: check failed: %s (%s:%d)\n", condition, file, line);
  std::abort();
}

std::atomic<FatalHook> fatal_hook{&PrintAndAbort};

}  // namespace

FatalHook SetFatalHook(FatalHook hook) { return fatal_hook.exchange(hook); }

void FailCheck(const char* condition, const char* file, int line) { fatal_hook.load()(condition, file, line); }

}  // namespace haustra
