// What main_program.sh runs: a test that fails beside one that is skipped.
#include <gtest/gtest.h>

TEST(FailingParts, Fails) { ADD_FAILURE() << "as it must"; }
TEST(FailingParts, IsSkipped) { GTEST_SKIP() << "as where there is no GPU"; }
