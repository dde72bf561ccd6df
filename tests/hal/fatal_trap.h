// Turns a failed check into an exception while it lives, so that a test can look at it.
#pragma once

#include <stdexcept>
#include <string>

#include "hal/core/check.h"

namespace haustra {

struct CheckFailure : std::runtime_error {
  CheckFailure(const char* condition, const char* file, int line_number)
      : std::runtime_error(condition), file_name(file), line(line_number) {}
  std::string file_name;
  int line;
};

class FatalTrap {
 public:
  FatalTrap() : former_(SetFatalHook(&Throw)) {}
  ~FatalTrap() { SetFatalHook(former_); }
  FatalTrap(const FatalTrap&) = delete;
  FatalTrap& operator=(const FatalTrap&) = delete;

 private:
  [[noreturn]] static void Throw(const char* condition, const char* file, int line) {
    throw CheckFailure(condition, file, line);
  }
  FatalHook former_;
};

}  // namespace haustra
