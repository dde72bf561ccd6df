// The life of the feature sets of a device; their memory is elsewhere: handles, owners, and who may write. Slots are
// handed out lowest index first, so the same calls give the same handles on every run.
// thread-safe: looking up a handle takes no lock.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "hal/vision_device.h"

namespace haustra::kernels {

class FeatureSetSlots {
 public:
  enum class WriteClaim { kGranted, kStale, kWrittenBefore };

  static constexpr std::size_t kBytesASlot =
      sizeof(std::atomic<std::uint64_t>) + sizeof(std::int32_t) + 2 * sizeof(std::uint32_t);

  explicit FeatureSetSlots(int num_slots);

  FeatureSetHandle Create();  // with one owner; invalid when all are in use
  bool Retain(FeatureSetHandle handle);
  void Release(FeatureSetHandle handle);
  std::int32_t num_free() const;

  // -1 when the handle is stale or invalid; 0 for a set that nobody has written yet.
  std::int32_t NumFeatures(FeatureSetHandle handle) const;

  // Claims an empty set for writing. Publish makes it readable; AbandonWrite leaves it empty.
  WriteClaim BeginWrite(FeatureSetHandle handle);
  void Publish(FeatureSetHandle handle, std::int32_t num_features);
  void AbandonWrite(FeatureSetHandle handle);

 private:
  enum State : std::uint64_t { kFree = 0, kEmpty = 1, kWriting = 2, kFilled = 3 };
  static std::uint64_t TagOf(std::uint32_t generation, State state) {
    return (static_cast<std::uint64_t>(generation) << 2) | state;
  }

  std::vector<std::atomic<std::uint64_t>> tags_;  // generation and state of each slot
  std::vector<std::int32_t> num_features_;        // written before the tag says kFilled
  mutable std::mutex mutex_;                      // guards num_owners_ and free_ (a min-heap of slots)
  std::vector<std::uint32_t> num_owners_;
  std::vector<std::uint32_t> free_;
};

}  // namespace haustra::kernels
