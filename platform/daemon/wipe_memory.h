// So that nothing of a patient stays in the process when the procedure has ended: memory is overwritten when it is
// freed, and what is free goes back to the system, which clears it before anybody gets it again.
#pragma once

namespace haustra {

// At the start of the process: from now on every block that is freed is overwritten at once (glibc's M_PERTURB).
void OverwriteFreedMemory();

// Gives free pages back.
void ReturnFreeMemory();

}  // namespace haustra
