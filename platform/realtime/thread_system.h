// What the operating system does about scheduling and memory, as calls that can be faked. A call returns 0 or the errno
// of its failure and concerns the calling thread, but for memory, which is the process's. thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "platform/realtime/cpu_list.h"

namespace haustra {

class ThreadSystem {
 public:
  virtual ~ThreadSystem() = default;

  // SCHED_FIFO; new threads and processes do not inherit it.
  virtual int SetFifo(int priority) = 0;
  virtual int SetCpus(const CpuList& cpus) = 0;
  // Of ordinary scheduling: 0 is usual, 19 the most.
  virtual int SetNice(int nice) = 0;
  // Future mappings only when asked: with a limit on locked memory those would fail at some point, which is worse than
  // a page fault.
  virtual int LockMemory(bool with_future) = 0;
  virtual void UnlockMemory() = 0;
  // Of one_heap.h.
  virtual int HoldHeap(std::size_t num_free_bytes) = 0;
  virtual void ReleaseHeap() = 0;
  virtual std::size_t HeapBytes() const = 0;

  // What holds now: the FIFO priority (0: ordinary scheduling) and the processors.
  virtual int FifoPriority() const = 0;
  virtual CpuList Cpus() const = 0;

  // Of the process: locked memory has no limit that matters to it.
  virtual bool MayLockAll() const = 0;
  // RLIMIT_RTPRIO and RLIMIT_MEMLOCK for messages; -1: no limit.
  virtual std::int64_t PriorityLimit() const = 0;
  virtual std::int64_t LockLimitBytes() const = 0;
  // "PREEMPT_RT", "PREEMPT_DYNAMIC" or what else the kernel says of its preemption; empty when it says nothing.
  virtual std::string KernelPreemption() const = 0;
  // Share of each second that real-time threads may take before the kernel stops them; 1: no such limit.
  virtual double RealTimeShare() const = 0;
};

// This machine.
ThreadSystem& LinuxThreadSystem();

}  // namespace haustra
