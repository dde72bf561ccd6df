// What the supervisor does without, for good, and its later threads and children with it: the worker has the camera and
// the GPU, so that a client who finds a hole in the service's sockets finds neither behind it.
//
// Two means, each of which may be missing in a kernel:
//   system calls (seccomp)  no control of devices (ioctl, without which neither camera nor GPU can be used), no new
//                           program, no sockets but Unix domain ones, nothing that goes around a filter or into the
//                           kernel (io_uring, bpf, modules, ...)
//   files (Landlock)        /dev is closed, and only the service's folders are written to
// What is open already stays open.
#pragma once

#include <string>
#include <vector>

namespace haustra {

struct RightsTaken {
  std::string system_calls;  // "taken", or why not
  std::string files;
};

// By the only thread of the process, before it has others. `writable`: folders; those that are not there are left out.
RightsTaken TakeRightsAway(const std::vector<std::string>& writable);

}  // namespace haustra
