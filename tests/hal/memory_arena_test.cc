#include "hal/core/memory_arena.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "hal/core/mailbox.h"
#include "hal/core/memory_plan.h"
#include "hal/core/slot_pool.h"
#include "hal/core/spsc_ring.h"

namespace haustra {
namespace {

struct ArenaTag;

TEST(MemoryArena, DealsOutAlignedBlocksThatDoNotOverlap) {
  MemoryArena arena(MemoryArena::BytesFor<char>(3) + MemoryArena::BytesFor<double>(9));
  auto* first = static_cast<char*>(arena.allocate(3, 1));
  auto* second = static_cast<char*>(arena.allocate(9 * sizeof(double), alignof(double)));
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first) % MemoryArena::kAlignment, 0u);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(second) % MemoryArena::kAlignment, 0u);
  EXPECT_GE(second - first, 3);
  EXPECT_EQ(arena.used_bytes(), arena.size_bytes());
}

TEST(MemoryArena, RefusesWhatWasNotPlannedAndStaysUsable) {
  MemoryArena arena(128);
  EXPECT_THROW((void)arena.allocate(129, 1), std::bad_alloc);
  EXPECT_NE(arena.allocate(128, 1), nullptr);
  EXPECT_THROW((void)arena.allocate(1, 1), std::bad_alloc);
}

TEST(MemoryArena, ContainersTakeExactlyWhatTheySay) {
  using Pool = SlotPool<std::uint64_t, ArenaTag>;
  using Ring = SpscRing<double>;
  using Box = LatestMailbox<int>;
  MemoryArena arena(Pool::BytesFor(17) + Ring::BytesFor(5) + Box::BytesFor());
  Pool pool(17, &arena);
  EXPECT_EQ(arena.used_bytes(), Pool::BytesFor(17));
  Ring ring(5, &arena);
  EXPECT_EQ(arena.used_bytes(), Pool::BytesFor(17) + Ring::BytesFor(5));
  Box box(&arena);
  EXPECT_EQ(arena.used_bytes(), arena.size_bytes());
  while (pool.Insert()) continue;
  while (ring.TryPush(1.0)) continue;
  box.WriteSlot() = 3;
  box.Publish();
  EXPECT_EQ(arena.used_bytes(), arena.size_bytes());
}

MemoryPlan ThreeLines() {
  MemoryPlan plan;
  plan.Add(MemoryPlace::kHostArena, "keyframes", 10, 3'000'000, "memory.max_keyframes");
  plan.Add(MemoryPlace::kHost, "workspace", 1, 2'000'000, "features.max");
  plan.Add(MemoryPlace::kDevice, "feature sets", 10, 9'000'000, "memory.max_keyframes");
  return plan;
}

TEST(MemoryPlan, SumsByPlace) {
  const MemoryPlan plan = ThreeLines();
  EXPECT_EQ(plan.bytes(MemoryPlace::kHostArena), 3'000'000u);
  EXPECT_EQ(plan.host_bytes(), 5'000'000u);
  EXPECT_EQ(plan.device_bytes(), 9'000'000u);
}

TEST(MemoryPlan, RefusalNamesTheFirstLineThatDoesNotFit) {
  const MemoryPlan plan = ThreeLines();
  EXPECT_TRUE(CheckFits(plan, {5.0, 9.0, "limit", "limit"}).ok());
  EXPECT_TRUE(CheckFits(plan, {}).ok());
  const Status host = CheckFits(plan, {4.9, 0.0, "memory.max_host_mb", ""});
  EXPECT_EQ(host.code(), StatusCode::kCapacityExceeded);
  EXPECT_EQ(host.message(),
            "host memory: 'workspace' (2.0 MB, sized by features.max) does not fit: the plan needs 5.0 MB, "
            "memory.max_host_mb allows 4.9 MB; 'haustra plan' shows all lines");
  EXPECT_NE(CheckFits(plan, {2.0, 0.0, "limit", ""}).message().find("'keyframes'"), std::string::npos);
  EXPECT_NE(CheckFits(plan, {0.0, 8.0, "", "limit"}).message().find("device memory: 'feature sets'"),
            std::string::npos);
}

}  // namespace
}  // namespace haustra
