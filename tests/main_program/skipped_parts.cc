// What main_program.sh runs: a test that is skipped.
#include <gtest/gtest.h>

TEST(SkippedParts, IsSkipped) { GTEST_SKIP() << "as where there is no GPU"; }
