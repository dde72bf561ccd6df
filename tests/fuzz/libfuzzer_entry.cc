// One fuzzer: HAUSTRA_FUZZ is the function of fuzz_entries.h that it calls.
#include <cstddef>

#include "tests/fuzz/fuzz_entries.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  haustra::test::HAUSTRA_FUZZ({data, size});
  return 0;
}
