// Counts heap allocations of the calling thread while a scope is alive, including those that Eigen makes through malloc
// rather than operator new. Works with glibc; under a sanitizer, which owns malloc, nothing is counted.
#pragma once

#include <cstddef>

namespace haustra::test {

class AllocationCounter {
 public:
  static bool IsAvailable();

  AllocationCounter();
  ~AllocationCounter();
  std::size_t count() const;
};

}  // namespace haustra::test
