// What haustrad says of itself (daemon.h).
#include "platform/daemon/daemon.h"
#include "platform/daemon/status_text.h"
#include "platform/daemon/supervised_source.h"

namespace haustra {

ProcedureCounts Daemon::counts() const {
  const ProcedureCounts all = Sum(earlier_, report_.counts);
  return is_open() ? all : WithoutProcedure(all);
}

haustra_service Daemon::Service() const {
  if (control_ == nullptr && !TakesRequests(state_.phase)) return HAUSTRA_SERVICE_STARTING;
  const bool is_beginning = state_.purpose == ServicePurpose::kBegin || state_.purpose == ServicePurpose::kResume;
  if (!is_open() || is_beginning || state_.phase == ServicePhase::kStopped) return HAUSTRA_SERVICE_IDLE;
  // While another worker takes its place.
  if (state_.phase != ServicePhase::kRunning) return HAUSTRA_SERVICE_NO_SIGNAL;
  switch (static_cast<SignalState>(report_.signal)) {
    case SignalState::kFrames: return HAUSTRA_SERVICE_RUNNING;
    case SignalState::kOver: return HAUSTRA_SERVICE_SOURCE_OVER;
    case SignalState::kWaiting:
    case SignalState::kNone: return HAUSTRA_SERVICE_NO_SIGNAL;
  }
  return HAUSTRA_SERVICE_NO_SIGNAL;
}

std::string Daemon::OneLine() const {
  std::string text;
  if (state_.phase == ServicePhase::kWaiting) {
    text = "waiting for the camera";
  } else if (state_.phase == ServicePhase::kStopped) {
    text = "stopped: data not kept yet";
  } else if (is_open() && state_.phase == ServicePhase::kRunning) {
    const haustra_service service = Service();
    text = "procedure " + std::to_string(number()) +
           (service == HAUSTRA_SERVICE_NO_SIGNAL     ? ": waiting for signal"
            : service == HAUSTRA_SERVICE_SOURCE_OVER ? ": the recording is over"
                                                     : ": running");
  } else if (is_open()) {
    text = "procedure " + std::to_string(number()) + ": " + std::string(ToString(state_.phase));
  } else if (state_.phase == ServicePhase::kReady) {
    text = is_interrupted() ? "idle: an interrupted procedure waits" : "idle: no procedure";
  } else {
    text = std::string(ToString(state_.phase));
  }
  if (!checkpoint_error_.empty()) text += "; checkpoints fail";
  return text;
}

std::string Daemon::Trouble() const {
  const bool lacks_signal = waits_for_.empty() && Service() == HAUSTRA_SERVICE_NO_SIGNAL;
  const std::string of_source = lacks_signal ? report_.text.data() : waits_for_;
  return trouble_.empty() || of_source.empty() ? trouble_ + of_source : of_source + "; " + trouble_;
}

std::string Daemon::StatusText(TimePoint now) const {
  ServiceStatus status;
  status.summary = OneLine();
  status.service = Service();
  status.is_waiting_for_source = state_.phase == ServicePhase::kWaiting;
  status.is_stopped = state_.phase == ServicePhase::kStopped;
  status.is_open = is_open();
  status.is_busy = !TakesRequests(state_.phase) || !held_.empty();
  status.procedure = number();
  status.label = label_;
  status.is_interrupted = is_interrupted();
  status.uptime = now - started_;
  if (last_checkpoint_) status.checkpoint_age = now - *last_checkpoint_;
  status.checkpoint_error = checkpoint_error_;
  status.worker_pid = worker_ != nullptr ? worker_->pid() : 0;
  status.searches_depth = config_.engine.depth.enabled;
  status.device = device_;
  status.worker_faults = num_faults_;
  status.last_fault = last_fault_;
  status.trouble = Trouble();
  status.needs_restart = needs_restart_;
  return ToStatusText(status, counts());
}

std::string Daemon::MetricsText(TimePoint now) const {
  ServiceMetrics metrics;
  metrics.service = Service();
  metrics.uptime = now - started_;
  metrics.procedures = num_procedures_;
  metrics.is_open = is_open();
  if (last_checkpoint_) metrics.checkpoint_age = now - *last_checkpoint_;
  for (const ControlServer* server : {lookout_.get(), control_.get()}) {
    if (server == nullptr) continue;
    metrics.clients += server->num_clients();
    metrics.clients_refused += server->num_refused();
    metrics.requests_malformed += server->num_malformed();
  }
  metrics.capacity = config_.engine.memory;
  metrics.searches_depth = config_.engine.depth.enabled;
  metrics.workers = num_workers_;
  metrics.worker_faults = num_faults_;
  metrics.worker_bytes = report_.resident_bytes;
  return ToMetricsText(metrics, counts());
}

}  // namespace haustra
