// The plan of the CUDA device's memory against what is dealt out by it: no device is needed, a block of the host will
// do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "kernels/cuda/cuda_vision_device.h"
#include "kernels/cuda/device_memory.h"

namespace haustra::testing {
namespace {

using kernels::cuda::BlockDealer;
using kernels::cuda::DealDeviceMemory;
using kernels::cuda::DeviceMemory;
using kernels::cuda::MemoryDealers;

VisionPlan OddPlan() {
  VisionPlan plan;
  plan.max_width_px = 323;
  plan.max_height_px = 241;
  plan.max_features = 501;
  plan.max_feature_sets = 13;
  plan.max_match_list = 907;
  return plan;
}

ExtractOptions OptionsFor(const VisionPlan& plan) {
  ExtractOptions options;
  options.num_features = plan.max_features;
  return options;
}

struct Freer {
  void operator()(void* p) const { std::free(p); }
};
using Block = std::unique_ptr<std::byte, Freer>;
Block MakeBlock(std::size_t num_bytes) {
  return Block(static_cast<std::byte*>(std::aligned_alloc(BlockDealer::kAlignment, num_bytes)));
}

TEST(BlockDealer, PiecesAreAlignedAndFollowEachOther) {
  const Block block = MakeBlock(1024);
  BlockDealer dealer(block.get(), 1024);
  EXPECT_EQ(static_cast<void*>(dealer.Deal<char>(1)), block.get());
  EXPECT_EQ(static_cast<void*>(dealer.Deal<double>(33)), block.get() + 256);
  EXPECT_EQ(dealer.used_bytes(), 768u);
}

TEST(BlockDealer, WhatDoesNotFitIsCountedAndNotDealtOut) {
  const Block block = MakeBlock(512);
  BlockDealer dealer(block.get(), 512);
  EXPECT_NE(dealer.Deal<char>(256), nullptr);
  EXPECT_EQ(dealer.Deal<char>(257), nullptr);
  EXPECT_EQ(dealer.used_bytes(), 768u);
  // Nor is anything after it, small as it may be.
  EXPECT_EQ(dealer.Deal<char>(1), nullptr);
}

TEST(BlockDealer, WithoutABlockItOnlyCounts) {
  BlockDealer dealer;
  EXPECT_EQ(dealer.Deal<std::uint64_t>(1000), nullptr);
  EXPECT_EQ(dealer.used_bytes(), 8192u);
}

TEST(CudaMemoryPlan, IsDealtOutToTheLastByte) {
  const VisionPlan vision = OddPlan();
  const Result<MemoryPlan> plan = PlanCudaVisionDevice(vision, OptionsFor(vision));
  ASSERT_TRUE(plan.ok()) << plan.status().ToString();
  const std::size_t num_device_bytes = plan->bytes(MemoryPlace::kDevice);
  const std::size_t num_pinned_bytes = plan->bytes(MemoryPlace::kHostPinned);
  const Block device = MakeBlock(num_device_bytes);
  const Block pinned = MakeBlock(num_pinned_bytes);
  const Block view = MakeBlock(num_pinned_bytes);
  MemoryDealers dealers = {
      {device.get(), num_device_bytes}, {pinned.get(), num_pinned_bytes}, {view.get(), num_pinned_bytes}};
  const DeviceMemory memory = DealDeviceMemory(vision, OptionsFor(vision), &dealers);
  EXPECT_EQ(dealers.device.used_bytes(), num_device_bytes);
  EXPECT_EQ(dealers.pinned.used_bytes(), num_pinned_bytes);
  EXPECT_EQ(dealers.pinned_view.used_bytes(), num_pinned_bytes);

  // Pieces that the sizes below are for, of both lanes: none reaches into another or leaves the block.
  struct Piece {
    const std::byte* begin;
    std::size_t num_bytes;
  };
  std::vector<Piece> pieces;
  const auto add = [&](const auto* data, std::size_t count) {
    pieces.push_back({reinterpret_cast<const std::byte*>(data), count * sizeof(*data)});
  };
  const std::size_t num_rows = 13 * 501;
  add(memory.sets.descriptors, num_rows * kDescriptorBytes);
  add(memory.sets.keypoints, num_rows);
  add(memory.sets.inverse_norms, num_rows);
  for (const kernels::cuda::ExtractMemory& lane : memory.extraction) {
    EXPECT_EQ(reinterpret_cast<std::byte*>(lane.buffers.cell_counts),
              reinterpret_cast<std::byte*>(lane.buffers.counters) + sizeof(kernels::cuda::FrameCounters));
    add(lane.buffers.counters, 1);
    add(lane.buffers.cell_counts, 6 * 5);
    add(lane.buffers.grey, 384 * 241);
    add(lane.buffers.static_mask, 384 * 241);
    add(lane.buffers.row_first, 241);
    add(lane.buffers.row_last, 241);
    add(lane.buffers.column_first, 323);
    add(lane.buffers.column_last, 323);
    add(lane.buffers.selected, 2048);
    add(lane.buffers.places, 2048);
    EXPECT_EQ(reinterpret_cast<std::byte*>(lane.picture.host) - pinned.get(),
              reinterpret_cast<std::byte*>(lane.picture.device) - view.get());
  }
  for (const kernels::cuda::MatchMemory& lane : memory.matching) {
    add(lane.work.partial, lane.work.max_partial);
    add(lane.work.merged, 1024);
    add(lane.work.train_best, 907);
    add(lane.work.query_gates.values, kernels::cuda::kGateValues * 907);
    add(lane.work.train_gates.values, kernels::cuda::kGateValues * 907);
    add(lane.device_input, CudaVisionDevice::kQueueLength * lane.input_bytes);
  }
  std::sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) { return a.begin < b.begin; });
  EXPECT_GE(pieces.front().begin, device.get());
  for (std::size_t i = 0; i + 1 < pieces.size(); ++i) {
    EXPECT_LE(pieces[i].begin + pieces[i].num_bytes, pieces[i + 1].begin) << i;
  }
  EXPECT_LE(pieces.back().begin + pieces.back().num_bytes, device.get() + num_device_bytes);
}

TEST(CudaMemoryPlan, FollowsTheSizesOfThePlan) {
  const auto device_bytes = [](const VisionPlan& plan) {
    return PlanCudaVisionDevice(plan, OptionsFor(plan)).value().device_bytes();
  };
  const std::uint64_t base = device_bytes(OddPlan());
  for (int VisionPlan::*size : {&VisionPlan::max_width_px, &VisionPlan::max_features, &VisionPlan::max_feature_sets,
                                &VisionPlan::max_match_list}) {
    VisionPlan larger = OddPlan();
    larger.*size *= 3;
    EXPECT_GT(device_bytes(larger), base);
  }
  VisionPlan tiny = OddPlan();
  tiny.max_width_px = 16;
  EXPECT_EQ(PlanCudaVisionDevice(tiny, OptionsFor(tiny)).code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace haustra::testing
