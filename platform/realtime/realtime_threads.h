// Applies the section `rt` of the configuration to a session: the process once, then each thread for itself, so that
// the report says what the kernel granted to that very thread. Not rt-safe: before the first frame.
#pragma once

#include "hal/core/status.h"
#include "hal/realtime_config.h"
#include "platform/realtime/realtime_report.h"
#include "platform/realtime/thread_system.h"

namespace haustra {

enum class SessionThread { kCapture = 0, kTracking = 1, kMapping = 2, kMerging = 3 };

class RealTimeThreads {
 public:
  // Locks the memory when asked, and sets aside what the heap will need; all else must have been taken, or be taken
  // soon. `system` outlives this.
  RealTimeThreads(const RealTimeConfig& config, ThreadSystem& system);
  // Memory is as free to grow and to be paged as before.
  ~RealTimeThreads();
  RealTimeThreads(const RealTimeThreads&) = delete;
  RealTimeThreads& operator=(const RealTimeThreads&) = delete;

  // On the thread itself. Each thread writes a line of its own: different threads may call this at once.
  void Apply(SessionThread thread);

  // On the thread that searches depth, which nobody waits for: on the processors of merging, and nicer than all others.
  // What is refused is left as it is.
  void ApplyToDepth();

  // By how much the heap is larger than with what was set aside; 0 when nothing was asked.
  std::size_t HeapGrowthBytes() const;

  // When all threads have applied theirs.
  const RealTimeReport& report() const { return report_; }
  // kFailedPrecondition: rt.require is set and something was refused; the message says what.
  Status Check() const;

 private:
  RealTimeConfig config_;
  ThreadSystem& system_;
  RealTimeReport report_;
  std::size_t heap_bytes_ = 0;  // after that
};

// Whether the texts of the section can be read. kFailedPrecondition names the key.
Status CheckRealTimeConfig(const RealTimeConfig& config);

}  // namespace haustra
