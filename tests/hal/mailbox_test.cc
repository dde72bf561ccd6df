#include "hal/core/mailbox.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace haustra {
namespace {

TEST(LatestMailbox, NothingComesBeforeTheFirstPublish) {
  LatestMailbox<int> mailbox(7);
  EXPECT_FALSE(mailbox.Refresh());
  EXPECT_EQ(mailbox.ReadSlot(), 7);
}

TEST(LatestMailbox, ReaderGetsTheNewestOnce) {
  LatestMailbox<int> mailbox;
  for (const int value : {1, 2, 3}) {
    mailbox.WriteSlot() = value;
    mailbox.Publish();
  }
  EXPECT_TRUE(mailbox.Refresh());
  EXPECT_EQ(mailbox.ReadSlot(), 3);
  EXPECT_FALSE(mailbox.Refresh());
  EXPECT_EQ(mailbox.ReadSlot(), 3);
}

TEST(LatestMailbox, ReadersSlotStaysWhileTheWriterGoesOn) {
  LatestMailbox<int> mailbox;
  mailbox.WriteSlot() = 1;
  mailbox.Publish();
  ASSERT_TRUE(mailbox.Refresh());
  const int* slot = &mailbox.ReadSlot();
  for (int value = 2; value < 10; ++value) {
    mailbox.WriteSlot() = value;
    EXPECT_NE(&mailbox.WriteSlot(), slot);
    mailbox.Publish();
  }
  EXPECT_EQ(*slot, 1);
  ASSERT_TRUE(mailbox.Refresh());
  EXPECT_EQ(mailbox.ReadSlot(), 9);
}

TEST(LatestMailbox, UnpublishedWritingIsNotSeen) {
  LatestMailbox<int> mailbox(0);
  mailbox.WriteSlot() = 5;
  EXPECT_FALSE(mailbox.Refresh());
  EXPECT_EQ(mailbox.ReadSlot(), 0);
}

TEST(LatestMailbox, PrototypeGivesEverySlotItsMemory) {
  LatestMailbox<std::vector<int>> mailbox(std::vector<int>(50));
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(mailbox.WriteSlot().size(), 50u);
    mailbox.Publish();
    mailbox.Refresh();
    EXPECT_EQ(mailbox.ReadSlot().size(), 50u);
  }
}

TEST(LatestMailbox, TwoThreadsSeeWholeValuesThatOnlyGetNewer) {
  constexpr std::uint64_t kCount = 200000;
  using Value = std::array<std::uint64_t, 32>;
  LatestMailbox<Value> mailbox(Value{});
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      mailbox.WriteSlot().fill(i);
      mailbox.Publish();
    }
  });
  std::uint64_t last = 0, num_torn = 0, num_backwards = 0, num_repeats = 0;
  while (last < kCount) {
    if (!mailbox.Refresh()) {
      std::this_thread::yield();
      continue;
    }
    const Value& value = mailbox.ReadSlot();
    for (const std::uint64_t part : value) num_torn += part != value[0] ? 1 : 0;
    num_backwards += value[0] < last ? 1 : 0;
    num_repeats += value[0] == last ? 1 : 0;
    last = value[0];
  }
  writer.join();
  EXPECT_EQ(num_torn, 0u);
  EXPECT_EQ(num_backwards, 0u);
  EXPECT_EQ(num_repeats, 0u);
}

}  // namespace
}  // namespace haustra
