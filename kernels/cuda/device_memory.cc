#include "kernels/cuda/device_memory.h"

#include <algorithm>

#include "kernels/common/feature_set_slots.h"
#include "kernels/common/request_checks.h"
#include "kernels/cuda/cuda_vision_device.h"
#include "kernels/cuda/scale_space_layout.h"

namespace haustra {
namespace kernels::cuda {
namespace {

constexpr std::size_t kNumLanes = static_cast<std::size_t>(Lane::kNumLanes);
constexpr std::size_t kQueueLength = CudaVisionDevice::kQueueLength;

std::size_t AlignUp(std::size_t size, std::size_t alignment) { return (size + alignment - 1) / alignment * alignment; }

// Input of the largest request: rows and gates of two lists, or the queries of a guided match (cuda_vision_device.cc).
std::size_t MaxInputBytes(const VisionPlan& plan) {
  const std::size_t max_list = MaxList(plan);
  const std::size_t max_features = plan.max_features;
  const std::size_t brute_force =
      2 * (AlignUp(4 * max_list, 16) + AlignUp(12 * max_features, 16) + AlignUp(4 * max_features, 16));
  const std::size_t guided = AlignUp(sizeof(GuidedRow) * plan.max_match_list, 16) + AlignUp(max_features, 16);
  return AlignUp(std::max(brute_force, guided), 256);
}

}  // namespace

int MaxList(const VisionPlan& plan) { return std::max(plan.max_features, plan.max_match_list); }

SetBuffers DealSets(const VisionPlan& plan, MemoryDealers* dealers) {
  const std::size_t num_rows = static_cast<std::size_t>(plan.max_feature_sets) * plan.max_features;
  SetBuffers sets;
  sets.descriptors = dealers->device.Deal<std::uint8_t>(num_rows * kDescriptorBytes);
  sets.keypoints = dealers->device.Deal<Keypoint>(num_rows);
  sets.inverse_norms = dealers->device.Deal<float>(num_rows);
  sets.max_features = plan.max_features;
  return sets;
}

ExtractMemory DealExtractMemory(const VisionPlan& plan, const ExtractOptions& options, MemoryDealers* dealers) {
  const ScaleSpaceLayout largest = MakeLayout(plan.max_width_px, plan.max_height_px);
  const LayoutSizes sizes = SizesOf(largest);
  const std::size_t num_pixels = static_cast<std::size_t>(largest.grey_pitch) * plan.max_height_px;
  ExtractMemory memory;
  memory.params = dealers->DealMapped<FrameParams>(1);
  memory.picture = dealers->DealMapped<std::uint8_t>(3 * num_pixels);
  memory.keypoints = dealers->DealMapped<Keypoint>(plan.max_features);
  memory.follow = dealers->DealMapped<Keypoint>(MaxFollowed(plan));
  memory.followed_to = dealers->DealMapped<FollowedPoint>(MaxFollowed(plan));
  memory.num_features = dealers->DealMapped<std::int32_t>(1);
  memory.num_detected = dealers->DealMapped<std::int32_t>(1);
  memory.done = dealers->DealMapped<DoneWord>(1);

  BlockDealer& device = dealers->device;
  ExtractBuffers& buffers = memory.buffers;
  buffers.host_params = memory.params.device;
  buffers.params = device.Deal<FrameParams>(1);
  // The counts of the cells lie right behind.
  buffers.counters = reinterpret_cast<FrameCounters*>(
      device.Deal<std::byte>(sizeof(FrameCounters) + largest.num_cells * sizeof(std::int32_t)));
  if (buffers.counters != nullptr) buffers.cell_counts = reinterpret_cast<std::int32_t*>(buffers.counters + 1);
  buffers.grey = device.Deal<std::uint8_t>(num_pixels);
  buffers.static_mask = device.Deal<std::uint8_t>(num_pixels);
  buffers.row_first = device.Deal<std::int32_t>(plan.max_height_px);
  buffers.row_last = device.Deal<std::int32_t>(plan.max_height_px);
  buffers.column_first = device.Deal<std::int32_t>(plan.max_width_px);
  buffers.column_last = device.Deal<std::int32_t>(plan.max_width_px);
  buffers.mask_bits = device.Deal<std::uint32_t>(sizes.mask_words);
  buffers.dilated_bits = device.Deal<std::uint32_t>(sizes.mask_words + largest.masks[0].num_words);
  buffers.band_weights = memory.band_weights = device.Deal<BandWeights>(kNumBandSources);
  buffers.planes = device.Deal<std::uint16_t>(sizes.plane_values);
  buffers.extrema = device.Deal<uint2>(sizes.max_extrema);
  buffers.points = device.Deal<ScaleSpacePoint>(sizes.max_extrema);
  buffers.keys = device.Deal<PointKey>(sizes.max_extrema);
  buffers.priorities = device.Deal<std::uint64_t>(sizes.max_extrema);
  buffers.cell_points = device.Deal<CellPoint>(static_cast<std::size_t>(largest.num_cells) * kMaxPointsPerCell);
  buffers.survivor_priorities = device.Deal<std::uint64_t>(sizes.max_extrema);
  buffers.survivors = device.Deal<Survivor>(sizes.max_extrema);
  const std::size_t num_ranks = AlignUp(options.num_features, kRanksPerChunk);
  buffers.selected = device.Deal<SelectedPoint>(num_ranks);
  buffers.angle_counts = device.Deal<std::uint8_t>(num_ranks);
  buffers.places = device.Deal<std::uint64_t>(num_ranks);
  buffers.kept_levels = device.Deal<std::uint16_t>(sizes.kept_values);
  buffers.followed = device.Deal<FollowedFeature>(MaxFollowed(plan));
  buffers.further = device.Deal<std::uint32_t>((kMaxOrientations - 1) * num_ranks);
  return memory;
}

MatchMemory DealMatchMemory(const VisionPlan& plan, MemoryDealers* dealers) {
  const int max_list = MaxList(plan);
  const std::size_t list = max_list;
  BlockDealer& device = dealers->device;
  MatchMemory memory;
  MatchWork& work = memory.work;
  work.max_partial = MaxPartialResults(max_list, kMaxMatchBlocks);
  work.partial = device.Deal<TwoNearest>(work.max_partial);
  work.merged = device.Deal<TwoNearest>(AlignUp(list, 128));
  work.counters = device.Deal<std::int32_t>(NumMatchCounters(max_list));
  work.train_best = device.Deal<unsigned long long>(list);
  work.query_gates = {device.Deal<float>(kGateValues * list), max_list};
  work.train_gates = {device.Deal<float>(kGateValues * list), max_list};
  memory.input_bytes = MaxInputBytes(plan);
  memory.input = dealers->DealMapped<std::uint8_t>(kQueueLength * memory.input_bytes).host;
  memory.device_input = device.Deal<std::uint8_t>(kQueueLength * memory.input_bytes);
  memory.results = dealers->DealMapped<TwoNearest>(kQueueLength * list);
  memory.words = dealers->DealMapped<DoneWord>(kQueueLength);
  return memory;
}

TransferMemory DealTransferMemory(const VisionPlan& plan, MemoryDealers* dealers) {
  const auto num_features = static_cast<std::size_t>(plan.max_features);
  return {dealers->DealMapped<std::uint8_t>(num_features * kDescriptorBytes).host,
          dealers->DealMapped<Keypoint>(num_features).host};
}

DeviceMemory DealDeviceMemory(const VisionPlan& plan, const ExtractOptions& options, MemoryDealers* dealers) {
  DeviceMemory memory;
  memory.sets = DealSets(plan, dealers);
  memory.transfer = DealTransferMemory(plan, dealers);
  for (int lane = 0; lane < static_cast<int>(kNumLanes); ++lane) {
    if (!kernels::Extracts(static_cast<Lane>(lane), plan)) continue;
    memory.extraction[lane] = DealExtractMemory(plan, options, dealers);
  }
  for (MatchMemory& lane : memory.matching) lane = DealMatchMemory(plan, dealers);
  return memory;
}

}  // namespace kernels::cuda

Result<MemoryPlan> PlanCudaVisionDevice(const VisionPlan& plan, const ExtractOptions& options) {
  using namespace kernels::cuda;
  HAUSTRA_TRY(kernels::CheckPlan(plan));
  HAUSTRA_TRY(kernels::CheckExtractOptions(options, plan));
  MemoryDealers sets, transfer, extraction, matching;
  (void)DealSets(plan, &sets);
  (void)DealTransferMemory(plan, &transfer);
  (void)DealExtractMemory(plan, options, &extraction);
  (void)DealMatchMemory(plan, &matching);
  const auto num_sets = static_cast<std::uint64_t>(plan.max_feature_sets);
  const char* by_sets = "memory.max_keyframes x features.max";
  const auto num_extracting = static_cast<std::uint64_t>(kernels::NumExtractingLanes(plan));
  const char* by_image = "image size, features.max";
  const char* by_lists = "memory.max_local_points, features.max; one for each lane";
  MemoryPlan memory;
  memory.Add(MemoryPlace::kDevice, "feature sets (cuda)", num_sets, sets.device.used_bytes(), by_sets);
  memory.Add(MemoryPlace::kDevice, "extraction (cuda)", num_extracting, num_extracting * extraction.device.used_bytes(),
             by_image);
  memory.Add(MemoryPlace::kDevice, "matching (cuda)", kNumLanes, kNumLanes * matching.device.used_bytes(), by_lists);
  memory.Add(MemoryPlace::kHostPinned, "feature sets (cuda)", 1, transfer.pinned.used_bytes(), "features.max");
  memory.Add(MemoryPlace::kHostPinned, "extraction (cuda)", num_extracting,
             num_extracting * extraction.pinned.used_bytes(), by_image);
  memory.Add(MemoryPlace::kHostPinned, "matching (cuda)", kNumLanes, kNumLanes * matching.pinned.used_bytes(),
             by_lists);
  memory.Add(MemoryPlace::kHost, "feature sets (cuda)", num_sets,
             kernels::FeatureSetSlots::BytesFor(static_cast<int>(num_sets)), by_sets);
  memory.Add(MemoryPlace::kHost, "matching (cuda)", kNumLanes, kNumLanes * plan.max_features * sizeof(std::int32_t),
             by_lists);
  return memory;
}

}  // namespace haustra
