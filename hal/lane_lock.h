// A lock for a lane of a vision device that several threads of ordinary work share. Its holder may take it again and
// gives it back as often; while it is held, the holder has at least the priority of whoever waits for it. Never on the
// tracking thread. thread-safe.
#pragma once

#include <memory>

namespace haustra {

class LaneLock {
 public:
  LaneLock();
  ~LaneLock();
  LaneLock(const LaneLock&) = delete;
  LaneLock& operator=(const LaneLock&) = delete;

  void Lock();
  void Unlock();

 private:
  struct Native;
  std::unique_ptr<Native> native_;
};

}  // namespace haustra
