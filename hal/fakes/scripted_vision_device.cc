#include "hal/fakes/scripted_vision_device.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <tuple>
#include <utility>

#include "hal/fakes/frame_tag.h"

namespace haustra {
namespace {

void EncodeWord(std::uint32_t word, std::uint8_t* bytes) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(word >> (8 * i));
}

std::uint32_t DecodeWord(const std::uint8_t* bytes) {
  std::uint32_t word = 0;
  for (int i = 0; i < 4; ++i) word |= static_cast<std::uint32_t>(bytes[i]) << (8 * i);
  return word;
}

// The order that every device gives its keypoints in.
bool ComesBefore(const ScriptedFeature& a, const ScriptedFeature& b) {
  const auto key = [](const Keypoint& k) { return std::tuple(k.octave, k.y_px, k.x_px, k.angle_rad); };
  return key(a.keypoint) < key(b.keypoint);
}

bool IsOutOfRange(const EpipolarGate& gate, std::int32_t num_query, std::int32_t num_train) {
  const auto query = static_cast<std::size_t>(num_query), train = static_cast<std::size_t>(num_train);
  return gate.query_bearings.size() < query || gate.query_tolerance.size() < query ||
         gate.train_bearings.size() < train || gate.train_tolerance.size() < train;
}

}  // namespace

std::array<std::uint8_t, kDescriptorBytes> EncodeAppearance(const ScriptedAppearance& appearance) {
  std::array<std::uint8_t, kDescriptorBytes> bytes{};
  EncodeWord(appearance.landmark_id, bytes.data());
  EncodeWord(appearance.look_alike_group, bytes.data() + 4);
  // The rest tells appearances apart by distance, too, and look-alikes hardly (the high bits of an LCG, Knuth
  // 1997, 3.2.1).
  std::uint64_t state =
      appearance.look_alike_group != 0 ? appearance.look_alike_group : ~std::uint64_t{appearance.landmark_id};
  for (std::size_t i = 8; i < bytes.size(); ++i) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    bytes[i] = static_cast<std::uint8_t>(state >> 56);
  }
  return bytes;
}

ScriptedVisionDevice::ScriptedVisionDevice(const VisionPlan& plan, const Options& options)
    : plan_(plan),
      options_(options),
      handles_(static_cast<std::uint32_t>(plan.max_feature_sets)),
      sets_(static_cast<std::size_t>(plan.max_feature_sets)) {
  for (FeatureSet& set : sets_) set.features.resize(plan.max_features);
  const std::size_t longest = std::max(plan.max_features, plan.max_match_list);
  for (LaneState& lane : lanes_) {
    lane.jobs.resize(kMaxPending);
    lane.query.resize(longest);
    lane.train.resize(longest);
    lane.holder.resize(longest);
    lane.responses.reserve(static_cast<std::size_t>(plan.max_features));
  }
}

void ScriptedVisionDevice::SetFrame(std::uint32_t frame_index, std::vector<ScriptedFeature> features) {
  if (features.size() > static_cast<std::size_t>(plan_.max_features)) {
    std::stable_sort(features.begin(), features.end(), [](const ScriptedFeature& a, const ScriptedFeature& b) {
      return a.keypoint.response > b.keypoint.response;
    });
    features.resize(plan_.max_features);
  }
  std::stable_sort(features.begin(), features.end(), ComesBefore);
  script_[frame_index] = std::move(features);
}

void ScriptedVisionDevice::AddFailure(Operation operation, std::uint64_t call_idx, FailurePoint point,
                                      StatusCode code) {
  failures_.push_back({operation, call_idx, point, code});
}

Status ScriptedVisionDevice::SetStaticMask(ImageView mask) {
  if (mask.is_empty()) {
    mask_.clear();
    return Status::Ok();
  }
  if (mask.width > plan_.max_width_px || mask.height > plan_.max_height_px || mask.format != PixelFormat::kGrey8) {
    return InvalidArgument("static mask: " + std::to_string(mask.width) + "x" + std::to_string(mask.height) +
                           " does not fit the plan, or is not grey");
  }
  mask_width_ = mask.width;
  mask_height_ = mask.height;
  mask_.resize(static_cast<std::size_t>(mask.width) * mask.height);
  for (int y = 0; y < mask.height; ++y) std::copy_n(mask.row(y), mask.width, mask_.data() + y * mask.width);
  return Status::Ok();
}

bool ScriptedVisionDevice::IsMasked(const Keypoint& keypoint) const {
  if (mask_.empty()) return false;
  const int x = static_cast<int>(std::lround(keypoint.x_px)), y = static_cast<int>(std::lround(keypoint.y_px));
  return x < 0 || y < 0 || x >= mask_width_ || y >= mask_height_ || mask_[y * mask_width_ + x] == 0;
}

