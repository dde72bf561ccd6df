// Base64 (RFC 4648, with padding), for pictures inside a page. reentrant.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace haustra::report {

std::string ToBase64(std::span<const std::uint8_t> bytes);

}  // namespace haustra::report
