// A vision device that takes time: another device (a scripted one, say) behind a model of an accelerator. Each lane
// works off its requests in order; a request takes a base time and more for each feature or query that it asks for.
// Results are there when Wait says so, and not before: Wait lets the time pass, up to its deadline. On a clock that the
// test moves this is a script; on the machine's clock it is a load that a scheduler can be tried with.
// thread-safe: one thread a lane; the model is changed between frames.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>

#include "hal/clock.h"
#include "hal/forwarding_vision_device.h"

namespace haustra {

class TimedVisionDevice final : public ForwardingVisionDevice {
 public:
  struct Model {
    Duration extract{0}, match{0}, guided{0};
    Duration per_feature{0};  // of an extraction, for each feature it may find
    Duration per_query{0};    // of a guided search
  };

  // wait_until lets time pass on `clock`, at least to the time given. All outlive this.
  TimedVisionDevice(VisionDevice& device, const Clock& clock, std::function<void(TimePoint)> wait_until)
      : ForwardingVisionDevice(device), clock_(clock), wait_until_(std::move(wait_until)) {}

  void SetModel(const Model& model) { model_ = model; }
  void SetAccelerator(bool is_accelerator) { is_accelerator_ = is_accelerator; }

  std::string_view name() const override { return "timed"; }
  bool is_accelerator() const override { return is_accelerator_; }

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    const int num =
        request.max_features > 0 ? std::min(request.max_features, plan().max_features) : plan().max_features;
    return Take(lane, model_.extract + num * model_.per_feature, ForwardingVisionDevice::EnqueueExtract(lane, request));
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    return Take(lane, model_.match, ForwardingVisionDevice::EnqueueMatch(lane, request));
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    const auto num = static_cast<std::int64_t>(request.queries.size());
    return Take(lane, model_.guided + num * model_.per_query,
                ForwardingVisionDevice::EnqueueGuidedMatch(lane, request));
  }

  Status Wait(Ticket ticket, TimePoint deadline) override {
    for (const Busy& lane : lanes_) {
      if (lane.ticket.load(std::memory_order_relaxed) != ticket.value) continue;  // the other thread's
      wait_until_(std::min(lane.until, deadline));
      if (lane.until > deadline) return Status(StatusCode::kDeadlineExceeded);
      break;
    }
    return ForwardingVisionDevice::Wait(ticket, deadline);
  }

 private:
  // What a lane works on; an earlier request of it is done by then.
  struct Busy {
    std::atomic<std::uint64_t> ticket{0};
    TimePoint until;  // the lane's thread only
  };

  Result<Ticket> Take(Lane lane, Duration duration, Result<Ticket> ticket) {
    if (!ticket.ok()) return ticket;
    Busy& busy = lanes_[static_cast<std::size_t>(lane)];
    busy.until = std::max(busy.until, clock_.Now()) + duration;
    busy.ticket.store(ticket->value, std::memory_order_relaxed);
    return ticket;
  }

  const Clock& clock_;
  std::function<void(TimePoint)> wait_until_;
  Model model_;
  bool is_accelerator_ = false;
  std::array<Busy, static_cast<std::size_t>(Lane::kNumLanes)> lanes_;
};

}  // namespace haustra
