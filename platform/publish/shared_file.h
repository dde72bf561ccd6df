// A file of a fixed size that a writer maps, and readers after it. It is made whole before it takes its name.
#pragma once

#include <sys/types.h>
#include <unistd.h>

#include <cstddef>
#include <functional>
#include <string>

#include "hal/core/status.h"

namespace haustra {

// Both are the caller's, to be closed and unmapped.
struct SharedFile {
  int descriptor = -1;
  void* memory = nullptr;
};

// Zeros, all of whose pages are there, so that none is missed at the first frame. `prepare` fills them; it is called
// when nothing but the name is left to be done. `group`: -1 leaves the caller's. kNotFound: no such folder;
// kUnavailable: cannot be made. Nothing stays of a file that could not.
Result<SharedFile> CreateSharedFile(const std::string& path, mode_t mode, gid_t group, std::size_t num_bytes,
                                    const std::function<void(void* memory)>& prepare);
// The memory of such a file; `descriptor` stays the caller's, `what` it is stands in the messages. kDataLoss: it has
// another size; kUnavailable: it cannot be mapped.
Result<void*> AttachSharedFile(int descriptor, std::size_t num_bytes, const std::string& what);
// Calls `change` with the memory of a file of this size that is there, for what a dead writer has left in it.
void ChangeFormerFile(const std::string& path, std::size_t num_bytes, const std::function<void(void* memory)>& change);

}  // namespace haustra
