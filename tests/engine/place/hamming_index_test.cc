#include "engine/place/hamming_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "engine/geometry/rng.h"
#include "tests/geometry/allocation_counter.h"

namespace haustra::test {
namespace {

constexpr int kNumDescriptors = 64;  // of a view
constexpr int kCapacity = 300;

using View = std::vector<std::uint8_t>;

// Positive, with a few large bins, as gradient histograms are.
View RandomView(Rng& rng, int num = kNumDescriptors) {
  View view(static_cast<std::size_t>(num) * kDescriptorBytes);
  for (std::uint8_t& byte : view) {
    const double value = rng.Uniform();
    byte = static_cast<std::uint8_t>(200.0 * value * value * value);
  }
  return view;
}

// The first `num_alike` descriptors again, each byte off by up to `noise`; the others are new.
View NearDuplicate(const View& view, int num_alike, std::uint32_t noise, Rng& rng) {
  View copy = RandomView(rng, static_cast<int>(view.size()) / kDescriptorBytes);
  for (std::size_t i = 0; i < static_cast<std::size_t>(num_alike) * kDescriptorBytes; ++i) {
    const int value = view[i] + static_cast<int>(rng.UniformInt(2 * noise + 1)) - static_cast<int>(noise);
    copy[i] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
  }
  return copy;
}

class HammingIndexTest : public testing::Test {
 protected:
  HammingIndexTest() : index_(kCapacity, kNumDescriptors), features_(kNumDescriptors), is_eligible_(kCapacity, 1) {
    std::iota(features_.begin(), features_.end(), 0);
  }