Result<FeatureSetHandle> ScriptedVisionDevice::CreateFeatureSet() {
  const std::lock_guard lock(sets_mutex_);
  const FeatureSetHandle set = handles_.Insert();
  if (!set) return Status(StatusCode::kCapacityExceeded);
  sets_[set.index].num = 0;
  sets_[set.index].is_taken = false;
  sets_[set.index].written.clear();
  sets_[set.index].num_owners = 1;
  return set;
}

bool ScriptedVisionDevice::RetainFeatureSet(FeatureSetHandle set) {
  const std::lock_guard lock(sets_mutex_);
  if (!handles_.Contains(set)) return false;
  ++sets_[set.index].num_owners;
  return true;
}

void ScriptedVisionDevice::ReleaseFeatureSet(FeatureSetHandle set) {
  const std::lock_guard lock(sets_mutex_);
  if (handles_.Contains(set) && --sets_[set.index].num_owners == 0) handles_.Release(set);
}

std::int32_t ScriptedVisionDevice::num_free_feature_sets() const {
  const std::lock_guard lock(sets_mutex_);
  return static_cast<std::int32_t>(handles_.capacity() - handles_.size());
}

ScriptedVisionDevice::FeatureSet* ScriptedVisionDevice::Find(FeatureSetHandle set) {
  const std::lock_guard lock(sets_mutex_);
  return handles_.Contains(set) ? &sets_[set.index] : nullptr;
}

// Counts the call and looks up what the script has for it.
Status ScriptedVisionDevice::Begin(Operation operation, StatusCode* wait_failure) {
  const std::uint64_t call_idx = num_calls_[static_cast<int>(operation)].fetch_add(1);
  *wait_failure = StatusCode::kOk;
  if (is_lost_.load(std::memory_order_acquire)) return Status(StatusCode::kUnavailable);
  for (const Failure& failure : failures_) {
    if (failure.operation != operation || failure.call_idx != call_idx) continue;
    if (failure.point == FailurePoint::kEnqueue) return Status(failure.code);
    *wait_failure = failure.code;
  }
  return Status::Ok();
}

Result<Ticket> ScriptedVisionDevice::Push(Lane lane, const Job& job) {
  LaneState& state = lanes_[static_cast<int>(lane)];
  if (state.num_queued - state.num_done == kMaxPending) return Status(StatusCode::kCapacityExceeded);
  Job& slot = state.jobs[state.num_queued % kMaxPending];
  slot = job;
  if (options_.clock != nullptr) {
    const Duration latency = options_.latency[static_cast<std::size_t>(job.operation)];
    slot.done = std::max(options_.clock->Now(), state.free) + latency;
    state.free = slot.done;
  }
  ++state.num_queued;
  return Ticket{state.num_queued * kNumLanes + static_cast<std::uint64_t>(lane)};
}

Result<Ticket> ScriptedVisionDevice::EnqueueExtract(Lane lane, const ExtractRequest& request) {
  Job job;
  job.operation = Operation::kExtract;
  job.extract = request;
  HAUSTRA_TRY(Begin(job.operation, &job.failure));
  if (request.image.is_empty() || request.image.width > plan_.max_width_px ||
      request.image.height > plan_.max_height_px) {
    return Status(StatusCode::kInvalidArgument);
  }
  if (request.keypoints.size() < static_cast<std::size_t>(plan_.max_features) || request.num_keypoints == nullptr) {
    return Status(StatusCode::kInvalidArgument);
  }
  {
    const std::lock_guard lock(sets_mutex_);
    if (!handles_.Contains(request.set) || sets_[request.set.index].is_taken) {
      return Status(StatusCode::kInvalidArgument);
    }
    sets_[request.set.index].is_taken = true;
  }
  return Push(lane, job);
}

// The length of the list as it will be at most when the request runs.
Status ScriptedVisionDevice::CheckList(const DescriptorList& list, const char* name, std::int32_t* length) {
  if (!list.refs.empty()) {
    if (list.refs.size() > static_cast<std::size_t>(plan_.max_match_list)) {
      return CapacityExceeded(std::string(name) + ": longer than the plan allows");
    }
    *length = static_cast<std::int32_t>(list.refs.size());
    return Status::Ok();
  }
  // An empty gather has no set: nothing to match, and no error.
  if (!list.set.is_valid() && !list.use_indices) {
    *length = 0;
    return Status::Ok();
  }
  if (Find(list.set) == nullptr) return InvalidArgument(std::string(name) + ": stale feature set");
  *length = list.use_indices ? static_cast<std::int32_t>(list.indices.size()) : plan_.max_features;
  if (*length > plan_.max_features) return CapacityExceeded(std::string(name) + ": more indices than features");
  return Status::Ok();
}

