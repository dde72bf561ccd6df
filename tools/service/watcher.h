// Looks at a running haustrad from outside, for `haustra watch`: its ring of poses, and its status socket.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "platform/control/control_client.h"
#include "tools/service/watch_view.h"

namespace haustra {

// thread-bound(its owner).
class Watcher {
 public:
  // The status is asked for at the first look and each so many later.
  static constexpr int kLooksPerStatus = 5;

  // Runtime folder of the daemon, which need not be there yet.
  explicit Watcher(const std::string& folder);
  ~Watcher();
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  // What is known now; valid until the next look.
  const WatchModel& Look();

 private:
  void Reopen();
  void ReadRing();
  void AskStatus();

  const std::string ring_path_, status_path_;
  haustra_ring ring_{};
  std::unique_ptr<haustra_snapshot> snapshot_;
  std::optional<ControlClient> client_;
  WatchModel model_;
  std::uint64_t cursor_ = 0;
  std::uint64_t event_cursor_ = 0;
  std::int64_t last_look_ns_ = 0;
  int num_looks_ = 0;
};

}  // namespace haustra