  void Add(std::uint32_t slot, const View& view) { index_.Add(slot, view, features_); }
  std::vector<std::uint64_t> ScoresOf(HammingIndex& index, const View& view) {
    std::vector<std::uint64_t> scores(kCapacity, 1);
    index.Score(view, features_, is_eligible_, scores);
    return scores;
  }
  std::vector<std::uint64_t> ScoresOf(const View& view) { return ScoresOf(index_, view); }
  // Slots by score, best first.
  std::vector<std::size_t> RankingOf(const View& view) {
    const std::vector<std::uint64_t> scores = ScoresOf(view);
    std::vector<std::size_t> slots(scores.size());
    std::iota(slots.begin(), slots.end(), std::size_t{0});
    std::stable_sort(slots.begin(), slots.end(), [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
    return slots;
  }

  HammingIndex index_;
  std::vector<std::int32_t> features_;
  std::vector<std::uint8_t> is_eligible_;
};

TEST_F(HammingIndexTest, PlantedNearDuplicatesComeFirst) {
  Rng rng(1);
  const View view = RandomView(rng);
  const std::vector<std::uint32_t> planted = {7, 150, 299};
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot) {
    const bool is_planted = std::find(planted.begin(), planted.end(), slot) != planted.end();
    Add(slot, is_planted ? NearDuplicate(view, kNumDescriptors / 4, 6, rng) : RandomView(rng));
  }
  std::vector<std::size_t> ranking = RankingOf(view);
  std::sort(ranking.begin(), ranking.begin() + 3);
  EXPECT_TRUE(std::equal(planted.begin(), planted.end(), ranking.begin()));
}

// So much noise that most of the few descriptors in common lie in another cell.
TEST_F(HammingIndexTest, FewNoisyDescriptorsInCommonAreFoundInNeighbouringCells) {
  Rng rng(13);
  int num_found = 0;
  std::vector<View> views;
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot) {
    views.push_back(RandomView(rng));
    Add(slot, views.back());
  }
  for (std::uint32_t slot = 0; slot < kCapacity; slot += 3) {
    num_found += RankingOf(NearDuplicate(views[slot], 4, 25, rng)).front() == slot ? 1 : 0;
  }
  EXPECT_GE(num_found, 95);
}

TEST_F(HammingIndexTest, MoreInCommonAndNearerScoresMore) {
  Rng rng(2);
  const View view = RandomView(rng);
  Add(0, NearDuplicate(view, kNumDescriptors / 4, 3, rng));
  Add(1, NearDuplicate(view, kNumDescriptors, 3, rng));
  Add(2, NearDuplicate(view, kNumDescriptors / 2, 3, rng));
  Add(3, NearDuplicate(view, kNumDescriptors, 12, rng));
  for (std::uint32_t slot = 4; slot < 40; ++slot) Add(slot, RandomView(rng));
  const std::vector<std::uint64_t> scores = ScoresOf(view);
  EXPECT_GT(scores[1], scores[2]);
  EXPECT_GT(scores[2], scores[0]);
  EXPECT_GT(scores[1], scores[3]);
}

// One descriptor again and again, as a repeated texture gives it.
TEST_F(HammingIndexTest, RepeatedDescriptorIsOneVote) {
  Rng rng(3);
  const View view = RandomView(rng);
  View repeated = RandomView(rng);
  for (int i = 0; i < kNumDescriptors / 2; ++i) {
    std::copy_n(view.begin(), kDescriptorBytes, repeated.begin() + std::ptrdiff_t{i} * kDescriptorBytes);
  }
  Add(0, repeated);
  Add(1, NearDuplicate(view, kNumDescriptors / 2, 3, rng));
  for (std::uint32_t slot = 2; slot < 40; ++slot) Add(slot, RandomView(rng));
  const std::vector<std::uint64_t> scores = ScoresOf(view);
  EXPECT_GT(scores[1], 4 * scores[0]);
}

TEST_F(HammingIndexTest, RareDescriptorWeighsMoreThanFrequentOne) {
  Rng rng(4);
  const View view = RandomView(rng);
  // Half of the view's descriptors are in every keyframe, the other half in the last one alone.
  for (std::uint32_t slot = 0; slot < 40; ++slot) Add(slot, NearDuplicate(view, kNumDescriptors / 2, 0, rng));
  View rare = RandomView(rng);
  std::copy(view.begin() + std::ptrdiff_t{kNumDescriptors / 2} * kDescriptorBytes, view.end(), rare.begin());
  Add(40, rare);
  const std::vector<std::uint64_t> scores = ScoresOf(view);
  for (std::uint32_t slot = 0; slot < 40; ++slot) EXPECT_GT(scores[40], 4 * scores[slot]);
}

TEST_F(HammingIndexTest, EqualKeyframesScoreTheSameWhereverTheyLie) {
  Rng rng(5);
  const View view = RandomView(rng);
  Add(0, view);
  const std::vector<std::uint64_t> self = ScoresOf(view);
  for (std::uint32_t slot = 1; slot < kCapacity; ++slot) Add(slot, view);
  const std::vector<std::uint64_t> scores = ScoresOf(view);
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot) EXPECT_EQ(scores[slot], scores[0]) << slot;
  EXPECT_GT(scores[0], 0u);
  EXPECT_GT(self[0], scores[0]);
}

TEST_F(HammingIndexTest, IneligibleAndRemovedScoreNothing) {
  Rng rng(6);
  const View view = RandomView(rng);
  for (std::uint32_t slot = 0; slot < 10; ++slot) Add(slot, NearDuplicate(view, kNumDescriptors, 3, rng));
  is_eligible_[3] = 0;
  index_.Remove(5);
  index_.Remove(5);
  const std::vector<std::uint64_t> scores = ScoresOf(view);
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot) {
    EXPECT_EQ(scores[slot] > 0, slot < 10 && slot != 3 && slot != 5) << slot;
  }
}

TEST_F(HammingIndexTest, IneligibleOnesDoNotMakeADescriptorFrequent) {
  Rng rng(7);
  const View view = RandomView(rng);
  for (std::uint32_t slot = 0; slot < 10; ++slot) Add(slot, view);
  for (std::uint32_t slot = 10; slot < 30; ++slot) Add(slot, RandomView(rng));
  const std::uint64_t frequent = ScoresOf(view)[0];
  std::fill(is_eligible_.begin() + 1, is_eligible_.begin() + 10, 0);
  EXPECT_GT(ScoresOf(view)[0], frequent);
}

