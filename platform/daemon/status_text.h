// What the control socket answers to `status` and `metrics`. reentrant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "engine/config.h"
#include "hal/core/time.h"
#include "platform/daemon/procedure_counts.h"
#include "platform/publish/haustra_pose_ring.h"

namespace haustra {

struct ServiceStatus {
  std::string summary;
  haustra_service service = HAUSTRA_SERVICE_STARTING;
  bool is_waiting_for_source = false;
  bool is_open = false;
  bool is_stopped = false;
  bool is_interrupted = false;
  bool is_busy = false;  // a request waits its turn
  std::uint64_t procedure = 0;
  std::string label;
  Duration uptime{0};
  std::optional<Duration> checkpoint_age;
  std::string checkpoint_error;
  std::int64_t worker_pid = 0;  // 0: none
  bool searches_depth = false;
  std::string device;  // the worker's, "cpu" or "cuda"; empty: none is ready
  std::uint64_t worker_faults = 0;
  std::string last_fault;
  std::string trouble;
  std::string needs_restart;
};

// "key value" lines; those without a value are left out.
std::string ToStatusText(const ServiceStatus& status, const ProcedureCounts& counts);

struct ServiceMetrics {
  haustra_service service = HAUSTRA_SERVICE_STARTING;
  Duration uptime{0};
  std::uint64_t procedures = 0;
  bool is_open = false;
  std::uint64_t workers = 0;        // started
  std::uint64_t worker_faults = 0;  // that had to be replaced
  std::uint64_t worker_bytes = 0;   // resident
  std::optional<Duration> checkpoint_age;
  bool searches_depth = false;
  int clients = 0;
  std::uint64_t clients_refused = 0;
  std::uint64_t requests_malformed = 0;
  MemoryConfig capacity;
};

// Prometheus text format 0.0.4.
std::string ToMetricsText(const ServiceMetrics& metrics, const ProcedureCounts& counts);

// Memory that this process has now; 0 when the system does not say.
std::uint64_t ResidentBytes();

}  // namespace haustra
