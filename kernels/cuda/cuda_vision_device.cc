#include "kernels/cuda/cuda_vision_device.h"

#include <time.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/core/percentile.h"
#include "kernels/common/feature_set_slots.h"
#include "kernels/common/lane_requests.h"
#include "kernels/common/match_acceptance.h"
#include "kernels/common/request_checks.h"
#include "kernels/cuda/cuda_memory.h"
#include "kernels/cuda/device_memory.h"
#include "kernels/cuda/extractor.h"
#include "kernels/cuda/match_kernels.h"

namespace haustra {
namespace kernels::cuda {
namespace {

constexpr int kQueueLength = CudaVisionDevice::kQueueLength;
static_assert(kQueueLength < kKnownTickets, "what is queued is known");

TimePoint Now() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return TimePoint(std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec));
}

std::size_t AlignUp(std::size_t size, std::size_t alignment) { return (size + alignment - 1) / alignment * alignment; }

// The answer of the device to one query, judged for good.
bool IsMatch(const TwoNearest& top, const MatchOptions& options) {
  const std::uint32_t state = static_cast<std::uint32_t>(top.state) & kStateMask;
  return state == kAccepted || (state == kBorderline && IsAccepted(top.best, top.second, options));
}

Match ToMatch(std::int32_t query, const TwoNearest& top) {
  return {query, top.best_idx, std::min(top.best, 1.0f), std::clamp(top.second, 0.0f, 1.0f)};
}

enum class WorkKind { kNone, kExtraction, kMatching, kGuidedMatching };

// One queued request, from Enqueue* until its results have been handed over.
struct Work {
  WorkKind kind = WorkKind::kNone;
  std::uint64_t number = 0;
  // A Wait gave up on it: unless another one comes first, the next request on the lane drops its results. The device
  // may still be at it then: its place and its feature set are free when that is done.
  bool is_overdue = false;
  // When it is done, the word has the number; the event comes later, and tells of errors. No word: nothing was
  // launched. Brute-force matching has no word: each result has the mark when it is there; of that many it is known.
  const DoneWord* done_word = nullptr;
  std::uint32_t done_number = 0;
  std::uint32_t mark = 0;
  std::int32_t num_there = 0;
  cudaEvent_t done = nullptr;
  // What the caller wants where.
  FeatureSetHandle set;
  Keypoint* keypoints = nullptr;
  std::int32_t* num_followed = nullptr;
  std::span<FollowedPoint> followed_to;
  Match* matches = nullptr;
  std::int32_t* count = nullptr;
  std::int32_t num_queries = 0;
  std::int32_t num_train = 0;
  MatchOptions options;
  // Input of matching is put together here, and copied to the device in one piece.
  std::uint8_t* input = nullptr;
  std::uint8_t* device_input = nullptr;
  TwoNearest* results = nullptr;
  TwoNearest* device_results = nullptr;
  DoneWord* own_word = nullptr;  // of guided matching
  DoneWord* device_word = nullptr;
};

// Fills the input of a request piece by piece.
class InputWriter {
 public:
  explicit InputWriter(const Work& work) : work_(work) {}

  // Room for `count` values on the host; *device: where they will be on the device.
  template <typename T>
  T* Add(std::size_t count, const T** device) {
    T* host = reinterpret_cast<T*>(work_.input + size_);
    *device = reinterpret_cast<const T*>(work_.device_input + size_);
    size_ += AlignUp(count * sizeof(T), 16);
    return host;
  }
  cudaError_t Upload(cudaStream_t stream) const {
    if (size_ == 0) return cudaSuccess;
    return cudaMemcpyAsync(work_.device_input, work_.input, size_, cudaMemcpyHostToDevice, stream);
  }

 private:
  const Work& work_;
  std::size_t size_ = 0;
};

struct LaneState {
  ~LaneState() {
    for (Work& work : queue) {
      if (work.done != nullptr) (void)cudaEventDestroy(work.done);
    }
    if (extraction.done != nullptr) (void)cudaEventDestroy(extraction.done);
    extractor.reset();
    if (stream != nullptr) (void)cudaStreamDestroy(stream);
  }

  cudaStream_t stream = nullptr;
  std::unique_ptr<Extractor> extractor;  // when the lane extracts
  LaneRequests requests;
  Work queue[kQueueLength];          // of matching; number n has its place at n % kQueueLength
  Work extraction;                   // shares the events of nobody
  std::vector<std::int32_t> owners;  // query that holds each feature, for guided matching
  MatchWork match_work;
  MatchLimits match_limits;
};

class Device final : public CudaVisionDevice, private FeatureCounts {
 public:
  Device(const VisionPlan& plan, const CudaDeviceOptions& device_options)
      : plan_(plan), max_list_(MaxList(plan)), device_options_(device_options), slots_(plan.max_feature_sets) {}

