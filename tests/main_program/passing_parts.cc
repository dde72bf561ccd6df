// What main_program.sh runs beside a test that is skipped.
#include <gtest/gtest.h>

TEST(PassingParts, Passes) { EXPECT_EQ(1 + 1, 2); }
