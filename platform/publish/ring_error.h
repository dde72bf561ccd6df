// Why the ring of the poses could not be opened, as people read it. thread-safe.
#pragma once

#include <cerrno>
#include <string>

#include "hal/core/errno_text.h"
#include "platform/publish/haustra_pose_ring.h"

namespace haustra {

// Of what haustra_ring_open has just answered of `path`; errno is still its. Empty: it is open, or there is no such
// file, so no daemon.
inline std::string RingOpenError(const std::string& path, int result) {
  switch (result) {
    case HAUSTRA_NO_FILE: return errno == ENOENT ? "" : path + ": " + ErrnoText(errno);
    case HAUSTRA_NOT_A_RING: return path + " is not what haustrad writes.";
    case HAUSTRA_OTHER_VERSION: return path + " was written by another version of haustrad than this program knows.";
    default: return "";
  }
}

}  // namespace haustra
