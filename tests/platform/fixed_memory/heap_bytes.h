// Counts the bytes that the program takes through operator new. Link heap_bytes.cc into one test binary.
#pragma once

#include <cstddef>

namespace haustra::test {

// Since the start of the program; what was given back is not taken off.
std::size_t BytesTaken();

}  // namespace haustra::test
