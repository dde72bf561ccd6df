// One procedure: an engine with its device and source, and the threads that run them. Made empty, with all its memory
// taken, before the tower says begin. It is a worker's (worker.h), and goes with that process: nothing of one patient
// can reach the next.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "engine/engine.h"
#include "hal/clock.h"
#include "platform/assemble.h"
#include "platform/daemon/daemon_config.h"
#include "platform/daemon/descriptor_sink.h"
#include "platform/daemon/health.h"
#include "platform/daemon/mark_order.h"
#include "platform/daemon/procedure_counts.h"
#include "platform/daemon/supervised_source.h"
#include "platform/publish/depth_publisher.h"
#include "platform/publish/depth_table_writer.h"
#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/view_ring_writer.h"
#include "platform/session/session.h"

namespace haustra {

using MakeVisionDevice =
    std::function<Result<std::unique_ptr<VisionDevice>>(const DaemonConfig&, const CameraCalibration&)>;

// What a reload changes while a procedure runs. thread-safe.
struct LiveSettings {
  std::atomic<Duration> snapshot_interval{std::chrono::milliseconds(PublishConfig().snapshot_interval_ms)};
  std::atomic<Duration> work_limit{std::chrono::milliseconds(WatchdogConfig().work_limit_ms)};
};

// Everything but what is marked is thread-bound(one thread of the worker).
class Procedure final : private SessionObserver, private SessionHooks {
 public:
  // What it works with; all outlive it.
  struct Context {
    const Clock& clock;
    const LiveSettings& settings;
    PoseRingWriter& ring;
    ViewRingWriter* view;     // may be null
    DepthTableWriter* depth;  // may be null
    MakeVisionDevice make_device;
    std::function<void()> wake;  // something has come to an end: look again. Called on any thread.
  };

  // Takes all memory, if its plan fits (CheckMemory). Errors: those of the source, the camera model, the device, the
  // vocabulary.
  static Result<std::unique_ptr<Procedure>> Prepare(const DaemonConfig& config, std::unique_ptr<FrameSource> source,
                                                    const Context& context);
  // Stops. A driver that hangs is waited for: let the process end without.
  ~Procedure() override;

  // Before Start: the maps of a file become stored maps. Errors of Engine::LoadAtlas.
  Status Load(std::span<const std::uint8_t> file) { return engine_->LoadAtlas(file); }
  // Frames are looked at from now on; they are published under this number.
  void Start(std::uint64_t number);
  // Ends the threads; the maps stay, nothing more is published. A capture thread that is stuck in a driver is left to
  // end by itself; any other one is waited for, for ever.
  void Stop();

  using Saved = std::function<void(const Status&)>;
  // All maps, while the session runs or after it. `saved` is called on the mapping thread or this one when they are
  // handed to the system, or when that failed. One is done in each mapping step. Refused at once when too many wait
  // (kUnavailable).
  void Save(std::unique_ptr<DescriptorSink> sink, Saved saved);

  // Done while the session runs, or after it; `done` is called on the mapping thread or this one. Refused at once when
  // too many wait (kUnavailable).
  void Order(MarkOrder order);

  // From here on thread-safe.
  // Says that the threads are to end.
  void RequestStop();
  // Of the vision device. One with a fault gives no maps to save.
  WatchedVisionDevice::Fault fault() const { return watched_->fault(); }
  // What ended the session by itself; nothing while it runs or when it was stopped.
  std::optional<Status> ended() const;
  // Changes of the maps since Start. Asked in `saved`: those that are in that file.
  std::uint64_t num_changes() const { return num_changes_.load(std::memory_order_relaxed); }
  SignsOfLife signs() const;
  SignalState signal() const { return source_->signal(); }
  std::string signal_text() const { return source_->signal_text(); }
  std::optional<TimeJump> TakeTimeJump() { return source_->TakeTimeJump(); }
  ProcedureCounts counts() const;

 private:
  struct SaveRequest {
    std::unique_ptr<DescriptorSink> sink;
    Saved saved;
  };

  Procedure(const DaemonConfig& config, const Context& context);

  // Session thread.
  void Run();
  void OnStart(const RealTimeReport& report) override;
  void OnFrame(const FrameOutcome& outcome) override;
  void OnMapEvent(const MapEvent& event) override;
  void OnLatePose(const LatePose&) override {}
  void OnDamagedFrame(std::uint32_t frame_index, const std::string& message) override;
  void OnMapsAtRest() override;
  // Capture thread.
  void PublishPicture(const Frame& frame);
  // Tracking thread.
  void OnTracked(const FrameOutcome& outcome) override;
  void PublishMatches(const FrameResult& result);
  // Mapping thread.
  void BetweenMapSteps() override;
  void PublishSnapshot(TimePoint now);
  void PublishDepths(TimePoint now);
  void CountDepths(const DepthKeeper& depths);
  // Of the request that has waited longest; false: there is none.
  bool ServeSave();
  void WriteMaps(SaveRequest request);
  void DoOrders();

  DaemonConfig config_;
  Context context_;
  std::unique_ptr<SupervisedSource> source_;
  std::unique_ptr<VisionDevice> device_;
  std::unique_ptr<WatchedVisionDevice> watched_;
  std::unique_ptr<const Vocabulary> vocabulary_;
  DepthSearch depth_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<haustra_snapshot> snapshot_;
  std::optional<DepthPublisher> depth_publisher_;
  std::vector<haustra_point> snapshot_points_;
  std::vector<Eigen::Vector2f> matched_pixels_;  // workspace of the tracking thread
  std::vector<haustra_match> matches_;           // likewise
  TimePoint next_picture_;                       // capture thread
  std::uint64_t number_ = 0;

  std::thread thread_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> is_at_rest_{false};  // the threads that use the engine have ended
  Heartbeat tracking_beat_;
  Heartbeat capture_beat_;  // while a frame is not due; the source tells of the rest
  Heartbeat mapping_beat_;
  Heartbeat merging_beat_;                          // by the mapping thread, which waits for its answers
  std::atomic<std::uint64_t> num_changes_{0};       // by the mapping thread
  TimePoint next_snapshot_;                         // mapping thread
  TimePoint next_depths_;                           // mapping thread
  TimePoint next_damage_log_;                       // session thread
  std::uint64_t num_damage_not_logged_ = 0;         // likewise, since the last one
  std::optional<std::uint64_t> published_changes_;  // nothing yet: loaded maps have changed nothing
  std::uint64_t counted_changes_ = 0;               // mapping thread

  mutable std::mutex mutex_;  // never taken by the tracking thread
  ProcedureCounts counts_;
  std::deque<SaveRequest> save_requests_;
  std::vector<MarkOrder> mark_orders_;
  std::optional<Status> ended_;
};

}  // namespace haustra
