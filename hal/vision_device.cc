#include "hal/vision_device.h"

namespace haustra {
namespace {

Status WaitFor(VisionDevice& device, const Result<Ticket>& ticket, TimePoint deadline) {
  if (!ticket.ok()) return ticket.status();
  return device.Wait(*ticket, deadline);
}

}  // namespace

bool VisionDevice::Abandon(Ticket) { return false; }
Status VisionDevice::ServeThisThread(Lane) { return Status::Ok(); }

Status ExtractAndWait(VisionDevice& device, Lane lane, const ExtractRequest& request, TimePoint deadline) {
  return WaitFor(device, device.EnqueueExtract(lane, request), deadline);
}

Status MatchAndWait(VisionDevice& device, Lane lane, const MatchRequest& request, TimePoint deadline) {
  return WaitFor(device, device.EnqueueMatch(lane, request), deadline);
}

Status GuidedMatchAndWait(VisionDevice& device, Lane lane, const GuidedMatchRequest& request, TimePoint deadline) {
  return WaitFor(device, device.EnqueueGuidedMatch(lane, request), deadline);
}

}  // namespace haustra
