#include "platform/realtime/realtime_report.h"

#include <cstdio>

#include "hal/core/errno_text.h"

namespace haustra {
namespace {

std::string Scheduling(int priority) {
  return priority > 0 ? "SCHED_FIFO " + std::to_string(priority) : std::string("ordinary scheduling");
}

std::string CpusText(const CpuList& cpus) {
  return cpus.none() ? std::string("all processors") : "cpu " + ToText(cpus);
}

std::string LimitText(std::int64_t limit) { return limit < 0 ? std::string("unlimited") : std::to_string(limit); }

}  // namespace

bool RealTimeReport::is_all_granted() const { return Refusals(*this).empty(); }

std::vector<std::string> Refusals(const RealTimeReport& report) {
  std::vector<std::string> lines;
  if (!report.is_enabled) return lines;
  for (const ThreadGrant& thread : report.threads) {
    const std::string name = std::string(thread.name) + " thread: ";
    if (thread.priority_error != 0) {
      lines.push_back(name + Scheduling(thread.asked_priority) + " refused: " + ErrnoText(thread.priority_error) +
                      " (RLIMIT_RTPRIO " + LimitText(report.priority_limit) +
                      "); it needs CAP_SYS_NICE or LimitRTPRIO=" + std::to_string(thread.asked_priority));
    } else if (thread.granted_priority != thread.asked_priority) {
      lines.push_back(name + "asked for " + Scheduling(thread.asked_priority) + ", has " +
                      Scheduling(thread.granted_priority));
    }
    if (thread.cpus_error != 0) {
      lines.push_back(name + CpusText(thread.asked_cpus) + " refused: " + ErrnoText(thread.cpus_error) + "; it has " +
                      CpusText(thread.granted_cpus));
    } else if (thread.asked_cpus.any() && thread.granted_cpus != thread.asked_cpus) {
      lines.push_back(name + "asked for " + CpusText(thread.asked_cpus) + ", has " + CpusText(thread.granted_cpus));
    }
  }
  if (report.asked_lock && report.lock_error != 0) {
    lines.push_back("memory: not locked: " + ErrnoText(report.lock_error) + " (RLIMIT_MEMLOCK " +
                    LimitText(report.lock_limit_bytes) + " bytes); it needs CAP_IPC_LOCK or LimitMEMLOCK=infinity");
  } else if (report.asked_lock && !report.is_memory_locked) {
    lines.push_back("memory: only what was taken at the start is locked (RLIMIT_MEMLOCK " +
                    LimitText(report.lock_limit_bytes) + " bytes); it needs CAP_IPC_LOCK or LimitMEMLOCK=infinity");
  }
  if (report.heap_error != 0) {
    lines.push_back("memory: heap not set aside (rt.heap_prefault_mb): " + ErrnoText(report.heap_error));
  }
  return lines;
}

std::string ToText(const RealTimeReport& report) {
  if (!report.is_enabled) return "real time: switched off (rt.enabled), all threads have ordinary scheduling\n";
  char line[256];
  std::string text;
  const std::string kernel = report.kernel_preemption.empty() ? "no preemption named" : report.kernel_preemption;
  std::snprintf(line, sizeof(line), "real time: kernel %s, real-time threads may take %.0f %% of a processor\n",
                kernel.c_str(), 100.0 * report.realtime_share);
  text += line;
  const char* memory = !report.asked_lock        ? "not asked to be locked"
                       : report.is_memory_locked ? "locked, now and later"
                       : report.lock_error == 0  ? "locked as far as taken"
                                                 : "NOT locked";
  std::snprintf(line, sizeof(line), "  %-9s %s, %d MB of heap set aside\n", "memory", memory,
                report.heap_prefaulted_mb);
  text += line;
  for (const ThreadGrant& thread : report.threads) {
    std::snprintf(line, sizeof(line), "  %-9s asked %s on %s, has %s on %s, %d kB of stack touched%s\n", thread.name,
                  Scheduling(thread.asked_priority).c_str(), CpusText(thread.asked_cpus).c_str(),
                  Scheduling(thread.granted_priority).c_str(), CpusText(thread.granted_cpus).c_str(),
                  thread.prefaulted_kb, thread.is_granted() ? "" : "  <- REFUSED");
    text += line;
  }
  return text;
}

}  // namespace haustra
