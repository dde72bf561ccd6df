// How far a command is: one line that is drawn again on a terminal, a line of its own every few seconds in a log,
// nothing with --quiet. thread-bound(one at a time).
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace haustra {

class ProgressLine {
 public:
  ProgressLine();
  // Ends the line on a terminal.
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // `text` is asked for what to show when it is time to.
  void Update(const std::function<std::string()>& text);
  // Shows the text, whatever the time, and ends the line.
  void Finish(const std::string& text);
  // Ends the line, where there is one, so that something else can be said.
  void Leave();
  double elapsed_s() const;

 private:
  void Draw(const std::string& text);

  bool is_terminal_;
  bool has_open_line_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_draw_;
};

}  // namespace haustra
