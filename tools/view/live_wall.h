// The newest surface of a running engine's wall, made again and again by a thread of its own while the scope moves. One
// for all viewers.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "tools/view/live_surface.h"
#include "tools/view/view_server.h"

namespace haustra::view {

struct WallNews {
  std::uint64_t version = 0;                 // grows with every surface, and when one is forgotten
  std::string json = "{}";                   // live_surface.h; an empty object: there is none
  std::shared_ptr<const ViewResource> mesh;  // null: none
};

// No more than a third of the time is worked, on one core and with the lowest priority: the surface of a long procedure
// comes late, and keeps nobody waiting.
class LiveWall {
 public:
  // folder: as for LiveAtlas.
  explicit LiveWall(const std::string& folder);
  ~LiveWall();
  LiveWall(const LiveWall&) = delete;
  LiveWall& operator=(const LiveWall&) = delete;

  // thread-safe.
  std::shared_ptr<const WallNews> newest() const;

 private:
  void Run(const std::string& folder);
  void Publish(LiveSurface surface);

  mutable std::mutex mutex_;
  std::shared_ptr<const WallNews> newest_ = std::make_shared<WallNews>();
  std::atomic<bool> is_stopping_{false};
  std::thread thread_;
};

}  // namespace haustra::view
