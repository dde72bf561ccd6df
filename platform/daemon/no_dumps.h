// So that no picture of a patient leaves the process in a core dump. A limit of zero on their size (the unit's
// LimitCORE) does not stop a handler that the kernel pipes them to; this does. thread-safe.
#pragma once

namespace haustra {

// At the start of the process, before it knows anything: the kernel makes no dump of it, to a file or to a handler, and
// no process of the same user may trace it or read its memory (PR_SET_DUMPABLE). The superuser may. False: refused.
[[nodiscard]] bool ForbidDumps();

// When memory has been taken: what the process may write now is left out of dumps that are made all the same, by a
// superuser who has a debugger's means (MADV_DONTDUMP). Mappings that are made later are not marked.
void LeaveMemoryOutOfDumps();

}  // namespace haustra
