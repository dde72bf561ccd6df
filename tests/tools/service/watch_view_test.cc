#include "tools/service/watch_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace haustra {
namespace {

using ::testing::HasSubstr;

WatchModel ModelWithLatencies(std::deque<double> latencies_ms) {
  WatchModel model;
  model.has_pose = true;
  model.latencies_ms = std::move(latencies_ms);
  return model;
}

// By nearest rank, as in a report.
TEST(WatchView, PercentilesAreThoseOfReports) {
  EXPECT_THAT(WatchPage(ModelWithLatencies({40, 10, 30, 20}), 200),
              HasSubstr("latency    last 20.0 ms  median 20.0  p99 40.0  max 40.0  (4 frames)"));
}

TEST(WatchView, NoLatenciesAreZeros) {
  EXPECT_THAT(WatchPage(ModelWithLatencies({}), 200),
              HasSubstr("latency    last 0.0 ms  median 0.0  p99 0.0  max 0.0  (0 frames)"));
}

}  // namespace
}  // namespace haustra
