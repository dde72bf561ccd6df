#include "engine/tracking/map_sight.h"

#include <gtest/gtest.h>

namespace haustra::test {
namespace {

constexpr MapId kSeenMap = 3;
constexpr int kThin = 60;

TimePoint SeenAt(int ms) { return TimePoint(std::chrono::milliseconds(ms)); }

TEST(MapSight, WellSeenIsTheLastFrameWithTwiceWhatIsThin) {
  MapSight sight(kThin);
  sight.Note(kSeenMap, 900, 1.0, SeenAt(0));
  sight.Note(kSeenMap, 2 * kThin, 1.0, SeenAt(40));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(40));
  sight.Note(kSeenMap, 2 * kThin - 1, 1.0, SeenAt(80));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(40));
}

TEST(MapSight, AMapThatNeverShowsMuchIsWellSeenWithHalfOfItsMost) {
  MapSight sight(kThin);
  sight.Note(kSeenMap, 100, 1.0, SeenAt(0));
  sight.Note(kSeenMap, 50, 1.0, SeenAt(40));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(40));
  sight.Note(kSeenMap, 49, 1.0, SeenAt(80));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(40));
}

TEST(MapSight, WhatTheLadderLeavesOutIsNotLostFromSight) {
  MapSight sight(kThin);
  sight.Note(kSeenMap, 900, 1.0, SeenAt(0));
  sight.Note(kSeenMap, kThin, 0.5, SeenAt(40));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(40));
  sight.Note(kSeenMap, kThin - 1, 0.5, SeenAt(80));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(40));
}

TEST(MapSight, AnotherMapBeginsAnew) {
  MapSight sight(kThin);
  EXPECT_EQ(sight.WellSeen(kSeenMap), TimePoint::max());
  sight.Note(kSeenMap, 900, 1.0, SeenAt(0));
  sight.Note(kSeenMap + 1, 30, 1.0, SeenAt(40));
  EXPECT_EQ(sight.WellSeen(kSeenMap + 1), SeenAt(40));
  EXPECT_EQ(sight.WellSeen(kSeenMap), TimePoint::max());
}

TEST(MapSight, WhatWasKnownBeforeAClockWasSetBackStaysKnown) {
  MapSight sight(kThin);
  sight.Note(kSeenMap, 900, 1.0, SeenAt(5000));
  sight.Note(kSeenMap, 900, 1.0, SeenAt(40));
  EXPECT_EQ(sight.WellSeen(kSeenMap), SeenAt(5000));
  sight.Note(kSeenMap + 1, 900, 1.0, SeenAt(80));
  EXPECT_EQ(sight.WellSeen(kSeenMap + 1), SeenAt(80));
}

TEST(MapSight, GoesAlongWithAMapThatGoesUpInAnother) {
  MapSight sight(kThin);
  sight.Note(kSeenMap, 900, 1.0, SeenAt(40));
  sight.Hear({kSeenMap, kSeenMap + 1, Sim3{}, true});
  sight.Hear({kSeenMap + 5, kSeenMap + 6, Sim3{}, true});
  EXPECT_EQ(sight.WellSeen(kSeenMap + 1), SeenAt(40));
}

}  // namespace
}  // namespace haustra::test
