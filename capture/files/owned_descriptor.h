// An open file that is closed with its scope.
#pragma once

#include <unistd.h>

namespace haustra {

struct OwnedDescriptor {
  explicit OwnedDescriptor(int descriptor) : value(descriptor) {}
  ~OwnedDescriptor() {
    if (value >= 0) ::close(value);
  }
  OwnedDescriptor(const OwnedDescriptor&) = delete;
  OwnedDescriptor& operator=(const OwnedDescriptor&) = delete;

  int value;  // below 0: none
};

}  // namespace haustra
