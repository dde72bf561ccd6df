// What haustrad says of itself (daemon.h).
#include "platform/daemon/daemon.h"
#include "platform/daemon/status_text.h"

namespace haustra {

ProcedureCounts Daemon::counts() const {
  ProcedureCounts counts = procedure_ != nullptr && is_open() ? procedure_->counts() : earlier_;
  counts.checkpoints = earlier_.checkpoints;
  counts.checkpoints_failed = earlier_.checkpoints_failed;
  return counts;
}

haustra_service Daemon::Service() const {
  if (state_ != State::kRunning) return HAUSTRA_SERVICE_IDLE;
  if (procedure_ == nullptr) return HAUSTRA_SERVICE_NO_SIGNAL;  // while its device is made anew
  switch (procedure_->signal()) {
    case SignalState::kFrames: return HAUSTRA_SERVICE_RUNNING;
    case SignalState::kOver: return HAUSTRA_SERVICE_SOURCE_OVER;
    case SignalState::kWaiting:
    case SignalState::kNone: return HAUSTRA_SERVICE_NO_SIGNAL;
  }
  return HAUSTRA_SERVICE_NO_SIGNAL;
}

std::string Daemon::OneLine() const {
  std::string text;
  switch (state_) {
    case State::kWaitingForSource: text = "waiting for the camera"; break;
    case State::kIdle: text = is_interrupted_ ? "idle: an interrupted procedure waits" : "idle: no procedure"; break;
    case State::kStopped: text = "stopped: data not kept yet"; break;
    case State::kRunning: {
      text = Service() == HAUSTRA_SERVICE_NO_SIGNAL ? "procedure " + std::to_string(number_) + ": waiting for signal"
             : Service() == HAUSTRA_SERVICE_SOURCE_OVER
                 ? "procedure " + std::to_string(number_) + ": the recording is over"
                 : "procedure " + std::to_string(number_) + ": running";
    }
  }
  if (!hang_.empty()) text += "; a thread hangs";
  if (!checkpoint_error_.empty()) text += "; checkpoints fail";
  return text;
}

std::string Daemon::StatusText(TimePoint now) const {
  ServiceStatus status;
  status.summary = OneLine();
  status.service = Service();
  status.is_waiting_for_source = state_ == State::kWaitingForSource;
  status.is_stopped = state_ == State::kStopped;
  status.is_open = is_open();
  status.procedure = number_;
  status.label = is_open() ? label_ : interrupted_label_;
  status.is_interrupted = is_interrupted_;
  status.uptime = now - started_;
  if (last_checkpoint_) status.checkpoint_age = now - *last_checkpoint_;
  status.checkpoint_error = checkpoint_error_;
  status.hang = hang_;
  status.trouble = trouble_;
  status.needs_restart = needs_restart_;
  return ToStatusText(status, counts());
}

std::string Daemon::MetricsText(TimePoint now) const {
  ServiceMetrics metrics;
  metrics.service = Service();
  metrics.uptime = now - started_;
  metrics.procedures = number_;
  metrics.is_open = is_open();
  metrics.is_hanging = !hang_.empty();
  if (last_checkpoint_) metrics.checkpoint_age = now - *last_checkpoint_;
  for (const ControlServer* server : {lookout_.get(), control_.get()}) {
    if (server == nullptr) continue;
    metrics.clients += server->num_clients();
    metrics.clients_refused += server->num_refused();
    metrics.requests_malformed += server->num_malformed();
  }
  metrics.capacity = config_.engine.memory;
  return ToMetricsText(metrics, counts());
}

}  // namespace haustra
