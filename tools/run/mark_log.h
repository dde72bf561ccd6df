// Sets the marks that a run was given, each in its frame, and remembers where all marks were seen. The same in
// sequential and in real-time mode.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "capture/sequence_options.h"
#include "engine/engine.h"
#include "hal/core/spsc_ring.h"
#include "platform/session/session.h"

namespace haustra {

class MarkLog final : public SessionHooks {
 public:
  struct Row {
    std::uint32_t frame_index = 0;
    MarkSighting sighting;
  };
  struct Refused {
    MarkRequest request;  // as it was given
    std::string reason;
  };

  // `requests` in the order of their frames; frames and pixels are those of the recording, of which `part` is read. The
  // engine outlives it.
  MarkLog(Engine& engine, const std::vector<MarkRequest>& requests, const SequenceOptions& part);

  // Tracking thread: a frame whose marks find no room in the ring is missing in the log, and counted.
  void OnTracked(const FrameOutcome& outcome) override;
  // Mapping thread.
  void BetweenMapSteps() override;

  // From here on when the session has ended. Marks whose frames never came are refused.
  void Finish();
  const std::vector<Row>& rows() const { return rows_; }
  const std::vector<Refused>& refused() const { return refused_; }
  std::uint64_t num_frames_missing() const { return frames_.num_dropped(); }

 private:
  struct SeenFrame {
    std::uint32_t frame_index = 0;
    MarkSightings sightings;
  };

  Engine& engine_;
  SequenceOptions part_;
  std::vector<MarkRequest> requests_;  // whose frames are read
  std::size_t next_request_ = 0;
  SpscRing<SeenFrame> frames_;                  // tracking to mapping
  std::atomic<std::int64_t> newest_frame_{-1};  // that was tracked
  std::vector<Row> rows_;
  std::vector<Refused> refused_;
};

}  // namespace haustra
