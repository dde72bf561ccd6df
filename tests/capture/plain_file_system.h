// A file system that has only rename, as FAT, NFS and some of FUSE.
#pragma once

namespace haustra {

// While one lives, renameat2 with any flags fails with EINVAL in the whole program, which links plain_file_system.cc:
// its renameat2 stands in the place of the C library's.
class PlainFileSystem {
 public:
  PlainFileSystem();
  ~PlainFileSystem();
  PlainFileSystem(const PlainFileSystem&) = delete;
  PlainFileSystem& operator=(const PlainFileSystem&) = delete;
};

}  // namespace haustra
