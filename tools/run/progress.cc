#include "tools/run/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace haustra {
namespace {

using std::chrono::steady_clock;

constexpr auto kTerminalInterval = std::chrono::milliseconds(100);
constexpr auto kLogInterval = std::chrono::seconds(10);
constexpr int kBarWidth = 24;

}  // namespace

Progress::Progress(std::uint32_t num_frames)
    : num_frames_(num_frames),
      is_terminal_(isatty(STDERR_FILENO) == 1),
      start_(steady_clock::now()),
      last_draw_(start_) {}

void Progress::Update(const RunRecord& record) {
  const steady_clock::time_point now = steady_clock::now();
  if (now - last_draw_ < (is_terminal_ ? steady_clock::duration(kTerminalInterval) : kLogInterval)) return;
  last_draw_ = now;
  Draw(record);
}

void Progress::Finish(const RunRecord& record) {
  if (record.frames().empty()) return;
  Draw(record);
  if (is_terminal_) std::fputc('\n', stderr);
}

void Progress::Draw(const RunRecord& record) {
  const std::size_t done = record.frames().size();
  const double seconds = std::chrono::duration<double>(steady_clock::now() - start_).count();
  const FrameResult& last = record.frames().back().result;
  std::string bar;
  if (num_frames_ > 0) {
    const int filled = static_cast<int>(std::min<std::size_t>(kBarWidth, done * kBarWidth / num_frames_));
    bar = "[" + std::string(filled, '#') + std::string(kBarWidth - filled, '.') + "] ";
  }
  const std::string map = last.state == TrackingState::kTracking ? std::to_string(last.map_id) : "-";
  std::fprintf(stderr, "%s%s%zu/%u  %5.1f fps  %-12s map %-3s covered %5.1f %%%s", is_terminal_ ? "\r" : "",
               bar.c_str(), done, num_frames_, seconds > 0 ? static_cast<double>(done) / seconds : 0.0,
               std::string(ToString(last.state)).c_str(), map.c_str(),
               100.0 * static_cast<double>(record.num_tracked()) / static_cast<double>(done),
               is_terminal_ ? "\033[K" : "\n");
  std::fflush(stderr);
}

}  // namespace haustra