  ~Device() override {
    (void)cudaSetDevice(device_options_.device);  // for what goes after this, too
    if (utility_stream_ != nullptr) (void)cudaStreamDestroy(utility_stream_);
  }

  Status Construct(const ExtractOptions& options) {
    int num_devices = 0;
    if (const cudaError_t error = cudaGetDeviceCount(&num_devices); error != cudaSuccess || num_devices == 0) {
      return Unavailable(std::string("no CUDA device: ") +
                         cudaGetErrorString(error != cudaSuccess ? error : cudaErrorNoDevice));
    }
    if (device_options_.device < 0 || device_options_.device >= num_devices) {
      return InvalidArgument("CUDA device " + std::to_string(device_options_.device) + ": there are " +
                             std::to_string(num_devices));
    }
    HAUSTRA_TRY(Select());
    cudaDeviceProp properties{};
    HAUSTRA_TRY(ToStatus(cudaGetDeviceProperties(&properties, device_options_.device), "properties of the device"));
    name_ = "cuda-sm" + std::to_string(properties.major) + std::to_string(properties.minor);
    HAUSTRA_TRY(ToStatus(PrepareBruteForce(device_options_.dot_product, &match_limits_), "matcher"));
    match_limits_.max_blocks = std::min(match_limits_.max_blocks, kMaxMatchBlocks);

    const std::size_t num_rows = static_cast<std::size_t>(plan_.max_feature_sets) * plan_.max_features;
    if (num_rows > 0x7fffffffu) {
      return CapacityExceeded(std::to_string(plan_.max_feature_sets) + " feature sets of " +
                              std::to_string(plan_.max_features) + " features: more than 2^31");
    }
    DeviceMemory memory;
    HAUSTRA_TRY(TakeMemory(options, &memory));
    sets_ = memory.sets;
    transfer_ = memory.transfer;

    int lowest_priority = 0;
    int highest_priority = 0;
    HAUSTRA_TRY(ToStatus(cudaDeviceGetStreamPriorityRange(&lowest_priority, &highest_priority), "stream priorities"));
    // Lower numbers go first. Where there are enough, the branches of an extraction go before its main line.
    const int step = lowest_priority - highest_priority >= 3 ? 1 : 0;
    HAUSTRA_TRY(ConstructLane(Lane::kTracking, options, memory, highest_priority + step, highest_priority));
    HAUSTRA_TRY(ConstructLane(Lane::kBackground, options, memory, lowest_priority, lowest_priority - step));
    StateOf(Lane::kTracking).match_limits = match_limits_;
    StateOf(Lane::kBackground).match_limits = InBackground(match_limits_, device_options_.dot_product);
    HAUSTRA_TRY(
        ToStatus(cudaStreamCreateWithPriority(&utility_stream_, cudaStreamNonBlocking, lowest_priority), "stream"));
    return ToStatus(cudaDeviceSynchronize(), "construction");
  }

  std::string_view name() const override { return name_; }
  bool is_accelerator() const override { return true; }
  const VisionPlan& plan() const override { return plan_; }

  Status SetStaticMask(ImageView mask) override {
    HAUSTRA_TRY(Select());
    if (!mask.is_empty()) {
      if (mask.format != PixelFormat::kGrey8) return InvalidArgument("static mask must be an 8-bit grey image");
      HAUSTRA_TRY(CheckImageSize(mask, plan_, "static mask"));
    }
    mask_width_ = mask.is_empty() ? 0 : mask.width;
    mask_height_ = mask.is_empty() ? 0 : mask.height;
    for (LaneState& lane : lanes_) {
      if (lane.extractor != nullptr) HAUSTRA_TRY(RecordLoss(lane.extractor->SetStaticMask(mask)));
    }
    return Status::Ok();
  }

