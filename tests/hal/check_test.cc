#include "hal/core/check.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/hal/fatal_trap.h"

namespace haustra {
namespace {

TEST(Check, TrueConditionDoesNothing) {
  const FatalTrap trap;
  EXPECT_NO_THROW(HAUSTRA_CHECK(1 + 1 == 2));
}

TEST(Check, FalseConditionCallsTheHookWithItsTextAndPlace) {
  const FatalTrap trap;
  int line = 0;
  try {
    line = __LINE__ + 1;
    HAUSTRA_CHECK(1 + 1 == 3);
    FAIL() << "the hook was not called";
  } catch (const CheckFailure& failure) {
    EXPECT_STREQ(failure.what(), "1 + 1 == 3");
    EXPECT_EQ(failure.line, line);
    EXPECT_TRUE(failure.file_name.ends_with("check_test.cc"));
  }
}

TEST(Check, ConditionIsEvaluatedOnce) {
  int count = 0;
  HAUSTRA_CHECK(++count == 1);
  EXPECT_EQ(count, 1);
}

TEST(CheckDeathTest, WithoutAHookTheProcessStopsAndSaysWhy) {
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_DEATH(HAUSTRA_CHECK(2 < 1), "check failed: 2 < 1 .*check_test.cc");
}

TEST(Check, HookIsPutBack) {
  const FatalHook before = SetFatalHook(nullptr);
  SetFatalHook(before);
  { const FatalTrap trap; }
  EXPECT_EQ(SetFatalHook(before), before);
}

#ifdef __SANITIZE_ADDRESS__
// That of undefined behaviour goes with it. By itself it prints what it found and goes on, and the test passes.
TEST(SanitizerDeathTest, UndefinedBehaviourEndsTheProgram) {
  volatile int largest = std::numeric_limits<int>::max();
  EXPECT_DEATH(largest = largest + 1, "signed integer overflow");
}
#endif

}  // namespace
}  // namespace haustra
