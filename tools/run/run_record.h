// Everything that is remembered of a run: the answer to every frame and what happened to the maps. thread-bound(main).
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "platform/session/session.h"

namespace haustra {

struct RunEvent {
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  std::string event;
  std::int64_t map_id = -1;        // -1: none
  std::int64_t other_map_id = -1;  // -1: none
  std::string details;
  KeyframeId other_keyframe = kNoId;  // that looks alike, of a merge, a loop or a rejected candidate
};

class RunRecord : public SessionObserver {
 public:
  // `on_progress` (may be empty) is called after every frame.
  // `thread_watch`: see SessionObserver; null: the tracking thread's use of the heap is not counted.
  explicit RunRecord(std::function<void(const RunRecord&)> on_progress, const ThreadWatch* thread_watch = nullptr)
      : on_progress_(std::move(on_progress)), thread_watch_(thread_watch) {}

  // Room for what so many frames and their keyframes leave, taken now and not in the middle of the run. What a damaged
  // container says of its length may be anything: for half a day at most.
  void ExpectFrames(std::size_t num_frames) {
    constexpr std::size_t kMostFrames = std::size_t{1} << 20;
    frames_.reserve(std::min(num_frames, kMostFrames));
    mapping_times_.reserve(std::min(num_frames, kMostFrames));
  }

  void OnStart(const RealTimeReport& report) override;
  void OnFrame(const FrameOutcome& outcome) override;
  void OnMapEvent(const MapEvent& event) override;
  void OnLatePose(const LatePose& pose) override;
  void OnMapped(const MappingTimes& times) override { mapping_times_.push_back(times); }
  void OnDamagedFrame(std::uint32_t frame_index, const std::string& message) override;
  const ThreadWatch* thread_watch() const override { return thread_watch_; }

  const std::vector<FrameOutcome>& frames() const { return frames_; }
  const std::vector<RunEvent>& events() const { return events_; }
  const std::vector<MappingTimes>& mapping_times() const { return mapping_times_; }
  // What the system granted to a real-time session; null in sequential mode.
  const RealTimeReport* realtime() const { return realtime_ ? &*realtime_ : nullptr; }
  std::size_t num_late() const { return num_late_; }
  // Frames on each rung of the ladder.
  const std::array<std::size_t, kNumRungs>& num_on_rung() const { return num_on_rung_; }
  std::size_t num_tracked() const { return num_tracked_; }
  std::size_t num_dropped() const { return num_dropped_; }
  std::size_t num_damaged() const { return num_damaged_; }
  std::size_t num_one_field() const { return num_one_field_; }
  std::size_t num_losses() const { return num_losses_; }
  std::size_t num_relocalisations() const { return num_relocalisations_; }

 private:
  std::function<void(const RunRecord&)> on_progress_;
  const ThreadWatch* thread_watch_;
  std::vector<FrameOutcome> frames_;
  std::vector<RunEvent> events_;
  std::vector<MappingTimes> mapping_times_;
  std::optional<RealTimeReport> realtime_;
  std::size_t num_late_ = 0;
  std::array<std::size_t, kNumRungs> num_on_rung_{};
  std::size_t num_tracked_ = 0;
  std::size_t num_dropped_ = 0;
  std::size_t num_damaged_ = 0;
  std::size_t num_one_field_ = 0;
  std::size_t num_losses_ = 0;
  std::size_t num_relocalisations_ = 0;
  bool was_tracking_ = false;
  MapId last_map_ = kNoId;
};

}  // namespace haustra
