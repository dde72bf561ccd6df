#include "platform/daemon/status_text.h"

#include <unistd.h>
#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <string_view>

namespace haustra {
namespace {

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

class StatusLines {
 public:
  void Add(std::string_view key, const std::string& value) {
    if (value.empty()) return;
    text_ += key;
    text_ += ' ';
    // A message from elsewhere may have lines.
    for (const char c : value) text_ += c == '\n' ? ';' : c;
    text_ += '\n';
  }
  void Add(std::string_view key, std::uint64_t value) { Add(key, std::to_string(value)); }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class Metrics {
 public:
  // type: counter, gauge or histogram.
  void Begin(std::string_view name, std::string_view type, std::string_view help) {
    name_ = name;
    text_ += "# HELP " + name_ + " ";
    text_ += help;
    text_ += "\n# TYPE " + name_ + " ";
    text_ += type;
    text_ += '\n';
  }
  // labels: `{key="value"}`, or empty.
  void Sample(std::string_view suffix, const std::string& labels, const std::string& value) {
    text_ += name_;
    text_ += suffix;
    text_ += labels + " " + value + "\n";
  }
  void Single(std::string_view name, std::string_view type, std::string_view help, double value) {
    Begin(name, type, help);
    Sample("", "", Number(value));
  }
  const std::string& text() const { return text_; }

 private:
  std::string name_;
  std::string text_;
};

std::string Label(std::string_view key, std::string_view value) {
  return "{" + std::string(key) + "=\"" + std::string(value) + "\"}";
}

std::uint64_t Sum(const std::array<std::uint64_t, kNumStates>& values) {
  std::uint64_t sum = 0;
  for (const std::uint64_t value : values) sum += value;
  return sum;
}

}  // namespace

std::uint64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t size_pages = 0, resident_pages = 0;
  if (!(file >> size_pages >> resident_pages)) return 0;
  return resident_pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

std::string ToStatusText(const ServiceStatus& status, const ProcedureCounts& counts) {
  StatusLines lines;
  lines.Add("summary", status.summary);
  lines.Add("state", status.is_waiting_for_source ? "waiting_for_source"
                     : status.is_stopped          ? "stopped"
                     : status.is_open             ? "running"
                                                  : "idle");
  lines.Add("service", haustra_service_name(status.service));
  if (status.procedure > 0) lines.Add("procedure", status.procedure);
  lines.Add("label", status.label);
  lines.Add("interrupted", status.is_interrupted ? "yes" : "");
  lines.Add("uptime_s", Number(ToSeconds(status.uptime)));
  if (counts.has_frame != 0 && status.is_open) {
    lines.Add("tracking", std::string(ToString(counts.last_state)));
    lines.Add("reason", std::string(ToString(counts.last_reason)));
    lines.Add("frame", counts.last_frame_index);
    if (counts.last_map_id != kNoId) lines.Add("map", counts.last_map_id);
    lines.Add("latency_ms", Number(ToMilliseconds(counts.last_latency)));
  }
  if (status.is_open) {
    lines.Add("maps", counts.maps);
    lines.Add("keyframes", counts.keyframes);
    lines.Add("points", counts.points);
    lines.Add("depth", status.searches_depth ? "on" : "off");
    if (status.searches_depth) {
      lines.Add("keyframes_with_depth", counts.keyframes_with_depth);
      lines.Add("depths_late", counts.depths_late);
    }
  }
  lines.Add("frames", Sum(counts.frames));
  lines.Add("frames_dropped", counts.frames_dropped);
  lines.Add("frames_damaged", counts.frames_damaged);
  lines.Add("checkpoints", counts.checkpoints);
  if (status.checkpoint_age) lines.Add("checkpoint_age_s", Number(ToSeconds(*status.checkpoint_age)));
  lines.Add("checkpoint_error", status.checkpoint_error);
  if (status.worker_pid > 0) lines.Add("worker", static_cast<std::uint64_t>(status.worker_pid));
  lines.Add("device", status.device);
  if (status.worker_faults > 0) lines.Add("worker_faults", status.worker_faults);
  lines.Add("last_fault", status.last_fault);
  lines.Add("trouble", status.trouble);
  lines.Add("needs_restart", status.needs_restart);
  lines.Add("busy", status.is_busy ? "yes" : "");
  return lines.text();
}

std::string ToMetricsText(const ServiceMetrics& metrics, const ProcedureCounts& counts) {
  Metrics out;
  out.Single("haustra_uptime_seconds", "gauge", "since the service started", ToSeconds(metrics.uptime));
  out.Begin("haustra_service", "gauge", "1 for what the service is doing");
  for (int i = 0; i <= HAUSTRA_SERVICE_CLOSED; ++i) {
    out.Sample("", Label("state", haustra_service_name(static_cast<std::uint32_t>(i))),
               i == static_cast<int>(metrics.service) ? "1" : "0");
  }
  out.Single("haustra_procedures_total", "counter", "procedures begun or resumed",
             static_cast<double>(metrics.procedures));
  out.Single("haustra_procedure_open", "gauge", "1 while a procedure is open", metrics.is_open ? 1 : 0);
  out.Single("haustra_workers_total", "counter", "workers that were started", static_cast<double>(metrics.workers));
  out.Single("haustra_worker_faults_total", "counter", "workers that hung or died or lost their device",
             static_cast<double>(metrics.worker_faults));

  out.Begin("haustra_frames_total", "counter", "frames answered, by tracking state");
  for (std::size_t i = 0; i < kNumStates; ++i) {
    out.Sample("", Label("state", ToString(static_cast<TrackingState>(i))), std::to_string(counts.frames[i]));
  }
  out.Begin("haustra_frames_by_reason_total", "counter", "frames answered, by the reason of their state");
  for (std::size_t i = 0; i < kNumReasons; ++i) {
    const std::string_view name = ToString(static_cast<TrackingReason>(i));
    if (name != "unknown") out.Sample("", Label("reason", name), std::to_string(counts.reasons[i]));
  }
  out.Single("haustra_frames_dropped_total", "counter", "frames that a newer one overtook",
             static_cast<double>(counts.frames_dropped));
  out.Single("haustra_frames_damaged_total", "counter", "frames that could not be read",
             static_cast<double>(counts.frames_damaged));

  out.Begin("haustra_tracking_latency_seconds", "histogram", "from the frame's capture to its answer");
  std::uint64_t cumulative = 0;
  for (std::size_t i = 0; i < counts.latency_buckets.size(); ++i) {
    cumulative += counts.latency_buckets[i];
    out.Sample("_bucket", Label("le", i < kLatencyBounds_s.size() ? Number(kLatencyBounds_s[i]) : "+Inf"),
               std::to_string(cumulative));
  }
  out.Sample("_sum", "", Number(counts.latency_sum_s));
  out.Sample("_count", "", std::to_string(cumulative));

  out.Begin("haustra_map_events_total", "counter", "what happened to the maps");
  for (std::size_t i = 0; i < kNumEventKinds; ++i) {
    const std::string_view name = ToString(static_cast<MapEventKind>(i));
    if (name != "unknown") out.Sample("", Label("kind", name), std::to_string(counts.events[i]));
  }
  const struct {
    const char* pool;
    double used;
    double capacity;
  } pools[] = {
      {"maps", static_cast<double>(counts.maps), static_cast<double>(metrics.capacity.max_maps)},
      {"keyframes", static_cast<double>(counts.keyframes), static_cast<double>(metrics.capacity.max_keyframes)},
      {"map_points", static_cast<double>(counts.points), static_cast<double>(metrics.capacity.max_map_points)}};
  out.Begin("haustra_pool_used", "gauge", "entities of a pool in use");
  for (const auto& pool : pools) out.Sample("", Label("pool", pool.pool), Number(pool.used));
  out.Begin("haustra_pool_capacity", "gauge", "entities that a pool has room for");
  for (const auto& pool : pools) out.Sample("", Label("pool", pool.pool), Number(pool.capacity));

  out.Single("haustra_depth_enabled", "gauge", "1 when the depth of keyframes is searched",
             metrics.searches_depth ? 1 : 0);
  out.Single("haustra_keyframes_with_depth", "gauge", "keyframes whose depth is known", counts.keyframes_with_depth);
  out.Begin("haustra_depths_total", "counter", "keyframes whose depth was to be searched, by what came of it");
  out.Sample("", Label("result", "found"), std::to_string(counts.depths_found));
  out.Sample("", Label("result", "late"), std::to_string(counts.depths_late));
  out.Sample("", Label("result", "too_little_seen"), std::to_string(counts.depths_too_little));
  out.Sample("", Label("result", "in_vain"), std::to_string(counts.depths_in_vain));

  out.Begin("haustra_checkpoints_total", "counter", "checkpoints, by how they came out");
  out.Sample("", Label("result", "written"), std::to_string(counts.checkpoints));
  out.Sample("", Label("result", "failed"), std::to_string(counts.checkpoints_failed));
  if (metrics.checkpoint_age) {
    out.Single("haustra_checkpoint_age_seconds", "gauge", "since the last checkpoint of this procedure",
               ToSeconds(*metrics.checkpoint_age));
  }
  out.Single("haustra_checkpoint_pause_seconds", "gauge", "that the last save held the mapper",
             ToSeconds(counts.checkpoint_pause));
  out.Single("haustra_control_clients", "gauge", "clients of the control socket", metrics.clients);
  out.Single("haustra_control_clients_refused_total", "counter", "clients above a limit",
             static_cast<double>(metrics.clients_refused));
  out.Single("haustra_control_requests_malformed_total", "counter", "requests that could not be understood",
             static_cast<double>(metrics.requests_malformed));
  out.Single("haustra_resident_memory_bytes", "gauge", "memory of the service and its worker",
             static_cast<double>(ResidentBytes() + metrics.worker_bytes));
  return out.text();
}

}  // namespace haustra