  Result<FeatureSetHandle> CreateFeatureSet() override {
    const FeatureSetHandle handle = slots_.Create();
    if (!handle.is_valid()) return Status(StatusCode::kCapacityExceeded);  // a message would allocate
    return handle;
  }
  bool RetainFeatureSet(FeatureSetHandle set) override { return slots_.Retain(set); }
  void ReleaseFeatureSet(FeatureSetHandle set) override { slots_.Release(set); }
  std::int32_t num_free_feature_sets() const override { return slots_.num_free(); }

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    HAUSTRA_TRY(Select());
    HAUSTRA_TRY(CheckExtractRequest(lane, request, plan_, mask_width_, mask_height_));
    LaneState& state = StateOf(lane);
    HAUSTRA_TRY(CheckPlacesToFollow(request, plan_, state.extractor->width_px(), state.extractor->height_px()));
    HAUSTRA_TRY(Settle(state));
    switch (slots_.BeginWrite(request.set)) {
      case FeatureSetSlots::WriteClaim::kGranted: break;
      case FeatureSetSlots::WriteClaim::kStale: return InvalidArgument("feature set to write: stale or invalid handle");
      case FeatureSetSlots::WriteClaim::kWrittenBefore:
        return FailedPrecondition("feature set to write was written before; a set is written once");
    }
    Status status = state.extractor->Enqueue(request.image, request.set.index, request.max_features, request.follow,
                                             request.num_only_followed);
    if (status.ok()) status = ToStatus(cudaEventRecord(state.extraction.done, state.stream), "event");
    if (!status.ok()) {
      slots_.AbandonWrite(request.set);
      return RecordLoss(status);
    }
    Work& work = state.extraction;
    // One owner more until the work is done: the caller may release the set before, and its slot must not be reused.
    (void)slots_.Retain(request.set);
    work.kind = WorkKind::kExtraction;
    work.number = state.requests.Next();
    work.done_word = state.extractor->done_word();
    work.done_number = state.extractor->number();
    work.set = request.set;
    work.keypoints = request.keypoints.data();
    work.count = request.num_keypoints;
    work.num_followed = request.num_followed;
    work.followed_to = request.followed_to;
    return LaneRequests::TicketOf(lane, work.number);
  }

  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    HAUSTRA_TRY(Select());
    LaneState& state = StateOf(lane);
    HAUSTRA_TRY(Settle(state));
    HAUSTRA_TRY(CheckMatchRequest(request, plan_, *this));
    Work* work = nullptr;
    HAUSTRA_TRY(Claim(state, WorkKind::kMatching, &work));
    work->num_queries = ListSize(request.query, *this);
    work->num_train = ListSize(request.train, *this);
    work->matches = request.matches.data();
    work->count = request.num_matches;
    work->options = request.options;
    if (work->num_queries > 0 && work->num_train > 0) {
      if (const Status status = LaunchMatch(state, request, *work); !status.ok()) {
        work->kind = WorkKind::kNone;
        return RecordLoss(status);
      }
    }
    return LaneRequests::TicketOf(lane, work->number);
  }

  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    HAUSTRA_TRY(CheckLane(lane));
    HAUSTRA_TRY(Select());
    LaneState& state = StateOf(lane);
    HAUSTRA_TRY(Settle(state));
    HAUSTRA_TRY(CheckGuidedMatchRequest(request, plan_, *this));
    Work* work = nullptr;
    HAUSTRA_TRY(Claim(state, WorkKind::kGuidedMatching, &work));
    work->num_queries = static_cast<std::int32_t>(request.queries.size());
    work->num_train = NumFeatures(request.train);
    work->matches = request.matches.data();
    work->count = request.num_matches;
    work->options = request.options;
    if (work->num_queries > 0 && work->num_train > 0) {
      if (const Status status = LaunchGuidedMatch(state, request, *work); !status.ok()) {
        work->kind = WorkKind::kNone;
        return RecordLoss(status);
      }
    }
    return LaneRequests::TicketOf(lane, work->number);
  }

  Status Wait(Ticket ticket, TimePoint deadline) override {
    LaneState& state = lanes_[LaneRequests::LaneIndexOf(ticket)];
    HAUSTRA_TRY(state.requests.Check(ticket));
    HAUSTRA_TRY(Select());
    Work* work = Find(state, ticket);
    if (work == nullptr) return Status::Ok();  // handed over before
    const Status status = WaitFor(*work, deadline);
    work->is_overdue = status.code() == StatusCode::kDeadlineExceeded;
    return status.ok() ? Finish(*work, state) : status;
  }

  bool Abandon(Ticket ticket) override {
    LaneState& state = lanes_[LaneRequests::LaneIndexOf(ticket)];
    Work* work = Find(state, ticket);
    if (work == nullptr) return true;
    // The device reads the picture where the caller has it. Of matching it has all that it needs.
    if (work->kind == WorkKind::kExtraction && !HasWord(*work)) return false;
    work->is_overdue = true;
    state.requests.Drop(work->number);
    return work->kind != WorkKind::kExtraction || Finish(*work, state).ok();
  }

  // The driver allocates for a thread when that selects a device for the first time.
  Status ServeThisThread(Lane lane) override {
    HAUSTRA_TRY(CheckLane(lane));
    return Select();
  }

  Status ReadDescriptors(FeatureSetHandle handle, std::span<std::uint8_t> out) override {
    const std::int32_t num_features = NumFeatures(handle);
    if (num_features < 0) return InvalidArgument("descriptors to read: stale or invalid feature set");
    const std::size_t num_bytes = static_cast<std::size_t>(num_features) * kDescriptorBytes;
    if (out.size() < num_bytes) {
      return InvalidArgument("room for " + std::to_string(out.size()) + " bytes of descriptors, the set has " +
                             std::to_string(num_bytes));
    }
    if (num_bytes == 0) return Status::Ok();
    HAUSTRA_TRY(Select());
    const std::lock_guard lock(utility_mutex_);
    const std::uint8_t* from =
        sets_.descriptors + static_cast<std::size_t>(handle.index) * plan_.max_features * kDescriptorBytes;
    HAUSTRA_TRY(RecordLoss(
        ToStatus(cudaMemcpyAsync(transfer_.descriptors, from, num_bytes, cudaMemcpyDeviceToHost, utility_stream_),
                 "reading descriptors")));
    HAUSTRA_TRY(RecordLoss(ToStatus(cudaStreamSynchronize(utility_stream_), "reading descriptors")));
    std::memcpy(out.data(), transfer_.descriptors, num_bytes);
    return Status::Ok();
  }

  Status WriteFeatures(FeatureSetHandle handle, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override {
    HAUSTRA_TRY(CheckFeaturesToWrite(keypoints, descriptors, plan_));
    HAUSTRA_TRY(Select());
    switch (slots_.BeginWrite(handle)) {
      case FeatureSetSlots::WriteClaim::kGranted: break;
      case FeatureSetSlots::WriteClaim::kStale: return InvalidArgument("feature set to write: stale or invalid handle");
      case FeatureSetSlots::WriteClaim::kWrittenBefore:
        return FailedPrecondition("feature set to write was written before; a set is written once");
    }
    if (const Status status = CopyFeatures(handle.index, keypoints, descriptors); !status.ok()) {
      slots_.AbandonWrite(handle);
      return RecordLoss(status);
    }
    slots_.Publish(handle, static_cast<std::int32_t>(keypoints.size()));
    return Status::Ok();
  }

  Status MeasureExtractionSteps(Lane lane, int repeats,
                                std::span<Extractor::StepTime, Extractor::kNumSteps> out) override {
    HAUSTRA_TRY(Select());
    if (StateOf(lane).extractor == nullptr) return InvalidArgument("VisionPlan::extracts_in_background is off");
    return StateOf(lane).extractor->MeasureSteps(repeats, out);
  }

  Status MeasureMatching(std::int64_t num_query, std::int64_t num_train, bool mutual, int repeats, double* median_us,
                         double* p99_us) override {
    HAUSTRA_TRY(Select());
    LaneState& state = StateOf(Lane::kBackground);
    HAUSTRA_TRY(Settle(state));
    const std::int64_t num_rows = static_cast<std::int64_t>(plan_.max_feature_sets) * plan_.max_features;
    if (num_query > max_list_ || num_query + num_train > num_rows || (mutual && num_train > max_list_)) {
      return CapacityExceeded("matching of " + std::to_string(num_query) + " and " + std::to_string(num_train) +
                              " descriptors to measure");
    }
    MatchJob job;
    job.query = {nullptr, 0, static_cast<std::int32_t>(num_query)};
    job.train = {nullptr, static_cast<std::int32_t>(num_query), static_cast<std::int32_t>(num_train)};
    job.options.mutual = mutual;
    job.options.max_angle_ratio = 0.85f;
    Work* work = nullptr;
    HAUSTRA_TRY(Claim(state, WorkKind::kMatching, &work));
    work->kind = WorkKind::kNone;
    job.results = work->device_results;
    job.mark = work->mark;
    cudaEvent_t begin = nullptr;
    cudaEvent_t end = nullptr;
    cudaError_t error = cudaEventCreate(&begin);
    if (error == cudaSuccess) error = cudaEventCreate(&end);
    // Many launches between two events, which take microseconds themselves; as a graph, or the host would be measured.
    constexpr int kLaunches = 20;
    cudaGraph_t graph = nullptr;
    cudaGraphExec_t executable = nullptr;
    if (error == cudaSuccess) error = cudaStreamBeginCapture(state.stream, cudaStreamCaptureModeThreadLocal);
    if (error == cudaSuccess) {
      for (int k = 0; k < kLaunches && error == cudaSuccess; ++k) {
        error =
            LaunchBruteForce(job, sets_, state.match_work, device_options_.dot_product, match_limits_, state.stream);
      }
      const cudaError_t end_error = cudaStreamEndCapture(state.stream, &graph);
      if (error == cudaSuccess) error = end_error;
    }
    if (error == cudaSuccess) error = cudaGraphInstantiate(&executable, graph, 0);
    std::vector<float> times;
    for (int i = 0; i < repeats + 5 && error == cudaSuccess; ++i) {
      error = cudaEventRecord(begin, state.stream);
      if (error == cudaSuccess) error = cudaGraphLaunch(executable, state.stream);
      if (error == cudaSuccess) error = cudaEventRecord(end, state.stream);
      if (error == cudaSuccess) error = cudaEventSynchronize(end);
      float ms = 0.0f;
      if (error == cudaSuccess) error = cudaEventElapsedTime(&ms, begin, end);
      if (i >= 5) times.push_back(1e3f * ms / kLaunches);
    }
    if (executable != nullptr) (void)cudaGraphExecDestroy(executable);
    if (graph != nullptr) (void)cudaGraphDestroy(graph);
    if (begin != nullptr) (void)cudaEventDestroy(begin);
    if (end != nullptr) (void)cudaEventDestroy(end);
    HAUSTRA_TRY(RecordLoss(ToStatus(error, "measurement of matching")));
    std::sort(times.begin(), times.end());
    const std::span<const float> sorted(times);
    *median_us = Percentile(sorted, 500);
    *p99_us = Percentile(sorted, 990);
    return Status::Ok();
  }

  Status MeasureLimits(DeviceLimits* limits) override {
    HAUSTRA_TRY(Select());
    return RecordLoss(ToStatus(MeasureDeviceLimits(limits), "measurement of the device's limits"));
  }

 private:
  std::int32_t NumFeatures(FeatureSetHandle set) const override { return slots_.NumFeatures(set); }

  // Both blocks, dealt out to the last byte of the plan.
  Status TakeMemory(const ExtractOptions& options, DeviceMemory* memory) {
    HAUSTRA_ASSIGN(const MemoryPlan plan, PlanCudaVisionDevice(plan_, options));
    const std::size_t num_device_bytes = plan.bytes(MemoryPlace::kDevice);
    const std::size_t num_pinned_bytes = plan.bytes(MemoryPlace::kHostPinned);
    if (const Status status = device_block_.Allocate(num_device_bytes); !status.ok()) {
      // What is free says which line is too much. On its own it refuses nothing: it counts what a system could reclaim.
      std::size_t num_free_bytes = 0;
      std::size_t num_bytes = 0;
      if (status.code() == StatusCode::kCapacityExceeded &&
          cudaMemGetInfo(&num_free_bytes, &num_bytes) == cudaSuccess) {
        const double free_mb = static_cast<double>(num_free_bytes) / 1e6;
        HAUSTRA_TRY(CheckFits(plan, {0.0, free_mb, "", "this device's free memory"}));
      }
      return status;
    }
    HAUSTRA_TRY(pinned_block_.Allocate(num_pinned_bytes));
    MemoryDealers dealers = {{device_block_.data(), num_device_bytes},
                             {pinned_block_.data(), num_pinned_bytes},
                             {pinned_block_.device_data(), num_pinned_bytes}};
    *memory = DealDeviceMemory(plan_, options, &dealers);
    const std::size_t num_device_used = dealers.device.used_bytes();
    const std::size_t num_pinned_used = dealers.pinned.used_bytes();
    if (num_device_used == num_device_bytes && num_pinned_used == num_pinned_bytes) return Status::Ok();
    return Internal("memory of the CUDA device: " + std::to_string(num_device_used) + " bytes and " +
                    std::to_string(num_pinned_used) + " pinned ones are used, planned were " +
                    std::to_string(num_device_bytes) + " and " + std::to_string(num_pinned_bytes));
  }

  Status ConstructLane(Lane which, const ExtractOptions& options, const DeviceMemory& memory, int priority,
                       int branch_priority) {
    LaneState& lane = StateOf(which);
    const ExtractMemory& extraction = memory.extraction[static_cast<int>(which)];
    const MatchMemory& matching = memory.matching[static_cast<int>(which)];
    HAUSTRA_TRY(ToStatus(cudaStreamCreateWithPriority(&lane.stream, cudaStreamNonBlocking, priority), "stream"));
    if (Extracts(which, plan_)) {
      HAUSTRA_ASSIGN(lane.extractor,
                     Extractor::Create(plan_, options, extraction, sets_, lane.stream, branch_priority));
    }
    lane.match_work = matching.work;
    for (int i = 0; i < kQueueLength; ++i) {
      Work& work = lane.queue[i];
      work.input = matching.input + i * matching.input_bytes;
      work.device_input = matching.device_input + i * matching.input_bytes;
      work.results = matching.results.host + static_cast<std::size_t>(i) * max_list_;
      work.device_results = matching.results.device + static_cast<std::size_t>(i) * max_list_;
      work.own_word = matching.words.host + i;
      work.device_word = matching.words.device + i;
      HAUSTRA_TRY(ToStatus(cudaEventCreateWithFlags(&work.done, cudaEventDisableTiming), "event"));
    }
    HAUSTRA_TRY(ToStatus(cudaEventCreateWithFlags(&lane.extraction.done, cudaEventDisableTiming), "event"));
    lane.owners.resize(plan_.max_features);
    return Status::Ok();
  }

  LaneState& StateOf(Lane lane) { return lanes_[static_cast<int>(lane)]; }
  // The request that is queued under the ticket; null: there is none any more.
  static Work* Find(LaneState& lane, Ticket ticket) {
    const std::uint64_t number = LaneRequests::NumberOf(ticket);
    for (Work* work : {&lane.extraction, &lane.queue[number % kQueueLength]}) {
      if (work->kind != WorkKind::kNone && work->number == number) return work;
    }
    return nullptr;
  }

  // Makes the device current for the calling thread; refuses when it was lost.
  Status Select() {
    if (is_lost_.load(std::memory_order_relaxed)) return Status(StatusCode::kUnavailable);  // a message would allocate
    return RecordLoss(ToStatus(cudaSetDevice(device_options_.device), "selection of the device"));
  }

  // Remembers when the device is gone.
  Status RecordLoss(Status status) {
    if (status.code() == StatusCode::kUnavailable) is_lost_.store(true, std::memory_order_relaxed);
    return status;
  }

  // Makes the lane free for another request: drops what waits have left, and has the extraction done.
  Status Settle(LaneState& lane) {
    for (const Work& work : lane.queue) {
      if (work.kind != WorkKind::kNone && work.is_overdue) lane.requests.Drop(work.number);
    }
    return Finish(lane.extraction, lane);
  }

  // The next place of the queue, after whoever had it has been served.
  Status Claim(LaneState& lane, WorkKind kind, Work** out) {
    Work& work = lane.queue[(lane.requests.last() + 1) % kQueueLength];
    HAUSTRA_TRY(Finish(work, lane));
    work.kind = kind;
    work.number = lane.requests.Next();
    work.done_word = nullptr;
    work.done_number = static_cast<std::uint32_t>(work.number);
    work.num_there = 0;
    if (work.mark == kLastMark) {  // marks begin anew: no result may have one from before
      std::fill_n(work.results, max_list_, TwoNearest{});
      work.mark = 0;
    }
    ++work.mark;
    *out = &work;
    return Status::Ok();
  }

  static bool HasWord(const Work& work) {
    if (work.done_word == nullptr) return true;
    // What the device wrote before the word is there, too.
    const volatile std::uint32_t& number = work.done_word->number;
    const bool is_done = number == work.done_number;
    std::atomic_thread_fence(std::memory_order_acquire);
    return is_done;
  }

  // The same of brute-force matching: goes on to the first result that is not there yet. True: all are.
  static bool AdvanceToResults(Work& work) {
    if (work.num_train == 0) return true;
    while (work.num_there < work.num_queries) {
      const volatile std::int32_t& state = work.results[work.num_there].state;
      const auto word = static_cast<std::uint32_t>(state);
      if (word >> kMarkShift != work.mark) return false;
      ++work.num_there;
      if ((word & kStateMask) == kRejected) work.num_there = NumMatchTiles(work.num_there) * kMatchTile;
    }
    std::atomic_thread_fence(std::memory_order_acquire);
    return true;
  }

  Status WaitFor(Work& work, TimePoint deadline) {
    // Results are due in tens or hundreds of microseconds: look without pause at first, then leave the processor to
    // others. An error never sends the word: the event is asked, too, when time is long.
    constexpr Duration kImpatience = std::chrono::microseconds(500);
    constexpr Duration kDoubt = std::chrono::microseconds(200);
    constexpr int kLooksPerTime = 16;
    const TimePoint begin = Now();
    TimePoint next_doubt = begin + kDoubt;
    while (true) {
      for (int look = 0; look < kLooksPerTime; ++look) {
        if (work.kind == WorkKind::kMatching ? AdvanceToResults(work) : HasWord(work)) return Status::Ok();
      }
      const TimePoint now = Now();
      const bool is_over = deadline != kNoDeadline && now >= deadline;
      if (is_over || now >= next_doubt) {
        const cudaError_t error = cudaEventQuery(work.done);
        if (error == cudaSuccess) return Status::Ok();
        if (error != cudaErrorNotReady) {
          if (work.kind == WorkKind::kExtraction) {
            slots_.AbandonWrite(work.set);
            slots_.Release(work.set);
          }
          work.kind = WorkKind::kNone;
          return RecordLoss(ToStatus(error, "work on the device"));
        }
        next_doubt = now + kDoubt;
      }
      if (is_over) return Status(StatusCode::kDeadlineExceeded);
      if (now - begin < kImpatience) continue;
      const timespec pause{0, 20'000};
      nanosleep(&pause, nullptr);
    }
  }

  // Waits for the work, if there is any, and hands over its results. The caller of overdue work has gone on: nothing of
  // its memory is touched.
  Status Finish(Work& work, LaneState& lane) {
    if (work.kind == WorkKind::kNone) return Status::Ok();
    HAUSTRA_TRY(WaitFor(work, kNoDeadline));
    if (work.is_overdue) {
      if (work.kind == WorkKind::kExtraction) {
        lane.extractor->ForgetPicture();
        slots_.AbandonWrite(work.set);
        slots_.Release(work.set);
      }
      lane.requests.Drop(work.number);
      work.kind = WorkKind::kNone;
      work.is_overdue = false;
      return Status::Ok();
    }
    switch (work.kind) {
      case WorkKind::kExtraction: {
        const std::int32_t num_features = lane.extractor->num_features();
        std::copy_n(lane.extractor->keypoints(), num_features, work.keypoints);
        *work.count = num_features;
        if (work.num_followed != nullptr) *work.num_followed = lane.extractor->num_followed();
        DeliverFollowed(lane.extractor->followed_to(), work.followed_to);
        slots_.Publish(work.set, num_features);
        slots_.Release(work.set);
        break;
      }
      case WorkKind::kMatching: DeliverMatches(work); break;
      case WorkKind::kGuidedMatching: DeliverGuidedMatches(work, lane.owners); break;
      case WorkKind::kNone: break;
    }
    work.kind = WorkKind::kNone;
    return Status::Ok();
  }

  static void DeliverMatches(const Work& work) {
    std::int32_t num_matches = 0;
    if (work.num_train > 0) {
      for (std::int32_t first = 0; first < work.num_queries; first += kMatchTile) {
        const std::int32_t end = std::min(first + kMatchTile, work.num_queries);
        for (std::int32_t i = first; i < end; ++i) {
          const TwoNearest& top = work.results[i];
          const auto state = static_cast<std::uint32_t>(top.state);
          if ((state & kStateMask) == kRejected) break;
          const auto query = first + static_cast<std::int32_t>(state >> kQueryShift) % kMatchTile;
          if (IsMatch(top, work.options)) work.matches[num_matches++] = ToMatch(query, top);
        }
      }
    }
    *work.count = num_matches;
  }

  // The most similar query keeps the keypoint; ties: the lowest.
  static void DeliverGuidedMatches(const Work& work, std::vector<std::int32_t>& owners) {
    std::int32_t num_matches = 0;
    if (work.num_train > 0) {
      std::fill_n(owners.begin(), work.num_train, -1);
      for (std::int32_t i = 0; i < work.num_queries; ++i) {
        TwoNearest& top = work.results[i];
        if (!IsMatch(top, work.options)) {
          top.best_idx = -1;
          continue;
        }
        std::int32_t& owner = owners[top.best_idx];
        if (owner < 0 || top.best > work.results[owner].best) owner = i;
      }
      for (std::int32_t i = 0; i < work.num_queries; ++i) {
        const TwoNearest& top = work.results[i];
        if (top.best_idx >= 0 && owners[top.best_idx] == i) work.matches[num_matches++] = ToMatch(i, top);
      }
    }
    *work.count = num_matches;
  }

  std::int32_t FirstRow(FeatureSetHandle set) const {
    return static_cast<std::int32_t>(set.index) * plan_.max_features;
  }

  std::int32_t RowOf(const DescriptorRef& ref) const {
    if (ref.feature_idx < 0 || ref.feature_idx >= NumFeatures(ref.set)) return -1;
    return FirstRow(ref.set) + ref.feature_idx;
  }

  RowList RowsOf(const DescriptorList& list, std::int32_t size, InputWriter& input) const {
    if (list.refs.empty() && list.indices.empty()) return {nullptr, FirstRow(list.set), size};
    const std::int32_t* device_rows = nullptr;
    std::int32_t* rows = input.Add<std::int32_t>(size, &device_rows);
    if (!list.refs.empty()) {
      for (std::int32_t i = 0; i < size; ++i) rows[i] = RowOf(list.refs[i]);
    } else {
      const std::int32_t first = FirstRow(list.set);
      for (std::int32_t i = 0; i < size; ++i) rows[i] = first + list.indices[i];
    }
    return {device_rows, 0, size};
  }

  Status LaunchMatch(LaneState& lane, const MatchRequest& request, Work& work) {
    InputWriter input(work);
    MatchJob job;
    job.query = RowsOf(request.query, work.num_queries, input);
    job.train = RowsOf(request.train, work.num_train, input);
    job.options = request.options;
    job.results = work.device_results;
    job.mark = work.mark;
    job.is_gated = request.disparity != nullptr || request.epipolar != nullptr;
    if (request.disparity != nullptr) {
      job.gate.has_window = 1;
      job.gate.max_dx_px = request.disparity->max_dx_px;
      job.gate.max_dy_px = request.disparity->max_dy_px;
    }
    if (request.epipolar != nullptr) {
      const EpipolarGate& gate = *request.epipolar;
      std::copy(gate.train_from_query_essential.begin(), gate.train_from_query_essential.end(), job.gate.essential);
      job.gate.query_set_row = FirstRow(request.query.set);
      job.gate.train_set_row = FirstRow(request.train.set);
      const auto add = [&](FeatureSetHandle set, std::span<const std::array<float, 3>> bearings,
                           std::span<const float> tolerance, const float** device_bearings,
                           const float** device_tolerance) {
        const std::size_t count = NumFeatures(set);
        std::memcpy(input.Add<float>(3 * count, device_bearings), bearings.data(), 3 * count * sizeof(float));
        std::memcpy(input.Add<float>(count, device_tolerance), tolerance.data(), count * sizeof(float));
      };
      add(request.query.set, gate.query_bearings, gate.query_tolerance, &job.gate.query_bearings,
          &job.gate.query_tolerance);
      add(request.train.set, gate.train_bearings, gate.train_tolerance, &job.gate.train_bearings,
          &job.gate.train_tolerance);
    }
    HAUSTRA_TRY(ToStatus(input.Upload(lane.stream), "input of matching"));
    HAUSTRA_TRY(ToStatus(
        LaunchBruteForce(job, sets_, lane.match_work, device_options_.dot_product, lane.match_limits, lane.stream),
        "launch of matching"));
    return ToStatus(cudaEventRecord(work.done, lane.stream), "event");
  }

  Status LaunchGuidedMatch(LaneState& lane, const GuidedMatchRequest& request, Work& work) {
    InputWriter input(work);
    GuidedJob job;
    GuidedRow* rows = input.Add<GuidedRow>(work.num_queries, &job.queries);
    for (std::int32_t i = 0; i < work.num_queries; ++i) {
      const GuidedQuery& query = request.queries[i];
      rows[i] = {RowOf(query.descriptor), query.x_px,         query.y_px,
                 query.radius_px,         query.min_scale_px, query.max_scale_px};
    }
    if (!request.train_allowed.empty()) {
      std::memcpy(input.Add<std::uint8_t>(work.num_train, &job.train_allowed), request.train_allowed.data(),
                  work.num_train);
    }
    job.num_queries = work.num_queries;
    job.train_row = FirstRow(request.train);
    job.num_train = work.num_train;
    job.options = request.options;
    job.results = work.device_results;
    job.done = {work.device_word, work.done_number};
    HAUSTRA_TRY(ToStatus(input.Upload(lane.stream), "input of guided matching"));
    HAUSTRA_TRY(ToStatus(LaunchGuided(job, sets_, lane.match_work, lane.stream), "launch of guided matching"));
    work.done_word = work.own_word;
    return ToStatus(cudaEventRecord(work.done, lane.stream), "event");
  }

  Status CopyFeatures(std::uint32_t set_index, std::span<const Keypoint> keypoints,
                      std::span<const std::uint8_t> descriptors) {
    if (keypoints.empty()) return Status::Ok();
    const std::lock_guard lock(utility_mutex_);
    const std::size_t first_row = static_cast<std::size_t>(set_index) * plan_.max_features;
    std::memcpy(transfer_.keypoints, keypoints.data(), keypoints.size_bytes());
    std::memcpy(transfer_.descriptors, descriptors.data(), descriptors.size_bytes());
    HAUSTRA_TRY(ToStatus(cudaMemcpyAsync(sets_.keypoints + first_row, transfer_.keypoints, keypoints.size_bytes(),
                                         cudaMemcpyHostToDevice, utility_stream_),
                         "writing keypoints"));
    HAUSTRA_TRY(ToStatus(cudaMemcpyAsync(sets_.descriptors + first_row * kDescriptorBytes, transfer_.descriptors,
                                         descriptors.size_bytes(), cudaMemcpyHostToDevice, utility_stream_),
                         "writing descriptors"));
    HAUSTRA_TRY(ToStatus(LaunchInverseNorms(sets_, static_cast<std::int32_t>(first_row),
                                            static_cast<std::int32_t>(keypoints.size()), utility_stream_),
                         "norms of descriptors"));
    return ToStatus(cudaStreamSynchronize(utility_stream_), "writing features");
  }

  const VisionPlan plan_;
  const int max_list_;
  const CudaDeviceOptions device_options_;
  std::string name_;
  FeatureSetSlots slots_;
  int mask_width_ = 0;
  int mask_height_ = 0;
  MatchLimits match_limits_;  // of the device
  std::atomic<bool> is_lost_{false};
  DeviceBlock device_block_;  // all memory on the device, and all that it shares with the host
  PinnedBlock pinned_block_;
  SetBuffers sets_;
  LaneState lanes_[LaneRequests::kNumLanes];
  std::mutex utility_mutex_;  // guards utility_stream_ and what transfer_ points to
  TransferMemory transfer_;
  cudaStream_t utility_stream_ = nullptr;
};

}  // namespace
}  // namespace kernels::cuda

void LoadCudaKernelsEagerly() { (void)::setenv("CUDA_MODULE_LOADING", "EAGER", 0); }

bool HasCudaDevice() {
  int num_devices = 0;
  return cudaGetDeviceCount(&num_devices) == cudaSuccess && num_devices > 0;
}

Result<std::unique_ptr<CudaVisionDevice>> CreateCudaVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                                 const CudaDeviceOptions& device_options) {
  HAUSTRA_TRY(kernels::CheckPlan(plan));
  HAUSTRA_TRY(kernels::CheckExtractOptions(options, plan));
  auto device = std::make_unique<kernels::cuda::Device>(plan, device_options);
  HAUSTRA_TRY(device->Construct(options));
  return std::unique_ptr<CudaVisionDevice>(std::move(device));
}

}  // namespace haustra
