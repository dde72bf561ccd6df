#include "platform/daemon/procedure.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "platform/assemble.h"
#include "platform/daemon/log.h"
#include "platform/daemon/no_dumps.h"
#include "platform/memory_plan.h"
#include "platform/publish/published_records.h"
#include "platform/session/warm_up.h"
#include "platform/vocabulary_loader.h"

namespace haustra {
namespace {

constexpr Duration kPictureInterval = std::chrono::milliseconds(100);
// All are counted; of a camera that sends nothing else a line a second is enough.
constexpr Duration kDamageLogInterval = std::chrono::seconds(1);
// Orders that may wait: a person clicks fewer, a program that does not wait for the answers is refused the rest.
constexpr std::size_t kMaxMarkOrders = 16;
// A checkpoint and what people ask for. A stop does those that wait, each a second at most, and has its limit.
constexpr std::size_t kMaxSaveRequests = 4;

// Grows with everything that changes a map.
std::uint64_t NumChanges(const MapperCounters& counters) {
  return counters.num_keyframes + counters.num_keyframes_culled + counters.num_reframings + counters.num_marks_set +
         counters.num_marks_removed;
}

}  // namespace

Result<std::unique_ptr<Procedure>> Procedure::Prepare(const DaemonConfig& config, std::unique_ptr<FrameSource> source,
                                                      const Context& context) {
  std::unique_ptr<Procedure> procedure(new Procedure(config, context));
  procedure->source_ = std::make_unique<SupervisedSource>(std::move(source), context.clock);
  const CameraCalibration& calibration = procedure->source_->calibration();
  const ImageView mask = procedure->source_->static_mask();
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(calibration));
  HAUSTRA_ASSIGN(MemoryPlan plan,
                 PlanMemory(config.engine, calibration, config.vision.device,
                            NumVisionThreads(config.vision.threads, config.engine, Engine::Mode::kRealTime)));
  plan.Add(MemoryPlace::kHost, "published snapshot", 1,
           sizeof(haustra_snapshot) + config.engine.memory.max_map_points * sizeof(haustra_point),
           "memory.max_map_points");
  if (context.view != nullptr) {
    plan.Add(MemoryPlace::kHost, "published view", 1,
             sizeof(haustra_view_file) + sizeof(haustra_picture) +
                 HAUSTRA_MATCHES_POINTS * (sizeof(Eigen::Vector2f) + sizeof(haustra_match)),
             "publish.view");
    procedure->source_->SetWitness([&made = *procedure](const Frame& frame) { made.PublishPicture(frame); });
  }
  if (context.depth != nullptr) {
    const int max_keyframes = config.engine.memory.max_keyframes;
    if (static_cast<int>(context.depth->num_slots()) < max_keyframes) {
      return Internal("the depth table was made for fewer keyframes");
    }
    plan.Add(MemoryPlace::kHost, "published depth", 1,
             haustra_depth_file_bytes(context.depth->num_slots()) + DepthPublisher::BytesFor(max_keyframes),
             "publish.depth, memory.max_keyframes");
    procedure->depth_publisher_.emplace(*context.depth, calibration, mask, config.engine.depth.step_px, max_keyframes);
  }
  HAUSTRA_TRY(CheckMemory(plan, config.engine, AvailableHostMemory()));
  HAUSTRA_ASSIGN(procedure->device_, context.make_device(config, calibration));
  HAUSTRA_TRY(procedure->device_->SetStaticMask(mask));
  // The device itself: what the first request takes is no silence.
  HAUSTRA_TRY(WarmUp(*procedure->device_, *procedure->source_).status());
  procedure->watched_ = std::make_unique<WatchedVisionDevice>(*procedure->device_, context.clock,
                                                              std::chrono::milliseconds(config.vision.answer_limit_ms));
  HAUSTRA_ASSIGN(procedure->vocabulary_, LoadVocabularyFor(config.engine));
  HAUSTRA_ASSIGN(procedure->depth_, CreateDepthSearch(config.vision.device, config.engine, camera, mask));
  procedure->engine_ =
      std::make_unique<Engine>(config.engine, camera, *procedure->watched_, Engine::Mode::kRealTime, &context.clock,
                               mask, procedure->vocabulary_.get(), procedure->depth_.matcher.get());
  LeaveMemoryOutOfDumps();
  return procedure;
}

