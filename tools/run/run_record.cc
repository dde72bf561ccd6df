#include "tools/run/run_record.h"

#include <cstdio>
#include <string_view>

#include "tools/command/console.h"

namespace haustra {
namespace {

constexpr std::string_view kDamagedEvent = "frame_damaged";

}  // namespace

// Where people look for it, before the first frame; it is in the summary, too.
void RunRecord::OnStart(const RealTimeReport& report) {
  realtime_ = report;
  if (!console::IsQuiet()) std::fprintf(stderr, "%s", ToText(report).c_str());
  for (const std::string& refusal : Refusals(report)) console::Warn("run", "%s", refusal.c_str());
}

void RunRecord::OnFrame(const FrameOutcome& outcome) {
  frames_.push_back(outcome);
  const FrameResult& result = outcome.result;
  if (!outcome.is_dropped && !outcome.is_damaged) ++num_on_rung_[static_cast<std::size_t>(result.rung)];
  num_late_ += outcome.is_late;
  num_one_field_ += outcome.shows_one_field;
  if (outcome.is_dropped) {
    ++num_dropped_;
  } else if (outcome.is_damaged) {
    ++num_damaged_;
    for (auto event = events_.rbegin(); event != events_.rend(); ++event) {
      if (event->event != kDamagedEvent || event->frame_index != result.frame_index) continue;
      event->timestamp = result.timestamp;
      break;
    }
  } else if (result.state == TrackingState::kTracking) {
    ++num_tracked_;
    if (result.reason == TrackingReason::kRelocalised) {
      ++num_relocalisations_;
      events_.push_back({result.frame_index, result.timestamp, "relocalised", result.map_id, -1,
                         std::to_string(result.num_inliers) + " inliers"});
    }
    was_tracking_ = true;
    last_map_ = result.map_id;
  } else if (was_tracking_) {
    was_tracking_ = false;
    ++num_losses_;
    events_.push_back(
        {result.frame_index, result.timestamp, "lost", last_map_, -1, std::string(ToString(result.reason))});
  }
  if (on_progress_) on_progress_(*this);
}

namespace {

std::string Describe(const RelocalisationCounts& found) {
  std::string text(ToString(found.verdict));
  const std::pair<const char*, int> counts[] = {{"keyframe", static_cast<int>(found.keyframe)},
                                                {"votes", found.num_votes},
                                                {"matches", found.num_matches},
                                                {"ransac_inliers", found.num_ransac_inliers},
                                                {"agreeing", found.num_agreeing},
                                                {"guided", found.num_guided},
                                                {"inliers", found.num_inliers}};
  for (const auto& [name, count] : counts) text += " " + std::string(name) + "=" + std::to_string(count);
  return text;
}

std::string Describe(const MapEvent& event) {
  if (event.kind == MapEventKind::kFrameFound || event.kind == MapEventKind::kFrameNotFound) {
    return Describe(event.relocalisation);
  }
  if (event.kind != MapEventKind::kMerged && event.kind != MapEventKind::kLoopClosed &&
      event.kind != MapEventKind::kMergeRejected) {
    return std::to_string(event.num_keyframes) + " keyframes " + std::to_string(event.num_points) + " points";
  }
  const CommonAreaCounts& place = event.place;
  std::string text(ToString(place.verdict));
  const std::pair<const char*, int> counts[] = {{"keyframe", static_cast<int>(place.keyframe_a)},
                                                {"other_keyframe", static_cast<int>(place.keyframe_b)},
                                                {"votes", place.num_votes},
                                                {"matches", place.num_matches},
                                                {"one", place.num_one},
                                                {"ransac_inliers", place.num_ransac_inliers},
                                                {"guided", place.num_guided},
                                                {"inliers", place.num_inliers},
                                                {"visible", place.num_visible},
                                                {"confirming", place.num_confirming}};
  for (const auto& [name, count] : counts) text += " " + std::string(name) + "=" + std::to_string(count);
  return text;
}

}  // namespace

void RunRecord::OnMapEvent(const MapEvent& event) {
  const bool is_about_frame = event.kind == MapEventKind::kFrameFound || event.kind == MapEventKind::kFrameNotFound;
  events_.push_back({event.frame_index, event.timestamp, std::string(ToString(event.kind)),
                     event.map_id == kNoId ? -1 : static_cast<std::int64_t>(event.map_id),
                     event.other_map_id == kNoId ? -1 : static_cast<std::int64_t>(event.other_map_id), Describe(event),
                     is_about_frame ? event.relocalisation.keyframe : event.place.keyframe_b});
}

void RunRecord::OnLatePose(const LatePose& pose) {
  // The frame is one of the last few.
  for (auto frame = frames_.rbegin(); frame != frames_.rend(); ++frame) {
    if (frame->result.frame_index != pose.frame_index) continue;
    frame->result.reference_keyframe = pose.reference_keyframe;
    frame->result.cam_from_reference = pose.cam_from_reference;
    frame->result.reference_scale = pose.reference_scale;
    frame->result.num_inliers = pose.num_inliers;
    return;
  }
}

void RunRecord::OnDamagedFrame(std::uint32_t frame_index, const std::string& message) {
  events_.push_back({frame_index, TimePoint{}, std::string(kDamagedEvent), -1, -1, message});
}

}  // namespace haustra
