#include "hal/fakes/manual_clock.h"

#include <gtest/gtest.h>

#include <thread>

namespace haustra {
namespace {

using std::chrono::milliseconds;

TEST(ManualClock, StandsStillUntilItIsMoved) {
  ManualClock clock(TimePoint(milliseconds(5)));
  EXPECT_EQ(clock.Now(), TimePoint(milliseconds(5)));
  clock.Advance(milliseconds(40));
  EXPECT_EQ(clock.Now(), TimePoint(milliseconds(45)));
}

TEST(ManualClock, NeverGoesBack) {
  ManualClock clock(TimePoint(milliseconds(10)));
  clock.AdvanceTo(TimePoint(milliseconds(4)));
  clock.Advance(milliseconds(-3));
  EXPECT_EQ(clock.Now(), TimePoint(milliseconds(10)));
  clock.AdvanceTo(TimePoint(milliseconds(12)));
  EXPECT_EQ(clock.Now(), TimePoint(milliseconds(12)));
}

TEST(ManualClock, ThreadsMayMoveItTogether) {
  ManualClock clock;
  std::thread other([&] {
    for (int i = 0; i < 10000; ++i) clock.Advance(Duration(1));
  });
  for (int i = 0; i < 10000; ++i) clock.Advance(Duration(1));
  other.join();
  EXPECT_EQ(clock.Now(), TimePoint(Duration(20000)));
}

}  // namespace
}  // namespace haustra
