// Requests on the tracking lane that end at a deadline: what the device has not finished by then is remembered, and no
// further request is made and no buffer touched until Drain() says that it is done (hal/vision_device.h, Wait).
// thread-bound(tracking), rt-safe.
#pragma once

#include "hal/core/fixed_vector.h"
#include "hal/vision_device.h"

namespace haustra {

class LaneWait {
 public:
  explicit LaneWait(VisionDevice& device) : device_(device) {}

  Status Extract(const ExtractRequest& request, TimePoint deadline) {
    return has_pending() ? Busy() : Finish(device_.EnqueueExtract(Lane::kTracking, request), deadline);
  }
  Status Match(const MatchRequest& request, TimePoint deadline) {
    return has_pending() ? Busy() : Finish(device_.EnqueueMatch(Lane::kTracking, request), deadline);
  }
  Status GuidedMatch(const GuidedMatchRequest& request, TimePoint deadline) {
    return has_pending() ? Busy() : Finish(device_.EnqueueGuidedMatch(Lane::kTracking, request), deadline);
  }

  // A request is under way: its buffers, feature sets and picture must stay.
  bool has_pending() const { return pending_.value != 0; }

  // Gives it up, or waits for it where the device cannot. False: it is not done yet.
  bool Drain(TimePoint deadline) {
    if (!has_pending()) return true;
    // An error is an end, too: a lost device writes nothing more.
    if (!device_.Abandon(pending_) && IsUnfinished(device_.Wait(pending_, deadline), deadline)) return false;
    pending_ = Ticket{};
    for (const FeatureSetHandle set : kept_sets_) device_.ReleaseFeatureSet(set);
    kept_sets_.Clear();
    return true;
  }

  // As VisionDevice::ReleaseFeatureSet, but not before the request under way is done.
  void ReleaseFeatureSet(FeatureSetHandle set) {
    if (has_pending()) {
      HAUSTRA_CHECK(kept_sets_.PushBack(set));  // a frame has two: its own and the last one's
    } else {
      device_.ReleaseFeatureSet(set);
    }
  }

 private:
  // A wait without a deadline ends with the request, whatever the device says of it.
  static bool IsUnfinished(const Status& status, TimePoint deadline) {
    return status.code() == StatusCode::kDeadlineExceeded && deadline != kNoDeadline;
  }
  static Status Busy() { return Status(StatusCode::kDeadlineExceeded); }

  Status Finish(const Result<Ticket>& ticket, TimePoint deadline) {
    if (!ticket.ok()) return ticket.status();
    const Status status = device_.Wait(*ticket, deadline);
    if (IsUnfinished(status, deadline)) pending_ = *ticket;
    return status;
  }

  VisionDevice& device_;
  Ticket pending_;
  FixedVector<FeatureSetHandle, 4> kept_sets_;
};

}  // namespace haustra
