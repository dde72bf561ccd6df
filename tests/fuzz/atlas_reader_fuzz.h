// Any bytes as an atlas file: read, loaded into an atlas, saved, loaded again. What must never happen stops the
// process.
#pragma once

#include <cstdint>
#include <span>

namespace haustra::test {

// Whether the file was taken.
bool TryAtlasFile(std::span<const std::uint8_t> file);

}  // namespace haustra::test
