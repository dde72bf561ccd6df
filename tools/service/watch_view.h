// The picture of `haustra watch` as text. reentrant.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include "platform/publish/haustra_pose_ring.h"

namespace haustra {

// What is known of the daemon at one moment.
struct WatchModel {
  bool is_connected = false;  // to the shared memory
  std::string ring_error;     // why not, but for one that is not there
  bool is_alive = false;
  std::uint32_t service = HAUSTRA_SERVICE_STARTING;
  bool has_pose = false;
  haustra_pose pose{};
  double age_ms = 0.0;  // of the frame
  double poses_per_s = 0.0;
  std::uint64_t num_missed = 0;      // by this reader
  std::deque<double> latencies_ms;   // of the last poses, the newest last
  std::deque<haustra_event> events;  // the last ones, the newest last
  bool has_snapshot = false;
  haustra_snapshot snapshot{};                // without its lists
  std::map<std::string, std::string> status;  // answer of the control socket; empty without one
  std::string control_error;
};

// Several lines, each at most `columns` wide, without escape sequences.
std::string WatchPage(const WatchModel& model, int columns);
// One line, for a log or a pipe.
std::string WatchLine(const WatchModel& model);
// "state running\n..." as a map. Lines without a blank are left out.
std::map<std::string, std::string> ParseStatusText(const std::string& text);

}  // namespace haustra
