// Writes down every call of a session, in order. thread-bound(the session's).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "platform/session/session.h"

namespace haustra::test {

class RecordingObserver : public SessionObserver {
 public:
  void OnStart(const RealTimeReport& report) override { reports.push_back(report); }
  void OnFrame(const FrameOutcome& outcome) override {
    frames.push_back(outcome);
    calls.push_back("frame " + std::to_string(outcome.result.frame_index));
    if (on_frame) on_frame(outcome);
  }
  void OnMapEvent(const MapEvent& event) override {
    events.push_back(event);
    calls.push_back(std::string(ToString(event.kind)) + " " + std::to_string(event.frame_index));
  }
  void OnLatePose(const LatePose& pose) override { calls.push_back("late_pose " + std::to_string(pose.frame_index)); }
  void OnMapped(const MappingTimes& times) override { mapped.push_back(times); }
  void OnDamagedFrame(std::uint32_t frame_index, const std::string& message) override {
    calls.push_back("damaged " + std::to_string(frame_index) + " " + message);
  }

  std::function<void(const FrameOutcome&)> on_frame;  // may be empty
  std::vector<FrameOutcome> frames;
  std::vector<MapEvent> events;
  std::vector<MappingTimes> mapped;
  std::vector<RealTimeReport> reports;
  std::vector<std::string> calls;
};

}  // namespace haustra::test
