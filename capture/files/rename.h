// What renameat2 does in one step, on file systems too that have only rename (FAT, NFS, some of FUSE). reentrant.
#pragma once

#include <string>

namespace haustra {

// The last call of renameat2 failed as this kernel or this file system does not know its flags.
bool LacksRenameFlags(int error);

// False, with the reason in errno (EEXIST: `to` is taken, by whatever). A crash leaves the one name or the other. Where
// the file system cannot refuse a name itself, two threads do not meet, but a name that another process takes in the
// same moment is replaced: the folder must be this process's.
bool RenameToFreeName(const std::string& from, const std::string& to);

}  // namespace haustra
