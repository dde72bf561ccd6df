// The heap of the C library (glibc) as a session wants it whose memory must not grow: mapping's solvers may use it,
// inside a bound that is there from the start. Left alone, each thread has a heap of its own that keeps its own peak,
// and large blocks come and go with page faults. (mallopt(3), malloc_trim(3), mallinfo2(3).)
// All of it is the process's: for one session at a time, from one thread, never the tracking thread. Sizes in bytes.
#pragma once

#include <cstddef>

namespace haustra {

// At the start of the process, before there are threads: one heap for all of them. Blocks of kLargeBlockBytes and more
// are mapped by themselves and leave when they are freed, in the last procedure as in the first (glibc raises that
// limit to the size of what is freed).
inline constexpr int kLargeBlockBytes = 1 << 20;
void UseOneHeap();

// For a session, when its large blocks have been taken: the heap gets so many free bytes in one piece, touched, and
// from now on has room for blocks of any size and keeps all pages. False: there is no such memory, and nothing was
// changed.
bool HoldHeap(std::size_t num_free_bytes);
// As before; free pages go back to the system.
void ReleaseHeap();

// Between two sessions of one process, so that they can be compared: unmaps the stacks of threads that have ended,
// which are kept for new ones, and gives free pages back.
void ReturnFreeMemory();

// Of the heap, in use or free. Grows when what is free does not suffice.
std::size_t HeapBytes();

}  // namespace haustra
