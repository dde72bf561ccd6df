// A vision device without vision: which features a frame has is written down beforehand, and features of one landmark
// look alike wherever they are seen. With it the engine is tested without images, exactly and quickly. It keeps the
// contract of hal/vision_device.h but for one thing: what a wait has left is not dropped, the next wait on its lane
// does it. It is unforgiving where a real device would be undefined:
//   - results are written when Wait returns ok, not before, so a caller that reads early reads nothing;
//   - time passes on a ManualClock, with a latency for each operation and lanes that work in order and side by side;
//   - errors come at the calls that the script names;
//   - a queued request whose feature set was released before it ran stops the process: that is a bug in the caller.
// A descriptor is the landmark id and the look-alike group (little-endian, 4 bytes each) and 120 bytes by which
// appearances differ in distance, too: those of look-alikes are the same.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "hal/core/slot_pool.h"
#include "hal/fakes/manual_clock.h"
#include "hal/fakes/scripted_matching.h"
#include "hal/vision_device.h"

namespace haustra {

struct ScriptedFeature {
  Keypoint keypoint;
  ScriptedAppearance appearance;
};

// The descriptor of an appearance, for WriteFeatures and for what ReadDescriptors should give.
std::array<std::uint8_t, kDescriptorBytes> EncodeAppearance(const ScriptedAppearance& appearance);

// thread-safe: one thread a lane, as the interface says; the script is written before the first request.
class ScriptedVisionDevice final : public VisionDevice {
 public:
  enum class Operation : std::uint8_t { kExtract, kMatch, kGuidedMatch, kNumOperations };
  enum class FailurePoint : std::uint8_t { kEnqueue, kWait };

  struct Options {
    ScriptedSimilarity similarity;
    // Time an operation takes on its lane; passes on `clock`, and not at all without one.
    std::array<Duration, static_cast<std::size_t>(Operation::kNumOperations)> latency{};
    ManualClock* clock = nullptr;
  };

  ScriptedVisionDevice(const VisionPlan& plan, const Options& options);

  // The script. A frame that is not in it has no features. More features than plan.max_features: the strongest stay.
  void SetFrame(std::uint32_t frame_index, std::vector<ScriptedFeature> features);
  // The frames of another one, in place of all before.
  void CopyScript(const ScriptedVisionDevice& other) { script_ = other.script_; }
  // The call_idx-th call of the operation (from 0, all lanes together) gives `code` at the point named; it does
  // nothing.
  void AddFailure(Operation operation, std::uint64_t call_idx, FailurePoint point, StatusCode code);
  // From now on everything is kUnavailable, until the device is found again.
  void SetLost(bool is_lost) { is_lost_.store(is_lost, std::memory_order_release); }

  std::uint64_t num_calls(Operation operation) const { return num_calls_[static_cast<int>(operation)].load(); }

  std::string_view name() const override { return "scripted"; }
  const VisionPlan& plan() const override { return plan_; }
  Status SetStaticMask(ImageView mask) override;
  Result<FeatureSetHandle> CreateFeatureSet() override;
  bool RetainFeatureSet(FeatureSetHandle set) override;
  void ReleaseFeatureSet(FeatureSetHandle set) override;
  std::int32_t num_free_feature_sets() const override;
  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override;
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override;
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override;
  Status Wait(Ticket ticket, TimePoint deadline) override;
  Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) override;
  Status WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override;

 private:
  static constexpr int kNumLanes = static_cast<int>(Lane::kNumLanes);
  static constexpr std::uint64_t kMaxPending = kKnownTickets;

  struct FeatureSet {
    std::vector<ScriptedFeature> features;  // [0, num)
    std::vector<std::uint8_t> written;      // descriptors given to WriteFeatures, read back as they are; else empty
    std::int32_t num = 0;
    bool is_taken = false;  // by an extraction or by WriteFeatures: written once
    int num_owners = 0;
  };

  struct Job {
    Operation operation = Operation::kExtract;
    ExtractRequest extract;
    MatchRequest match;
    GuidedMatchRequest guided;
    TimePoint done;
    StatusCode failure = StatusCode::kOk;  // scripted; the job does nothing then
  };

  struct LaneState {
    std::vector<Job> jobs;         // ring of kMaxPending
    std::uint64_t num_queued = 0;  // ever; job i lies at i % kMaxPending
    std::uint64_t num_done = 0;
    TimePoint free;
    std::vector<ScriptedEntry> query;
    std::vector<ScriptedEntry> train;
    std::vector<std::int32_t> holder;
    std::vector<float> responses;
  };

  Status Begin(Operation operation, StatusCode* wait_failure);
  Result<Ticket> Push(Lane lane, const Job& job);
  void Run(const Job& job, LaneState& lane);
  void RunExtract(const ExtractRequest& request, LaneState& lane);
  void RunMatch(const MatchRequest& request, LaneState& lane);
  void RunGuidedMatch(const GuidedMatchRequest& request, LaneState& lane);

  FeatureSet* Find(FeatureSetHandle set);
  Status CheckList(const DescriptorList& list, const char* name, std::int32_t* length);
  std::span<const ScriptedEntry> Resolve(const DescriptorList& list, std::vector<ScriptedEntry>* entries);
  ScriptedEntry ResolveRef(const DescriptorRef& ref);
  bool IsMasked(const Keypoint& keypoint) const;

  VisionPlan plan_;
  Options options_;
  std::unordered_map<std::uint32_t, std::vector<ScriptedFeature>> script_;
  struct Failure {
    Operation operation;
    std::uint64_t call_idx;
    FailurePoint point;
    StatusCode code;
  };
  std::vector<Failure> failures_;
  std::array<std::atomic<std::uint64_t>, static_cast<std::size_t>(Operation::kNumOperations)> num_calls_{};
  std::atomic<bool> is_lost_{false};

  std::vector<std::uint8_t> mask_;
  int mask_width_ = 0, mask_height_ = 0;

  mutable std::mutex sets_mutex_;  // guards handles_, owners and is_taken; features are immutable once written
  SlotPool<char, FeatureSetTag> handles_;
  std::vector<FeatureSet> sets_;
  std::array<LaneState, kNumLanes> lanes_;
};

}  // namespace haustra
