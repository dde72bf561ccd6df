// All memory of the CUDA device: pieces of two blocks, one on the device and one pinned on the host, which the device
// sees too. Sizes follow from plan and options alone, so a plan needs no GPU.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/vision_device.h"
#include "kernels/cuda/block_dealer.h"
#include "kernels/cuda/extract_buffers.h"
#include "kernels/cuda/match_kernels.h"

namespace haustra::kernels::cuda {

// Blocks of the matcher that memory is planned for: an H200 holds 264 at the same time, and a larger GPU will be used
// no further than this.
inline constexpr int kMaxMatchBlocks = 512;

// The same memory as the host and as the device sees it.
template <typename T>
struct Mapped {
  T* host = nullptr;
  T* device = nullptr;
};

struct MemoryDealers {
  BlockDealer device;
  BlockDealer pinned;
  BlockDealer pinned_view;  // of the pinned block, by the device's addresses

  template <typename T>
  Mapped<T> DealMapped(std::size_t count) {
    T* host = pinned.Deal<T>(count);
    return {host, pinned_view.Deal<T>(count)};
  }
};

// The extraction of one lane.
struct ExtractMemory {
  ExtractBuffers buffers;
  BandWeights* band_weights = nullptr;  // that of the buffers, to be written
  Mapped<FrameParams> params;
  Mapped<std::uint8_t> picture;  // in colour
  Mapped<Keypoint> keypoints;
  Mapped<Keypoint> follow;
  Mapped<FollowedPoint> followed_to;  // of each of these
  Mapped<std::int32_t> num_features;
  Mapped<std::int32_t> num_detected;
  Mapped<DoneWord> done;
};

// The matching of one lane: all requests in the queue have the same room, one behind the other.
struct MatchMemory {
  MatchWork work;
  std::uint8_t* input = nullptr;  // pinned
  std::uint8_t* device_input = nullptr;
  std::size_t input_bytes = 0;  // of one request
  Mapped<TwoNearest> results;   // MaxList of each request
  Mapped<DoneWord> words;       // one of each request
};

// One set on its way from or to the host's memory, pinned: otherwise the driver makes a copy of its own, which nobody
// can clear.
struct TransferMemory {
  std::uint8_t* descriptors = nullptr;
  Keypoint* keypoints = nullptr;
};

// Entries of the longest list that is matched.
int MaxList(const VisionPlan& plan);

SetBuffers DealSets(const VisionPlan& plan, MemoryDealers* dealers);
ExtractMemory DealExtractMemory(const VisionPlan& plan, const ExtractOptions& options, MemoryDealers* dealers);
MatchMemory DealMatchMemory(const VisionPlan& plan, MemoryDealers* dealers);
TransferMemory DealTransferMemory(const VisionPlan& plan, MemoryDealers* dealers);

struct DeviceMemory {
  SetBuffers sets;
  TransferMemory transfer;
  ExtractMemory extraction[static_cast<int>(Lane::kNumLanes)];
  MatchMemory matching[static_cast<int>(Lane::kNumLanes)];
};
DeviceMemory DealDeviceMemory(const VisionPlan& plan, const ExtractOptions& options, MemoryDealers* dealers);

}  // namespace haustra::kernels::cuda
