// How the threads of a real-time session are to be scheduled: the section `rt` of the configuration. Plain data; what
// is done about it, and what the system grants, stands in platform/realtime.
#pragma once

#include <string>

namespace haustra {

struct RealTimeConfig {
  bool enabled = true;   // off: ordinary scheduling, for comparison and for machines that are shared
  bool require = false;  // on: a session does not start unless everything below was granted
  // Of SCHED_FIFO; 0: ordinary scheduling [0, 99]. Both stand below the interrupt threads of a real-time kernel (50):
  // those bring the frames and the answers of the GPU. Capture stands above tracking: it has little to do, and a frame
  // that is taken late cannot be answered in time.
  int capture_priority = 48;
  int tracking_priority = 46;
  int mapping_priority = 0;
  int merging_priority = 0;  // recognises places for the mapper
  // Processors, as in "3" or "0,2-5"; empty: all. A core of its own for tracking keeps its cache warm.
  std::string capture_cpus;
  std::string tracking_cpus;
  std::string mapping_cpus;
  std::string merging_cpus;     // and of the search for depth
  bool lock_memory = true;      // no page of the process leaves the memory, and all are there from the start
  int stack_prefault_kb = 256;  // of each thread's stack, touched before its first frame [0, 1024]
  // Of the heap, touched before the first frame, when memory is locked: what mapping may take there for its solvers
  // and the observer for what it keeps [0, 4096]. `haustra plan` counts this for the solvers: with 0 they take what
  // they need all the same, uncounted.
  int heap_prefault_mb = 192;
};

}  // namespace haustra
