// An error of the system as people read it in messages. thread-safe.
#pragma once

#include <string>
#include <system_error>

namespace haustra {

// "No such file or directory", of ENOENT.
inline std::string ErrnoText(int error) { return std::generic_category().message(error); }

}  // namespace haustra
