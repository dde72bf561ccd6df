#include "platform/clock/system_clock.h"

#include <gtest/gtest.h>

#include <ctime>
#include <thread>

namespace haustra {
namespace {

TEST(SystemClock, NeverGoesBack) {
  const SystemClock clock;
  TimePoint last = clock.Now();
  for (int i = 0; i < 100000; ++i) {
    const TimePoint now = clock.Now();
    ASSERT_GE(now, last);
    last = now;
  }
}

TEST(SystemClock, IsTheMonotonicClockOfTheMachine) {
  const SystemClock clock;
  timespec before, after;
  ASSERT_EQ(clock_gettime(CLOCK_MONOTONIC, &before), 0);
  const std::int64_t now = clock.Now().time_since_epoch().count();
  ASSERT_EQ(clock_gettime(CLOCK_MONOTONIC, &after), 0);
  EXPECT_GE(now, before.tv_sec * 1'000'000'000LL + before.tv_nsec);
  EXPECT_LE(now, after.tv_sec * 1'000'000'000LL + after.tv_nsec);
}

TEST(SystemClock, CountsSleptTime) {
  const SystemClock clock;
  const TimePoint start = clock.Now();
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_GE(clock.Now() - start, std::chrono::milliseconds(5));
}

}  // namespace
}  // namespace haustra
