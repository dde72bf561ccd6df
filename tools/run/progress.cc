#include "tools/run/progress.h"

#include <algorithm>
#include <cstdio>
#include <string>

namespace haustra {
namespace {

constexpr int kBarWidth = 24;

}  // namespace

Progress::Progress(std::uint32_t num_frames) : num_frames_(num_frames) {}

void Progress::Update(const RunRecord& record) {
  line_.Update([&] { return Text(record); });
}

void Progress::Finish(const RunRecord& record) {
  if (!record.frames().empty()) line_.Finish(Text(record));
}

std::string Progress::Text(const RunRecord& record) const {
  const std::size_t done = record.frames().size();
  const double seconds = line_.elapsed_s();
  const FrameResult& last = record.frames().back().result;
  std::string bar;
  if (num_frames_ > 0) {
    const int filled = static_cast<int>(std::min<std::size_t>(kBarWidth, done * kBarWidth / num_frames_));
    bar = "[" + std::string(filled, '#') + std::string(kBarWidth - filled, '.') + "] ";
  }
  const std::string map = last.state == TrackingState::kTracking ? std::to_string(last.map_id) : "-";
  char text[160];
  const std::string of = num_frames_ > 0 ? "/" + std::to_string(num_frames_) : " frames";
  std::snprintf(text, sizeof(text), "%s%zu%s  %5.1f fps  %-12s map %-3s %5.1f %% with a pose so far", bar.c_str(), done,
                of.c_str(), seconds > 0 ? static_cast<double>(done) / seconds : 0.0,
                std::string(ToString(last.state)).c_str(), map.c_str(),
                100.0 * static_cast<double>(record.num_tracked()) / static_cast<double>(done));
  return text;
}

}  // namespace haustra
