#include "hal/core/edit_distance.h"

#include <gtest/gtest.h>

namespace haustra {
namespace {

TEST(EditDistance, CountsInsertionsDeletionsAndReplacements) {
  EXPECT_EQ(EditDistance("", "", LetterCase::kMatters), 0u);
  EXPECT_EQ(EditDistance("", "fx", LetterCase::kMatters), 2u);
  EXPECT_EQ(EditDistance("kitten", "sitting", LetterCase::kMatters), 3u);
  EXPECT_EQ(EditDistance("min_inlier", "min_inliers", LetterCase::kMatters), 1u);
}

TEST(EditDistance, CaseCountsOnlyWhereItMatters) {
  EXPECT_EQ(EditDistance("Camera.FX", "camera.fx", LetterCase::kMatters), 3u);
  EXPECT_EQ(EditDistance("Camera.FX", "camera.fx", LetterCase::kIgnored), 0u);
}

}  // namespace
}  // namespace haustra
