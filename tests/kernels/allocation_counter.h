// Counts what the program takes from the heap through operator new. Link allocation_counter.cc into one test binary.
#pragma once

namespace haustra::testing {

int NumAllocations();

}  // namespace haustra::testing
