// What commands say, in one way: answers on stdout, notes and progress on stderr. --quiet keeps back all but what was
// asked for: answers, and warnings and errors, each as "haustra COMMAND: ...". Texts are in printf's notation.
// thread-safe.
#pragma once

#include "hal/core/status.h"

namespace haustra::console {

// Of the whole process; off at first.
void SetQuiet(bool is_quiet);
bool IsQuiet();

// The answer to what was asked, on stdout; with --quiet, too.
[[gnu::format(printf, 1, 2)]] void Print(const char* format, ...);
// What a command has written that was asked for files, on stdout.
[[gnu::format(printf, 1, 2)]] void Tell(const char* format, ...);
// At the end of the program: whether all that was printed is out. kUnavailable: some are not, as on a full disk. A pipe
// whose reader has gone, as `head` does when it has seen enough, is no error.
Status FinishOutput();
// What happens meanwhile, on stderr; the line break is added.
[[gnu::format(printf, 2, 3)]] void Note(const char* command, const char* format, ...);
// The same for what somebody should look at.
[[gnu::format(printf, 2, 3)]] void Warn(const char* command, const char* format, ...);

// Says what went wrong, for people: the message without its code. Returns `exit_code`, or else the one of the status
// (platform/exit_codes.h).
int Fail(const char* command, const Status& status);
int Fail(const char* command, const Status& status, int exit_code);
// Of a file or folder that was to be written: kExitInTheWay when something is there already (output_folder.h), kExitIo
// when it cannot be written.
int FailWriting(const char* command, const Status& status);

}  // namespace haustra::console
