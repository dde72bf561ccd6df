#include "tools/latency/board_state.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace haustra {
namespace {

namespace fs = std::filesystem;

std::string FirstLine(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (!line.empty() && (line.back() == ' ' || line.back() == '\0')) line.pop_back();
  return line;
}

std::vector<fs::path> FoldersIn(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (it->path().filename().string().rfind(prefix, 0) == 0) found.push_back(it->path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::string Scaled(const std::string& digits, double divisor, const char* unit) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.0f %s", std::strtod(digits.c_str(), nullptr) / divisor, unit);
  return text;
}

}  // namespace

BoardState ReadBoardState(const std::string& root) {
  BoardState state;
  const auto add = [&](const std::string& what, const std::string& value) {
    if (!value.empty()) state.emplace_back(what, value);
  };
  add("board", FirstLine(root + "/proc/device-tree/model"));
  add("nvpmodel", FirstLine(root + "/var/lib/nvpmodel/status"));
  for (const fs::path& cpu : FoldersIn(root + "/sys/devices/system/cpu/cpufreq", "policy")) {
    const std::string now = FirstLine(cpu / "scaling_cur_freq");
    if (now.empty()) continue;
    std::string value = Scaled(now, 1e3, "MHz");
    const std::string most = FirstLine(cpu / "scaling_max_freq"), governor = FirstLine(cpu / "scaling_governor");
    if (!most.empty()) value += " of " + Scaled(most, 1e3, "MHz");
    if (!governor.empty()) value += ", " + governor;
    add("cpu " + FirstLine(cpu / "affected_cpus"), value);
  }
  for (const fs::path& device : FoldersIn(root + "/sys/class/devfreq", "")) {
    const std::string now = FirstLine(device / "cur_freq");
    if (!now.empty()) add(device.filename().string(), Scaled(now, 1e6, "MHz"));
  }
  for (const fs::path& zone : FoldersIn(root + "/sys/class/thermal", "thermal_zone")) {
    const std::string now = FirstLine(zone / "temp");
    if (!now.empty()) add("temperature " + FirstLine(zone / "type"), Scaled(now, 1e3, "C"));
  }
  return state;
}

}  // namespace haustra
