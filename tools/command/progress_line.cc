#include "tools/command/progress_line.h"

#include <unistd.h>

#include <cstdio>

#include "tools/command/console.h"

namespace haustra {
namespace {

using std::chrono::steady_clock;

constexpr auto kTerminalInterval = std::chrono::milliseconds(100);
constexpr auto kLogInterval = std::chrono::seconds(10);

}  // namespace

ProgressLine::ProgressLine()
    : is_terminal_(isatty(STDERR_FILENO) == 1), start_(steady_clock::now()), last_draw_(start_) {}

ProgressLine::~ProgressLine() { Leave(); }

void ProgressLine::Update(const std::function<std::string()>& text) {
  if (console::IsQuiet()) return;
  const steady_clock::time_point now = steady_clock::now();
  if (now - last_draw_ < (is_terminal_ ? steady_clock::duration(kTerminalInterval) : kLogInterval)) return;
  last_draw_ = now;
  Draw(text());
}

void ProgressLine::Finish(const std::string& text) {
  if (console::IsQuiet()) return;
  Draw(text);
  Leave();
}

void ProgressLine::Leave() {
  if (has_open_line_) std::fputc('\n', stderr);
  has_open_line_ = false;
}

double ProgressLine::elapsed_s() const { return std::chrono::duration<double>(steady_clock::now() - start_).count(); }

void ProgressLine::Draw(const std::string& text) {
  std::fprintf(stderr, is_terminal_ ? "\r%s\033[K" : "%s\n", text.c_str());
  std::fflush(stderr);
  has_open_line_ = is_terminal_;
}

}  // namespace haustra
