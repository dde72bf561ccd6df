// A reference to a slot of a pool: 32-bit index and 32-bit generation. Never a pointer that outlives a call. A handle
// whose slot was released and used again is stale, and the pool says so instead of handing out somebody else's data.
#pragma once

#include <compare>
#include <cstdint>

namespace haustra {

template <typename Tag>
struct Handle {
  static constexpr std::uint32_t kInvalidIndex = 0xffffffffu;

  std::uint32_t index = kInvalidIndex;
  std::uint32_t generation = 0;

  bool is_valid() const { return index != kInvalidIndex; }
  explicit operator bool() const { return is_valid(); }

  friend constexpr auto operator<=>(const Handle&, const Handle&) = default;
};

}  // namespace haustra
