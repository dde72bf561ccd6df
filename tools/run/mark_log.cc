#include "tools/run/mark_log.h"

namespace haustra {
namespace {

// Of frames that mapping has not looked at: seconds.
constexpr std::size_t kMaxUnreadFrames = 512;

}  // namespace

MarkLog::MarkLog(Engine& engine, const std::vector<MarkRequest>& requests, const SequenceOptions& part)
    : engine_(engine), part_(part), frames_(kMaxUnreadFrames) {
  for (const MarkRequest& request : requests) {
    if (part_.IndexOf(request.frame_index)) {
      requests_.push_back(request);
    } else {
      refused_.push_back({request, "the run does not read its frame"});
    }
  }
}

void MarkLog::OnTracked(const FrameOutcome& outcome) {
  const MarkSightings& sightings = engine_.mark_sightings();
  if (!sightings.empty()) {
    if (SeenFrame* slot = frames_.BeginPush()) {
      slot->frame_index = outcome.result.frame_index;
      slot->sightings = sightings;
      frames_.CommitPush();
    }
  }
  newest_frame_.store(outcome.result.frame_index, std::memory_order_release);
}

void MarkLog::BetweenMapSteps() {
  const std::int64_t newest = newest_frame_.load(std::memory_order_acquire);
  for (; next_request_ < requests_.size(); ++next_request_) {
    MarkRequest request = requests_[next_request_];
    request.frame_index = *part_.IndexOf(request.frame_index);
    if (request.frame_index > newest) break;
    if (part_.halve) request.pixel = {HalvedPixel(request.pixel.x()), HalvedPixel(request.pixel.y())};
    const Result<MarkId> id = engine_.SetMark(request);
    if (!id.ok()) refused_.push_back({requests_[next_request_], id.status().message()});
  }
  for (const SeenFrame* frame = frames_.Front(); frame != nullptr; frame = frames_.Front()) {
    for (const MarkSighting& sighting : frame->sightings) rows_.push_back({frame->frame_index, sighting});
    frames_.Pop();
  }
}

void MarkLog::Finish() {
  BetweenMapSteps();
  for (; next_request_ < requests_.size(); ++next_request_) {
    refused_.push_back({requests_[next_request_], "the run ended before its frame came"});
  }
}

}  // namespace haustra
