// Files that are to leave nothing behind. Messages name the file. thread-safe for different files; waits for the disk.
#pragma once

#include <string>

#include "hal/core/status.h"

namespace haustra {

// Overwrites the bytes once, waits for the disk, and removes the name. On flash memory, and on file systems that copy
// on write, the old bytes may outlast this. kUnavailable; when the bytes could not be overwritten the name stays, for
// another try.
Status WipeFile(const std::string& path);

// The same of a file that has lost its name, but is open for writing: the descriptor is closed. `path`: for the
// message.
Status WipeUnnamedFile(int descriptor, const std::string& path);

// A new name, or one that has gone, is an entry of the folder, which is written back on its own. kUnavailable: the
// entry may not outlast a power cut. A folder that may not be read, or a file system without such a call, leaves it to
// the system: Ok.
Status SyncFolderOf(const std::string& path);

}  // namespace haustra