Procedure::Procedure(const DaemonConfig& config, const Context& context)
    : config_(config), context_(context), snapshot_(std::make_unique<haustra_snapshot>()) {
  snapshot_points_.reserve(static_cast<std::size_t>(config.engine.memory.max_map_points));
  if (context.view != nullptr) {
    matched_pixels_.resize(HAUSTRA_MATCHES_POINTS);
    matches_.resize(HAUSTRA_MATCHES_POINTS);
  }
}

Procedure::~Procedure() {
  Stop();
  if (thread_.joinable()) thread_.join();
}

void Procedure::Start(std::uint64_t number) {
  number_ = number;
  if (depth_publisher_) depth_publisher_->Begin(number);
  source_->Begin();
  const TimePoint now = context_.clock.Now();
  tracking_beat_.Beat(now);
  mapping_beat_.Beat(now);
  merging_beat_.Beat(now);
  thread_ = std::thread([this] {
    Run();
    context_.wake();
  });
}

void Procedure::Run() {
  RealTimeOptions options;
  options.rate = config_.source.rate;
  options.rt = config_.engine.rt;
  options.heartbeat = &tracking_beat_;
  options.capture_heartbeat = &capture_beat_;
  options.hooks = this;
  options.device = watched_.get();
  const Result<SessionSummary> summary = RunRealTime(*source_, *engine_, context_.clock, options, *this, stop_);
  OnMapsAtRest();  // also of a session that did not begin
  if (summary.ok() && summary->heap_growth_bytes > 0) {
    Log(LogLevel::kWarning, "heap_grew",
        {{"bytes", std::to_string(summary->heap_growth_bytes)}, {"beyond", "rt.heap_prefault_mb"}});
  }
  if (!stop_.load()) {
    const std::lock_guard lock(mutex_);
    ended_ = summary.ok() ? Internal("the session ended by itself") : summary.status();
  }
}

void Procedure::RequestStop() {
  stop_.store(true);
  source_->RequestStop();
}

void Procedure::Stop() {
  if (!thread_.joinable()) return;
  RequestStop();
  is_at_rest_.wait(false);
  // Nobody else is left to take them.
  DoOrders();
  while (ServeSave()) {
  }
}

std::optional<Status> Procedure::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

SignsOfLife Procedure::signs() const {
  const TimePoint now = context_.clock.Now();
  const Duration work_limit = context_.settings.work_limit;
  const TimePoint tracking = SignOfThread(tracking_beat_, now, work_limit);
  const TimePoint answer = SignOfThread(source_->answers(), now, work_limit);
  const TimePoint capture =
      SignOfCapture(std::max(answer, capture_beat_.last()), source_->recovering_since(), now, work_limit);
  return {tracking, capture, mapping_beat_.last(), merging_beat_.last()};
}

ProcedureCounts Procedure::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void Procedure::Save(std::unique_ptr<DescriptorSink> sink, Saved saved) {
  SaveRequest request{std::move(sink), std::move(saved)};
  if (!thread_.joinable() || is_at_rest_) return WriteMaps(std::move(request));
  {
    const std::lock_guard lock(mutex_);
    if (save_requests_.size() < kMaxSaveRequests) {
      save_requests_.push_back(std::move(request));
      return;
    }
  }
  request.saved(Unavailable("too many saves wait"));
}

bool Procedure::ServeSave() {
  std::optional<SaveRequest> request;
  {
    const std::lock_guard lock(mutex_);
    if (save_requests_.empty()) return false;
    request = std::move(save_requests_.front());
    save_requests_.pop_front();
  }
  WriteMaps(std::move(*request));
  return true;
}

