#include "platform/realtime/realtime_threads.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace haustra {
namespace {

constexpr int kPageBytes = 4096;
constexpr int kDepthNice = 10;        // a tenth of the time where another thread wants the processor, too
constexpr int kMaxPrefaultKb = 1024;  // the range of rt.stack_prefault_kb

// Touches so many kilobytes of the stack below this call, from the top down, a page at a time.
[[gnu::noinline]] int TouchStack(int kilobytes) {
  volatile std::byte stack[kMaxPrefaultKb * 1024];
  const int num_bytes = std::min(kilobytes, kMaxPrefaultKb) * 1024;
  for (int i = kPageBytes; i <= num_bytes; i += kPageBytes) stack[sizeof(stack) - i] = std::byte{1};
  return num_bytes / 1024;
}

// Checked before: a text that cannot be read names no processor.
CpuList CpusOf(const std::string& text) {
  const Result<CpuList> cpus = ParseCpuList(text);
  return cpus.ok() ? *cpus : CpuList();
}

}  // namespace

RealTimeThreads::RealTimeThreads(const RealTimeConfig& config, ThreadSystem& system)
    : config_(config), system_(system) {
  report_.is_enabled = config.enabled;
  report_.asked_lock = config.enabled && config.lock_memory;
  report_.priority_limit = system.PriorityLimit();
  report_.lock_limit_bytes = system.LockLimitBytes();
  report_.kernel_preemption = system.KernelPreemption();
  report_.realtime_share = system.RealTimeShare();
  const char* names[] = {"capture", "tracking", "mapping", "merging"};
  for (std::size_t i = 0; i < report_.threads.size(); ++i) report_.threads[i].name = names[i];
  if (!report_.asked_lock) return;
  const bool with_future = system.MayLockAll();
  report_.lock_error = system.LockMemory(with_future);
  report_.is_memory_locked = report_.lock_error == 0 && with_future;
  report_.heap_error = system.HoldHeap(std::size_t{1'000'000} * static_cast<std::size_t>(config.heap_prefault_mb));
  if (report_.heap_error == 0) report_.heap_prefaulted_mb = config.heap_prefault_mb;
  heap_bytes_ = system.HeapBytes();
}

RealTimeThreads::~RealTimeThreads() {
  if (!report_.asked_lock) return;
  if (report_.lock_error == 0) system_.UnlockMemory();
  if (report_.heap_error == 0) system_.ReleaseHeap();
}

std::size_t RealTimeThreads::HeapGrowthBytes() const {
  const std::size_t now = system_.HeapBytes();
  return report_.asked_lock && now > heap_bytes_ ? now - heap_bytes_ : 0;
}

void RealTimeThreads::Apply(SessionThread thread) {
  ThreadGrant& grant = report_.threads[static_cast<std::size_t>(thread)];
  if (config_.enabled) {
    const int priorities[] = {config_.capture_priority, config_.tracking_priority, config_.mapping_priority,
                              config_.merging_priority};
    const std::string* cpus[] = {&config_.capture_cpus, &config_.tracking_cpus, &config_.mapping_cpus,
                                 &config_.merging_cpus};
    grant.asked_priority = priorities[static_cast<int>(thread)];
    grant.asked_cpus = CpusOf(*cpus[static_cast<int>(thread)]);
    if (grant.asked_cpus.any()) grant.cpus_error = system_.SetCpus(grant.asked_cpus);
    grant.prefaulted_kb = TouchStack(config_.stack_prefault_kb);
    if (grant.asked_priority > 0) grant.priority_error = system_.SetFifo(grant.asked_priority);
  }
  grant.granted_priority = system_.FifoPriority();
  grant.granted_cpus = system_.Cpus();
}

void RealTimeThreads::ApplyToDepth() {
  if (const CpuList cpus = CpusOf(config_.merging_cpus); config_.enabled && cpus.any()) (void)system_.SetCpus(cpus);
  (void)system_.SetNice(kDepthNice);
}

Status RealTimeThreads::Check() const {
  if (!config_.require || !config_.enabled) return Status::Ok();
  const std::vector<std::string> refusals = Refusals(report_);
  if (refusals.empty()) return Status::Ok();
  std::string message = "rt.require is set, but the system does not grant what the configuration asks for:";
  for (const std::string& refusal : refusals) message += "\n  " + refusal;
  return FailedPrecondition(message);
}

Status CheckRealTimeConfig(const RealTimeConfig& config) {
  const std::pair<const char*, const std::string*> lists[] = {{"rt.capture_cpus", &config.capture_cpus},
                                                              {"rt.tracking_cpus", &config.tracking_cpus},
                                                              {"rt.mapping_cpus", &config.mapping_cpus},
                                                              {"rt.merging_cpus", &config.merging_cpus}};
  for (const auto& [key, text] : lists) {
    const Result<CpuList> cpus = ParseCpuList(*text);
    if (!cpus.ok()) return FailedPrecondition(std::string(key) + ": " + cpus.status().message());
  }
  if (config.require && !config.enabled) return FailedPrecondition("rt.require is set, but rt.enabled is off");
  return Status::Ok();
}

}  // namespace haustra
