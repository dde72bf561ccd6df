// A file system that has only rename, as NFS, old FAT and some of FUSE, and a crash between any two of its steps.
#pragma once

#include <functional>

namespace haustra {

// While one lives, renameat2 with any flags fails with EINVAL in the whole program, which links plain_file_system.cc:
// its renameat2, rename, link and unlink stand in the place of the C library's.
class PlainFileSystem {
 public:
  PlainFileSystem();
  ~PlainFileSystem();
  PlainFileSystem(const PlainFileSystem&) = delete;
  PlainFileSystem& operator=(const PlainFileSystem&) = delete;

  // Works on such a file system in a process of its own, which ends, as by a kill, before the step of that number, from
  // 1. Each call that gives or takes a name is a step. False: there are not so many, and the work was done.
  static bool EndsBeforeStep(int step, const std::function<void()>& work);
};

}  // namespace haustra
