#include "tools/command/console.h"

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <string>

#include "hal/core/errno_text.h"
#include "tools/exit_codes.h"

namespace haustra::console {
namespace {

std::atomic<bool> is_quiet_now{false};
std::atomic<int> print_error{0};  // errno of the first text that could not be written

// One call a line, so that lines of several threads do not mix.
void SayOnStderr(const char* command, const char* kind, const char* format, va_list arguments) {
  va_list again;
  va_copy(again, arguments);
  std::string text(static_cast<std::size_t>(std::vsnprintf(nullptr, 0, format, again)), '\0');
  va_end(again);
  std::vsnprintf(text.data(), text.size() + 1, format, arguments);
  std::fprintf(stderr, "haustra %s: %s%s\n", command, kind, text.c_str());
}

void NotePrintError() {
  int none = 0;
  print_error.compare_exchange_strong(none, errno);
}

void SayOnStdout(const char* format, va_list arguments) {
  if (std::vprintf(format, arguments) < 0) NotePrintError();
}

}  // namespace

void SetQuiet(bool is_quiet) { is_quiet_now = is_quiet; }
bool IsQuiet() { return is_quiet_now; }

void Print(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  SayOnStdout(format, arguments);
  va_end(arguments);
}

void Tell(const char* format, ...) {
  if (IsQuiet()) return;
  va_list arguments;
  va_start(arguments, format);
  SayOnStdout(format, arguments);
  va_end(arguments);
}

Status FinishOutput() {
  if (std::fflush(stdout) != 0) NotePrintError();
  const int error = print_error;
  if (error == EPIPE || (error == 0 && std::ferror(stdout) == 0)) return Status::Ok();
  return Unavailable("the output cannot be written" + (error == 0 ? std::string() : ": " + ErrnoText(error)));
}

void Note(const char* command, const char* format, ...) {
  if (IsQuiet()) return;
  va_list arguments;
  va_start(arguments, format);
  SayOnStderr(command, "", format, arguments);
  va_end(arguments);
}

void Warn(const char* command, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  SayOnStderr(command, "warning: ", format, arguments);
  va_end(arguments);
}

int Fail(const char* command, const Status& status) { return Fail(command, status, ExitCodeFor(status.code())); }

int Fail(const char* command, const Status& status, int exit_code) {
  const std::string text = status.message().empty() ? std::string(ToString(status.code())) : status.message();
  std::fprintf(stderr, "haustra %s: %s\n", command, text.c_str());
  return exit_code;
}

int FailWriting(const char* command, const Status& status) {
  switch (status.code()) {
    case StatusCode::kFailedPrecondition: return Fail(command, status, kExitInTheWay);
    case StatusCode::kNotFound:
    case StatusCode::kUnavailable: return Fail(command, status, kExitIo);
    default: return Fail(command, status);
  }
}

}  // namespace haustra::console