void Procedure::Order(MarkOrder order) {
  if (thread_.joinable() && !is_at_rest_) {
    const std::lock_guard lock(mutex_);
    if (mark_orders_.size() < kMaxMarkOrders) {
      mark_orders_.push_back(std::move(order));
      return;
    }
    order.done(Unavailable("too many requests wait"));
    return;
  }
  order.done(DoMarkOrder(order, *engine_));
}

void Procedure::DoOrders() {
  std::vector<MarkOrder> orders;
  {
    const std::lock_guard lock(mutex_);
    orders.swap(mark_orders_);
  }
  for (const MarkOrder& order : orders) order.done(DoMarkOrder(order, *engine_));
}

void Procedure::OnMapsAtRest() {
  is_at_rest_.store(true);
  is_at_rest_.notify_all();
}

// Mapping thread, or when that has ended the thread that stopped it. The mapper waits only until the bytes are handed
// to the system; that they are on the disk is the supervisor's business.
void Procedure::WriteMaps(SaveRequest request) {
  const TimePoint begin = context_.clock.Now();
  Status status = engine_->SaveAtlas(*request.sink);
  if (status.ok()) status = request.sink->Finish();
  request.sink.reset();
  {
    const std::lock_guard lock(mutex_);
    counts_.checkpoint_pause = context_.clock.Now() - begin;
  }
  request.saved(status);
}

void Procedure::OnTracked(const FrameOutcome& outcome) {
  if (stop_.load(std::memory_order_relaxed)) return;
  context_.ring.PublishPose(
      PoseRecord(outcome.result, engine_->mark_sightings(), outcome.due, context_.clock.Now(), number_));
  if (context_.view != nullptr) PublishMatches(outcome.result);
}

void Procedure::PublishMatches(const FrameResult& result) {
  const std::size_t count = engine_->MatchedPixels(matched_pixels_);
  for (std::size_t i = 0; i < count; ++i) matches_[i] = {matched_pixels_[i].x(), matched_pixels_[i].y()};
  context_.view->PublishMatches(result.frame_index, number_, {matches_.data(), count},
                                count > 0 ? static_cast<std::uint32_t>(result.num_inliers) : 0);
}

// A fraction of a millisecond, ten times a second, when tracking has the frame: in the time until the next one.
void Procedure::PublishPicture(const Frame& frame) {
  const TimePoint now = context_.clock.Now();
  if (now < next_picture_ || stop_.load(std::memory_order_relaxed)) return;
  next_picture_ = now + kPictureInterval;
  context_.view->PublishPicture(frame, number_);
}

void Procedure::BetweenMapSteps() {
  const TimePoint now = context_.clock.Now();
  mapping_beat_.Beat(now);
  if (!engine_->is_merging()) merging_beat_.Beat(now);
  // Stop() serves what is asked from now on.
  if (stop_.load(std::memory_order_relaxed)) return;
  DoOrders();
  const std::uint64_t changes = NumChanges(engine_->mapper_counters());
  num_changes_.store(changes, std::memory_order_relaxed);
  if (now >= next_snapshot_ && changes != published_changes_) {
    published_changes_ = changes;
    next_snapshot_ = now + context_.settings.snapshot_interval.load();
    PublishSnapshot(now);
  }
  if (engine_->depths() != nullptr) CountDepths(*engine_->depths());
  if (depth_publisher_ && now >= next_depths_) PublishDepths(now);
  ServeSave();
}

void Procedure::PublishSnapshot(TimePoint now) {
  FillSnapshot(*engine_, now, number_, &snapshot_points_, snapshot_.get());
  context_.ring.PublishSnapshot(*snapshot_);
  const std::lock_guard lock(mutex_);
  counts_.maps = snapshot_->num_maps;
  counts_.keyframes = static_cast<std::uint32_t>(engine_->atlas().keyframes().size());
  counts_.points = static_cast<std::uint32_t>(engine_->atlas().points().size());
}

