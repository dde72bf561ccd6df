// Whether this build has a sanitizer in it: a tenth of the speed, and an allocator of its own.
#pragma once

namespace haustra::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif

}  // namespace haustra::test