Result<Ticket> ScriptedVisionDevice::EnqueueMatch(Lane lane, const MatchRequest& request) {
  Job job;
  job.operation = Operation::kMatch;
  job.match = request;
  HAUSTRA_TRY(Begin(job.operation, &job.failure));
  std::int32_t num_query, num_train;
  HAUSTRA_TRY(CheckList(request.query, "query", &num_query));
  HAUSTRA_TRY(CheckList(request.train, "train", &num_train));
  if (request.num_matches == nullptr) return Status(StatusCode::kInvalidArgument);
  const bool has_refs = !request.query.refs.empty() || !request.train.refs.empty();
  if (request.disparity != nullptr && has_refs) return Status(StatusCode::kInvalidArgument);
  return Push(lane, job);
}

Result<Ticket> ScriptedVisionDevice::EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) {
  Job job;
  job.operation = Operation::kGuidedMatch;
  job.guided = request;
  HAUSTRA_TRY(Begin(job.operation, &job.failure));
  if (request.queries.size() > static_cast<std::size_t>(plan_.max_match_list)) {
    return Status(StatusCode::kCapacityExceeded);
  }
  if (Find(request.train) == nullptr || request.num_matches == nullptr ||
      request.matches.size() < request.queries.size()) {
    return Status(StatusCode::kInvalidArgument);
  }
  return Push(lane, job);
}

Status ScriptedVisionDevice::Wait(Ticket ticket, TimePoint deadline) {
  const auto lane_idx = static_cast<std::size_t>(ticket.value % kNumLanes);
  const std::uint64_t number = ticket.value / kNumLanes;
  LaneState& lane = lanes_[lane_idx];
  if (number == 0 || number > lane.num_queued || lane.num_queued - number >= kMaxPending) {
    return InvalidArgument("wait: no such ticket");
  }
  if (is_lost_.load(std::memory_order_acquire)) return Status(StatusCode::kUnavailable);
  while (lane.num_done < number) {
    const Job& job = lane.jobs[lane.num_done % kMaxPending];
    if (options_.clock != nullptr && job.done > options_.clock->Now()) {
      if (job.done > deadline) {
        options_.clock->AdvanceTo(deadline);
        return Status(StatusCode::kDeadlineExceeded);
      }
      options_.clock->AdvanceTo(job.done);
    }
    if (job.failure == StatusCode::kOk) Run(job, lane);
    ++lane.num_done;
  }
  // A job's outcome stays in its slot until the ring comes round.
  return Status(lane.jobs[(number - 1) % kMaxPending].failure);
}

void ScriptedVisionDevice::Run(const Job& job, LaneState& lane) {
  switch (job.operation) {
    case Operation::kExtract: RunExtract(job.extract, lane); break;
    case Operation::kMatch: RunMatch(job.match, lane); break;
    case Operation::kGuidedMatch: RunGuidedMatch(job.guided, lane); break;
    case Operation::kNumOperations: HAUSTRA_CHECK(false); break;
  }
}

void ScriptedVisionDevice::RunExtract(const ExtractRequest& request, LaneState& lane) {
  FeatureSet* set = Find(request.set);
  HAUSTRA_CHECK(set != nullptr);
  const std::optional<std::uint32_t> frame_index = ReadFrameTag(request.image);
  const auto scripted = frame_index ? script_.find(*frame_index) : script_.end();
  set->num = 0;
  if (scripted != script_.end()) {
    const std::vector<ScriptedFeature>& features = scripted->second;
    float weakest = 0.0f;
    auto ties_left = static_cast<std::ptrdiff_t>(features.size());
    if (request.max_features > 0 && static_cast<std::size_t>(request.max_features) < features.size()) {
      lane.responses.clear();
      for (const ScriptedFeature& feature : features) lane.responses.push_back(feature.keypoint.response);
      const auto last = lane.responses.begin() + request.max_features - 1;
      std::nth_element(lane.responses.begin(), last, lane.responses.end(), std::greater<>());
      weakest = *last;
      ties_left = request.max_features - std::count_if(lane.responses.begin(), lane.responses.end(),
                                                       [weakest](float response) { return response > weakest; });
    }
    for (const ScriptedFeature& feature : features) {
      if (feature.keypoint.response < weakest) continue;
      if (feature.keypoint.response == weakest && --ties_left < 0) continue;
      if (feature.keypoint.scale_px < request.min_scale_px || IsMasked(feature.keypoint)) continue;
      request.keypoints[set->num] = feature.keypoint;
      set->features[set->num++] = feature;
    }
  }
  *request.num_keypoints = set->num;
  if (request.num_followed != nullptr) *request.num_followed = 0;  // it knows no optical flow
  std::fill(request.followed_to.begin(), request.followed_to.end(), FollowedPoint{});
}

