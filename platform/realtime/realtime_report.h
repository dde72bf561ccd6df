// What real-time settings a session asked for and what the system granted: printed at the start, kept in the summary of
// a run. Plain data.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "platform/realtime/cpu_list.h"

namespace haustra {

struct ThreadGrant {
  const char* name = "";
  int asked_priority = 0;    // SCHED_FIFO; 0: ordinary scheduling
  int granted_priority = 0;  // what the kernel says afterwards
  CpuList asked_cpus;        // none: all
  CpuList granted_cpus;
  int prefaulted_kb = 0;
  int priority_error = 0;  // errno, 0: none
  int cpus_error = 0;

  bool is_granted() const { return priority_error == 0 && cpus_error == 0 && granted_priority == asked_priority; }
};

struct RealTimeReport {
  bool is_enabled = false;
  bool asked_lock = false;
  bool is_memory_locked = false;  // all that the process has and will have
  int lock_error = 0;             // errno, 0: none
  int heap_prefaulted_mb = 0;
  int heap_error = 0;  // errno, 0: none
  std::int64_t priority_limit = 0;
  std::int64_t lock_limit_bytes = 0;
  std::string kernel_preemption;
  double realtime_share = 1.0;
  std::array<ThreadGrant, 4> threads;  // capture, tracking, mapping, merging

  bool is_all_granted() const;
};

// One line each for what was refused, with the reason and what to do about it.
std::vector<std::string> Refusals(const RealTimeReport& report);
// A few lines for people: kernel, memory, a line a thread.
std::string ToText(const RealTimeReport& report);

}  // namespace haustra