// All keyframes are looked at: only when there may be another depth, or one less.
void Procedure::CountDepths(const DepthKeeper& depths) {
  const DepthCounters& counters = depths.counters();
  const std::uint64_t late = counters.num_late + engine_->num_pictures_refused();
  const std::uint64_t changes = num_changes_.load(std::memory_order_relaxed) + counters.num_depths +
                                counters.num_too_little + counters.num_in_vain + late;
  if (changes == counted_changes_) return;
  counted_changes_ = changes;
  const std::uint32_t num_keyframes = depths.num_keyframes();
  const std::lock_guard lock(mutex_);
  counts_.keyframes_with_depth = num_keyframes;
  counts_.depths_found = counters.num_depths;
  counts_.depths_late = late;
  counts_.depths_too_little = counters.num_too_little;
  counts_.depths_in_vain = counters.num_in_vain;
}

// What had to wait comes in the next step.
void Procedure::PublishDepths(TimePoint now) {
  if (!depth_publisher_->Publish(*engine_)) next_depths_ = now + context_.settings.snapshot_interval.load();
}

// What the system refused of the real-time settings, once a procedure. The session has taken its memory: pictures lie
// in it.
void Procedure::OnStart(const RealTimeReport& report) {
  LeaveMemoryOutOfDumps();
  for (const std::string& refusal : Refusals(report)) Log(LogLevel::kWarning, "realtime_refused", {{"what", refusal}});
}

void Procedure::OnFrame(const FrameOutcome& outcome) {
  const std::lock_guard lock(mutex_);
  if (outcome.is_dropped || outcome.is_damaged) {
    ++(outcome.is_dropped ? counts_.frames_dropped : counts_.frames_damaged);
    return;
  }
  ++counts_.frames[std::min<std::size_t>(static_cast<std::size_t>(outcome.result.state), kNumStates - 1)];
  ++counts_.reasons[std::min<std::size_t>(static_cast<std::size_t>(outcome.result.reason), kNumReasons - 1)];
  const double latency_s = ToSeconds(outcome.latency);
  const auto bucket = std::lower_bound(kLatencyBounds_s.begin(), kLatencyBounds_s.end(), latency_s);
  ++counts_.latency_buckets[static_cast<std::size_t>(bucket - kLatencyBounds_s.begin())];
  counts_.latency_sum_s += latency_s;
  counts_.has_frame = 1;
  counts_.last_frame_index = outcome.result.frame_index;
  counts_.last_state = outcome.result.state;
  counts_.last_reason = outcome.result.reason;
  counts_.last_map_id = outcome.result.map_id;
  counts_.last_latency = outcome.latency;
}

void Procedure::OnMapEvent(const MapEvent& event) {
  context_.ring.PublishEvent(EventRecord(event, context_.clock.Now(), number_));
  Log(event.kind == MapEventKind::kFrameNotFound || event.kind == MapEventKind::kMergeRejected ? LogLevel::kDebug
                                                                                               : LogLevel::kInfo,
      ToString(event.kind),
      {{"map", std::to_string(event.map_id)},
       {"frame", std::to_string(event.frame_index)},
       {"keyframes", std::to_string(event.num_keyframes)}});
  const std::lock_guard lock(mutex_);
  ++counts_.events[std::min<std::size_t>(static_cast<std::size_t>(event.kind), kNumEventKinds - 1)];
}

void Procedure::OnDamagedFrame(std::uint32_t frame_index, const std::string& message) {
  const TimePoint now = context_.clock.Now();
  if (now < next_damage_log_) {
    ++num_damage_not_logged_;
    return;
  }
  next_damage_log_ = now + kDamageLogInterval;
  const std::string num_more = std::to_string(std::exchange(num_damage_not_logged_, 0));
  Log(LogLevel::kWarning, "frame_damaged",
      {{"frame", std::to_string(frame_index)}, {"what", message}, {"more_before", num_more}});
}

}  // namespace haustra
