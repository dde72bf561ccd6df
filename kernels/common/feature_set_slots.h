// The life of the feature sets of a device; their memory is elsewhere: handles, owners, and who may write. Slots are
// handed out lowest index first, so the same calls give the same handles on every run.
// thread-safe and rt-safe: lock-free, so that no thread of ordinary priority holds up tracking.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hal/vision_device.h"

namespace haustra::kernels {

class FeatureSetSlots {
 public:
  enum class WriteClaim { kGranted, kStale, kWrittenBefore };

  explicit FeatureSetSlots(int num_slots);
  static std::size_t BytesFor(int num_slots);

  FeatureSetHandle Create();  // with one owner; invalid when all are in use
  // At most 2^30 - 1 owners.
  bool Retain(FeatureSetHandle handle);
  void Release(FeatureSetHandle handle);
  // While others create and release: of some moment.
  std::int32_t num_free() const;

  // -1 when the handle is stale or invalid; 0 for a set that nobody has written yet.
  std::int32_t NumFeatures(FeatureSetHandle handle) const;

  // Claims an empty set for writing. Publish makes it readable; AbandonWrite leaves it empty.
  WriteClaim BeginWrite(FeatureSetHandle handle);
  void Publish(FeatureSetHandle handle, std::int32_t num_features);
  void AbandonWrite(FeatureSetHandle handle);

 private:
  enum State : std::uint64_t { kFree = 0, kEmpty = 1, kWriting = 2, kFilled = 3 };

  // Generation (32 bits), number of owners (30) and state (2) of a slot change together or not at all.
  struct Tag {
    std::uint32_t generation = 0;
    std::uint32_t num_owners = 0;
    State state = kFree;

    static Tag From(std::uint64_t word) {
      return {static_cast<std::uint32_t>(word >> 32), static_cast<std::uint32_t>(word >> 2) & 0x3fffffffu,
              static_cast<State>(word & 3)};
    }
    std::uint64_t word() const {
      return static_cast<std::uint64_t>(generation) << 32 | static_cast<std::uint64_t>(num_owners) << 2 | state;
    }
  };

  // Changes the slot's tag as `change` does; false, and nothing changed, when the handle is stale or `change` says so.
  template <typename Change>
  bool Update(FeatureSetHandle handle, Change&& change);
  bool ChangeState(FeatureSetHandle handle, State from, State to);

  std::vector<std::atomic<std::uint64_t>> tags_;  // one a slot
  std::vector<std::int32_t> num_features_;        // written before the tag says kFilled
  std::vector<std::atomic<std::uint64_t>> free_;  // a bit a slot; whoever clears it has the slot
};

}  // namespace haustra::kernels
