// A vision device that is noticed when it fails, around any other: an answer of kUnavailable means that it is lost, an
// answer that does not come in time means that it hangs. (A device that is no accelerator works inside of the calls: it
// cannot be silent, and only the deadlines of the callers end its waits.) From then on the other device is left alone
// and every request is answered at once with kUnavailable, so that no thread waits for it and the session can end.
//
// A call that never returns (a driver that hangs) cannot be ended from outside: the heartbeat of its thread stops, and
// whoever watches that has to give the process up.
// thread-safe: one thread a lane at a time. rt-safe as the device is.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>

#include "hal/clock.h"
#include "hal/forwarding_vision_device.h"

namespace haustra {

class WatchedVisionDevice final : public ForwardingVisionDevice {
 public:
  enum class Fault : std::uint8_t { kNone, kLost, kHung };

  // `patience`: how long a lane may owe an answer, above zero. `device` and `clock` outlive this. A device that hangs
  // must not be destroyed: that waits for its work.
  WatchedVisionDevice(VisionDevice& device, const Clock& clock, Duration patience)
      : ForwardingVisionDevice(device), clock_(clock), patience_(patience) {}

  // Any thread. Once it is not kNone it stays as it is.
  Fault fault() const { return fault_.load(std::memory_order_acquire); }

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    return Ask(lane, [&] { return ForwardingVisionDevice::EnqueueExtract(lane, request); });
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    return Ask(lane, [&] { return ForwardingVisionDevice::EnqueueMatch(lane, request); });
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    return Ask(lane, [&] { return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request); });
  }

  Status Wait(Ticket ticket, TimePoint deadline) override {
    if (fault() != Fault::kNone) return Faulty();
    if (!is_accelerator()) return Checked(ForwardingVisionDevice::Wait(ticket, deadline));
    const TimePoint end_of_patience = AskedAt(ticket) + patience_;
    const Status status = ForwardingVisionDevice::Wait(ticket, std::min(deadline, end_of_patience));
    if (status.code() != StatusCode::kDeadlineExceeded) return Checked(status);
    if (fault() != Fault::kNone) return Faulty();  // the other lane found out
    if (clock_.Now() < end_of_patience) return status;
    Note(Fault::kHung);
    return Faulty();
  }

  Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) override {
    if (fault() != Fault::kNone) return Faulty();
    return Checked(ForwardingVisionDevice::ReadDescriptors(set, out));
  }
  Status WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override {
    if (fault() != Fault::kNone) return Faulty();
    return Checked(ForwardingVisionDevice::WriteFeatures(set, keypoints, descriptors));
  }

 private:
  // The newest request of a lane. An older one that is still waited for has been asked before it.
  struct Asked {
    std::atomic<std::uint64_t> ticket{0};
    std::atomic<std::int64_t> at_ns{0};
  };

  static Status Faulty() { return Status(StatusCode::kUnavailable); }

  void Note(Fault fault) {
    Fault none = Fault::kNone;
    fault_.compare_exchange_strong(none, fault, std::memory_order_acq_rel);
  }

  Status Checked(const Status& status) {
    if (status.code() == StatusCode::kUnavailable) Note(Fault::kLost);
    return status;
  }

  template <typename Enqueue>
  Result<Ticket> Ask(Lane lane, const Enqueue& enqueue) {
    if (fault() != Fault::kNone) return Faulty();
    Result<Ticket> ticket = enqueue();
    if (ticket.code() == StatusCode::kUnavailable) Note(Fault::kLost);
    if (!ticket.ok()) return ticket;
    Asked& asked = asked_[static_cast<std::size_t>(lane)];
    asked.at_ns.store(clock_.Now().time_since_epoch().count(), std::memory_order_relaxed);
    asked.ticket.store(ticket->value, std::memory_order_relaxed);
    return ticket;
  }

  TimePoint AskedAt(Ticket ticket) const {
    for (const Asked& asked : asked_) {
      if (asked.ticket.load(std::memory_order_relaxed) != ticket.value) continue;
      return TimePoint(Duration(asked.at_ns.load(std::memory_order_relaxed)));
    }
    return clock_.Now();
  }

  const Clock& clock_;
  const Duration patience_;
  std::atomic<Fault> fault_{Fault::kNone};
  std::array<Asked, static_cast<std::size_t>(Lane::kNumLanes)> asked_;
};

}  // namespace haustra