TEST_F(HammingIndexTest, FullIndexOfOneCellHasRoom) {
  // All descriptors of all keyframes in one cell, after which all of another: blocks wander between cells.
  Rng rng(8);
  for (int round = 0; round < 4; ++round) {
    View view = RandomView(rng);
    // Centred on their mean, halves of a view are opposite: two cells.
    for (int i = 2; i < kNumDescriptors; ++i) {
      std::copy_n(view.begin() + std::ptrdiff_t{i % 2} * kDescriptorBytes, kDescriptorBytes,
                  view.begin() + std::ptrdiff_t{i} * kDescriptorBytes);
    }
    for (std::uint32_t slot = 0; slot < kCapacity; ++slot) Add(slot, view);
    // What is in every keyframe tells nothing, and is not read.
    EXPECT_EQ(ScoresOf(view), std::vector<std::uint64_t>(kCapacity, 0));
    for (std::uint32_t slot = 0; slot < kCapacity; ++slot) index_.Remove(slot);
    EXPECT_EQ(ScoresOf(view), std::vector<std::uint64_t>(kCapacity, 0));
    Add(7, view);
    EXPECT_GT(ScoresOf(view)[7], 0u);
    index_.Remove(7);
  }
}

TEST_F(HammingIndexTest, HistoryDoesNotMatter) {
  Rng rng(9);
  const View base = RandomView(rng);
  std::vector<View> views;
  for (int i = 0; i < kCapacity; ++i) views.push_back(NearDuplicate(base, kNumDescriptors / 2, 12, rng));
  std::vector<bool> is_there(kCapacity, false);
  for (int step = 0; step < 3000; ++step) {
    const std::uint32_t slot = rng.UniformInt(kCapacity);
    if (is_there[slot]) {
      index_.Remove(slot);
    } else {
      Add(slot, views[slot]);
    }
    is_there[slot] = !is_there[slot];
  }
  HammingIndex fresh(kCapacity, kNumDescriptors);
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot) {
    if (is_there[slot]) fresh.Add(slot, views[slot], features_);
  }
  for (int i = 0; i < 5; ++i) {
    const View query = NearDuplicate(base, kNumDescriptors, 12, rng);
    const std::vector<std::uint64_t> scores = ScoresOf(query);
    EXPECT_EQ(scores, ScoresOf(fresh, query));
    EXPECT_EQ(scores, ScoresOf(query));
    for (std::uint32_t slot = 0; slot < kCapacity; ++slot) EXPECT_EQ(scores[slot] > 0, is_there[slot]);
  }
}

TEST_F(HammingIndexTest, NoMoreDescriptorsThanThereIsRoomForCount) {
  Rng rng(10);
  const View view = RandomView(rng, 2 * kNumDescriptors);
  std::vector<std::int32_t> all(2 * kNumDescriptors);
  std::iota(all.begin(), all.end(), 0);
  index_.Add(0, view, all);
  std::vector<std::uint64_t> scores(kCapacity);
  index_.Score(view, all, is_eligible_, scores);
  EXPECT_EQ(scores, ScoresOf(view));
  index_.Remove(0);
  EXPECT_EQ(ScoresOf(view), std::vector<std::uint64_t>(kCapacity, 0));
}

TEST_F(HammingIndexTest, EmptyIndexAndEmptyViewScoreNothing) {
  Rng rng(11);
  const View view = RandomView(rng);
  EXPECT_EQ(ScoresOf(view), std::vector<std::uint64_t>(kCapacity, 0));
  Add(0, view);
  features_.clear();
  EXPECT_EQ(ScoresOf(view), std::vector<std::uint64_t>(kCapacity, 0));
  Add(1, view);  // a keyframe without features
  index_.Remove(1);
}

TEST_F(HammingIndexTest, TakesItsMemoryAtConstruction) {
  if (!AllocationCounter::IsAvailable()) GTEST_SKIP() << "allocations cannot be counted here";
  Rng rng(12);
  const View view = RandomView(rng);
  std::vector<std::uint64_t> scores(kCapacity);
  const AllocationCounter allocations;
  for (int round = 0; round < 2; ++round) {
    for (std::uint32_t slot = 0; slot < kCapacity; ++slot) Add(slot, view);
    index_.Score(view, features_, is_eligible_, scores);
    for (std::uint32_t slot = 0; slot < kCapacity; ++slot) index_.Remove(slot);
  }
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace haustra::test
