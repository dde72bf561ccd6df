// What renameat2 does in one step, on file systems too that have only rename (FAT, NFS, some of FUSE). reentrant.
#pragma once

#include <string>

namespace haustra {

// The last call of renameat2 failed as this kernel or this file system does not know its flags.
bool LacksRenameFlags(int error);

// False, with the reason in errno (EEXIST: `to` is taken, by whatever). Where the file system cannot refuse a name
// itself, an empty file holds it meanwhile, which a crash may leave.
bool RenameToFreeName(const std::string& from, const std::string& to);

}  // namespace haustra
