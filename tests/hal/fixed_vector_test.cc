#include "hal/core/fixed_vector.h"

#include <gtest/gtest.h>

#include <numeric>

namespace haustra {
namespace {

TEST(FixedVector, NewOneIsEmpty) {
  const FixedVector<int, 3> vector;
  EXPECT_TRUE(vector.empty());
  EXPECT_FALSE(vector.full());
  EXPECT_EQ(vector.size(), 0u);
  EXPECT_EQ(vector.capacity(), 3u);
  EXPECT_EQ(vector.begin(), vector.end());
}

TEST(FixedVector, PushWhenFullIsRefusedAndChangesNothing) {
  FixedVector<int, 2> vector;
  EXPECT_TRUE(vector.PushBack(1));
  EXPECT_TRUE(vector.PushBack(2));
  EXPECT_TRUE(vector.full());
  EXPECT_FALSE(vector.PushBack(3));
  EXPECT_EQ(vector.size(), 2u);
  EXPECT_EQ(vector[1], 2);
}

TEST(FixedVector, SwapEraseMovesTheLastIntoTheGap) {
  FixedVector<int, 4> vector;
  for (const int value : {10, 11, 12, 13}) ASSERT_TRUE(vector.PushBack(value));
  vector.SwapErase(1);
  ASSERT_EQ(vector.size(), 3u);
  EXPECT_EQ(vector[0], 10);
  EXPECT_EQ(vector[1], 13);
  EXPECT_EQ(vector[2], 12);
  vector.SwapErase(2);
  EXPECT_EQ(vector.size(), 2u);
}

TEST(FixedVector, RangeCoversWhatIsThere) {
  FixedVector<int, 10> vector;
  for (int i = 1; i <= 4; ++i) ASSERT_TRUE(vector.PushBack(i));
  EXPECT_EQ(std::accumulate(vector.begin(), vector.end(), 0), 10);
}

TEST(FixedVector, ClearMakesRoom) {
  FixedVector<int, 1> vector;
  ASSERT_TRUE(vector.PushBack(1));
  vector.Clear();
  EXPECT_TRUE(vector.empty());
  EXPECT_TRUE(vector.PushBack(2));
  EXPECT_EQ(vector[0], 2);
}

}  // namespace
}  // namespace haustra
