// So that nothing of a patient stays in the process when the procedure has ended: memory is overwritten when it is
// freed, and what is free goes back to the system, which clears it before anybody gets it again. This is of glibc,
// which keeps some of it otherwise; a search of the memory tests it (tests/end_to_end/daemon_test.cc).
#pragma once

namespace haustra {

// At the start of the process: from now on every block that is freed is overwritten at once (M_PERTURB), but for the
// few small ones that each thread keeps for itself.
void OverwriteFreedMemory();

// When the threads of a procedure have ended and its memory is freed, on each thread that goes on: overwrites the freed
// blocks that the thread keeps, and the part of its stack that earlier calls used.
void WipeThisThread();

// After that, once: unmaps the stacks of threads that have ended, which are kept for new ones, and gives free pages
// back.
void ReturnFreeMemory();

}  // namespace haustra
