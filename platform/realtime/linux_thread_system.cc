#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/utsname.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>

#include "platform/realtime/one_heap.h"
#include "platform/realtime/thread_system.h"

namespace haustra {
namespace {

static_assert(kMaxCpus == CPU_SETSIZE);
constexpr int kCapIpcLock = 14;  // linux/capability.h

bool HasCapability(int capability) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("CapEff:", 0) != 0) continue;
    return ((std::strtoull(line.c_str() + 7, nullptr, 16) >> capability) & 1) != 0;
  }
  return false;
}

std::int64_t Limit(int resource) {
  rlimit limit{};
  if (getrlimit(static_cast<decltype(RLIMIT_CPU)>(resource), &limit) != 0) return 0;
  return limit.rlim_cur == RLIM_INFINITY ? -1 : static_cast<std::int64_t>(limit.rlim_cur);
}

class LinuxSystem final : public ThreadSystem {
 public:
  int SetFifo(int priority) override {
    sched_param parameters{};
    parameters.sched_priority = priority;
    return pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters);
  }

  // Linux takes 0 for the calling thread alone.
  int SetNice(int nice) override { return setpriority(PRIO_PROCESS, 0, nice) == 0 ? 0 : errno; }

  int SetCpus(const CpuList& cpus) override {
    cpu_set_t set;
    CPU_ZERO(&set);
    for (int cpu = 0; cpu < kMaxCpus; ++cpu) {
      if (cpus[static_cast<std::size_t>(cpu)]) CPU_SET(cpu, &set);
    }
    return pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
  }

  int LockMemory(bool with_future) override {
    return mlockall(MCL_CURRENT | (with_future ? MCL_FUTURE : 0)) == 0 ? 0 : errno;
  }
  void UnlockMemory() override { munlockall(); }
  int HoldHeap(std::size_t num_free_bytes) override { return haustra::HoldHeap(num_free_bytes) ? 0 : ENOMEM; }
  void ReleaseHeap() override { haustra::ReleaseHeap(); }
  std::size_t HeapBytes() const override { return haustra::HeapBytes(); }

  int FifoPriority() const override {
    const int policy = sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
    sched_param parameters{};
    if (policy != SCHED_FIFO || sched_getparam(0, &parameters) != 0) return 0;
    return parameters.sched_priority;
  }

  CpuList Cpus() const override {
    CpuList cpus;
    cpu_set_t set;
    CPU_ZERO(&set);
    if (pthread_getaffinity_np(pthread_self(), sizeof(set), &set) != 0) return cpus;
    for (int cpu = 0; cpu < kMaxCpus; ++cpu) cpus.set(static_cast<std::size_t>(cpu), CPU_ISSET(cpu, &set) != 0);
    return cpus;
  }

  bool MayLockAll() const override { return Limit(RLIMIT_MEMLOCK) < 0 || HasCapability(kCapIpcLock); }
  std::int64_t PriorityLimit() const override { return Limit(RLIMIT_RTPRIO); }
  std::int64_t LockLimitBytes() const override { return Limit(RLIMIT_MEMLOCK); }

  std::string KernelPreemption() const override {
    utsname name{};
    if (uname(&name) != 0) return {};
    const std::string version(name.version);
    for (const char* kind : {"PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"}) {
      if (version.find(kind) != std::string::npos) return kind;
    }
    return {};
  }

  double RealTimeShare() const override {
    double runtime_us = -1, period_us = 0;
    std::ifstream("/proc/sys/kernel/sched_rt_runtime_us") >> runtime_us;
    std::ifstream("/proc/sys/kernel/sched_rt_period_us") >> period_us;
    return runtime_us < 0 || period_us <= 0 ? 1.0 : runtime_us / period_us;
  }
};

}  // namespace

ThreadSystem& LinuxThreadSystem() {
  static LinuxSystem system;
  return system;
}

}  // namespace haustra