ScriptedEntry ScriptedVisionDevice::ResolveRef(const DescriptorRef& ref) {
  const FeatureSet* set = Find(ref.set);
  if (set == nullptr || ref.feature_idx < 0 || ref.feature_idx >= set->num) return {};
  const ScriptedFeature& feature = set->features[ref.feature_idx];
  return {feature.appearance, feature.keypoint, ref.feature_idx, true};
}

std::span<const ScriptedEntry> ScriptedVisionDevice::Resolve(const DescriptorList& list,
                                                             std::vector<ScriptedEntry>* entries) {
  std::size_t length = 0;
  if (!list.refs.empty()) {
    for (const DescriptorRef& ref : list.refs) (*entries)[length++] = ResolveRef(ref);
  } else if (list.set.is_valid()) {
    const FeatureSet* set = Find(list.set);
    HAUSTRA_CHECK(set != nullptr);
    length = list.use_indices ? list.indices.size() : static_cast<std::size_t>(set->num);
    for (std::size_t i = 0; i < length; ++i) {
      const std::int32_t feature_idx = list.use_indices ? list.indices[i] : static_cast<std::int32_t>(i);
      (*entries)[i] = ResolveRef({list.set, feature_idx});
    }
  }
  return {entries->data(), length};
}

void ScriptedVisionDevice::RunMatch(const MatchRequest& request, LaneState& lane) {
  const auto query = Resolve(request.query, &lane.query);
  const auto train = Resolve(request.train, &lane.train);
  HAUSTRA_CHECK(request.matches.size() >= query.size());
  if (request.epipolar != nullptr) {
    const auto last_feature = [](std::span<const ScriptedEntry> entries) {
      std::int32_t end = 0;
      for (const ScriptedEntry& entry : entries) end = std::max(end, entry.feature_idx + 1);
      return end;
    };
    HAUSTRA_CHECK(!IsOutOfRange(*request.epipolar, last_feature(query), last_feature(train)));
  }
  *request.num_matches = MatchScripted(query, train, options_.similarity, request.options, request.disparity,
                                       request.epipolar, request.matches);
}

void ScriptedVisionDevice::RunGuidedMatch(const GuidedMatchRequest& request, LaneState& lane) {
  for (std::size_t i = 0; i < request.queries.size(); ++i) lane.query[i] = ResolveRef(request.queries[i].descriptor);
  const auto train = Resolve(DescriptorList::Whole(request.train), &lane.train);
  HAUSTRA_CHECK(request.train_allowed.empty() || request.train_allowed.size() >= train.size());
  *request.num_matches =
      GuidedMatchScripted(request.queries, {lane.query.data(), request.queries.size()}, train, request.train_allowed,
                          options_.similarity, request.options, lane.holder, request.matches);
}

Status ScriptedVisionDevice::ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) {
  const FeatureSet* found = Find(set);
  if (found == nullptr) return InvalidArgument("read descriptors: stale feature set");
  const std::size_t num_bytes = static_cast<std::size_t>(found->num) * kDescriptorBytes;
  if (out.size() < num_bytes) {
    return InvalidArgument("read descriptors: " + std::to_string(out.size()) + " bytes for " +
                           std::to_string(found->num) + " descriptors");
  }
  if (!found->written.empty()) {
    std::copy(found->written.begin(), found->written.end(), out.begin());
    return Status::Ok();
  }
  for (std::int32_t i = 0; i < found->num; ++i) {
    const auto bytes = EncodeAppearance(found->features[i].appearance);
    std::copy(bytes.begin(), bytes.end(), out.begin() + i * kDescriptorBytes);
  }
  return Status::Ok();
}

Status ScriptedVisionDevice::WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                                           std::span<const std::uint8_t> descriptors) {
  if (descriptors.size() != keypoints.size() * kDescriptorBytes) {
    return InvalidArgument("write features: " + std::to_string(keypoints.size()) + " keypoints, " +
                           std::to_string(descriptors.size()) + " bytes of descriptors");
  }
  if (keypoints.size() > static_cast<std::size_t>(plan_.max_features)) {
    return CapacityExceeded("write features: " + std::to_string(keypoints.size()) + " keypoints, the plan has " +
                            std::to_string(plan_.max_features));
  }
  const std::lock_guard lock(sets_mutex_);
  if (!handles_.Contains(set)) return InvalidArgument("write features: stale feature set");
  FeatureSet& target = sets_[set.index];
  if (target.is_taken) return InvalidArgument("write features: the set is not empty");
  target.is_taken = true;
  target.num = static_cast<std::int32_t>(keypoints.size());
  target.written.assign(descriptors.begin(), descriptors.end());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const std::uint8_t* bytes = descriptors.data() + i * kDescriptorBytes;
    target.features[i] = {keypoints[i], {DecodeWord(bytes), DecodeWord(bytes + 4)}};
  }
  return Status::Ok();
}

}  // namespace haustra
