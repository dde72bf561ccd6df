// Any bytes as an atlas file: read, loaded into an atlas, saved, loaded again. What must never happen stops the
// process.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace haustra::test {

// Whether the file was taken.
bool TryAtlasFile(std::span<const std::uint8_t> file);

}  // namespace haustra::test

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
