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

// Zeros, all of whose pages are there, so that none is missed at the first frame. `prepare` fills them. What a dead
// writer left under the name is wiped when nothing but the name is left to be done. `group`: -1 leaves the caller's.
// `close_former`: see WipeFormerFile. kNotFound: no such folder; kUnavailable: cannot be made, or what is there cannot
// be wiped. Nothing stays of a file that could not.
Result<SharedFile> CreateSharedFile(const std::string& path, mode_t mode, gid_t group, std::size_t num_bytes,
                                    const std::function<void(void* memory)>& prepare,
                                    const std::function<void(void* memory)>& close_former = nullptr);
// The memory of such a file; `descriptor` stays the caller's, `what` it is stands in the messages. kDataLoss: it has
// another size; kUnavailable: it cannot be mapped.
Result<void*> AttachSharedFile(int descriptor, std::size_t num_bytes, const std::string& what);
// Overwrites all of a file with zeros that a dead writer left, of whatever layout: what it holds is a patient's. Its
// readers find no record any more. `close_former` is then called with its memory, where it may say so to them. Ok, too,
// when there is none, or something that is no file. kUnavailable: it cannot be overwritten.
Status WipeFormerFile(const std::string& path, const std::function<void(void* memory)>& close_former = nullptr);
// The same where no file is to be: the name goes, too.
Status RemoveFormerFile(const std::string& path);

}  // namespace haustra
