// How records behind a lock word (haustra_pose_ring.h) are written and wiped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace haustra {

inline void StoreWord(std::uint64_t* word, std::uint64_t value) { __atomic_store_n(word, value, __ATOMIC_RELEASE); }

// The counterpart of haustra_read_slot_: every word is stored with release, so that who sees one of them sees the odd
// lock, too. rt-safe: stores and nothing else.
class SlotWriter {
 public:
  SlotWriter(std::uint64_t* lock, std::uint64_t sequence) : lock_(lock), sequence_(sequence) {
    __atomic_store_n(lock_, 2 * sequence_ - 1, __ATOMIC_RELAXED);
  }
  // `offset`: of the bytes in the record; both a multiple of 8.
  void Copy(const void* from, std::size_t offset, std::size_t num_bytes) const {
    const char* source = static_cast<const char*>(from);
    for (std::size_t i = 0; i < num_bytes; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, source + i, 8);
      StoreWord(lock_ + 1 + (offset + i) / 8, word);
    }
  }
  void Commit() const { StoreWord(lock_, 2 * sequence_); }

 private:
  std::uint64_t* lock_;
  std::uint64_t sequence_;
};

// What SlotWriter::Copy takes of so many bytes.
inline constexpr std::size_t InWholeWords(std::size_t num_bytes) { return (num_bytes + 7) / 8 * 8; }

template <typename Slot>
void WipeSlot(Slot& slot) {
  // The lock first: a reader in the middle of the record finds at its end that it is gone.
  __atomic_store_n(&slot.lock, 0, __ATOMIC_RELAXED);
  for (std::size_t i = 1; i < sizeof(Slot) / 8; ++i) StoreWord(&slot.lock + i, 0);
}

template <typename Slot, std::size_t kNumSlots>
void WipeSlots(Slot (&slots)[kNumSlots]) {
  for (Slot& slot : slots) WipeSlot(slot);
}

}  // namespace haustra
