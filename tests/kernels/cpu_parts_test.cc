// The parts that the CPU device is made of.
#include <gtest/gtest.h>
#include <pthread.h>

#include <atomic>
#include <cmath>
#include <ctime>
#include <random>
#include <thread>
#include <vector>

#include "kernels/cpu/exclusion_mask.h"
#include "kernels/cpu/feature_selection.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/sift_kernels.h"
#include "kernels/cpu/sift_refinement.h"
#include "platform/clock/system_clock.h"

namespace haustra::kernels {
namespace {

// ---- Thread pool ----------------------------------------------------------------------------------------------------

// Nobody holds up a task: all of it is done.
template <typename Task>
void RunAll(LanePool& pool, int num_tasks, const Task& task) {
  pool.Begin(num_tasks, task);
  EXPECT_TRUE(pool.Finish(kNoDeadline));
}

TEST(LanePool, FinishRunsEveryTaskOnce) {
  for (const int num_threads : {1, 2, 5}) {
    LanePool pool(num_threads);
    for (const int num_tasks : {0, 1, 2, 100}) {
      std::vector<std::atomic<int>> runs(num_tasks);
      std::atomic<bool> is_worker_in_range{true};
      RunAll(pool, num_tasks, [&](int task, int worker) {
        ++runs[task];
        if (worker < 0 || worker >= num_threads) is_worker_in_range = false;
      });
      for (const auto& count : runs) EXPECT_EQ(count.load(), 1);
      EXPECT_TRUE(is_worker_in_range);
    }
  }
}

TEST(LanePool, WorkerIndexIsNeverUsedTwiceAtOnce) {
  LanePool pool(4);
  std::atomic<int> in_use[4] = {};
  std::atomic<bool> is_shared{false};
  for (int round = 0; round < 200; ++round) {
    RunAll(pool, 50, [&](int, int worker) {
      if (in_use[worker].fetch_add(1) != 0) is_shared = true;
      std::this_thread::yield();
      in_use[worker].fetch_sub(1);
    });
  }
  EXPECT_FALSE(is_shared);
}

TEST(LanePool, WithoutTimeNothingIsBegun) {
  for (const int num_threads : {1, 3}) {
    LanePool pool(num_threads);
    std::atomic<int> num_runs{0};
    pool.Begin(10, [&](int, int) { ++num_runs; });
    EXPECT_FALSE(pool.Finish(TimePoint{}));
    EXPECT_EQ(num_runs.load(), 0);
    EXPECT_TRUE(pool.Finish(kNoDeadline));
    EXPECT_EQ(num_runs.load(), 10);
    EXPECT_TRUE(pool.Finish(TimePoint{})) << "what is done is done";
  }
}

// Not even once a task, so that each call finds the end of its time inside the loop.
TEST(LanePool, LoopThatIsLeftAgainAndAgainRunsEveryTaskOnce) {
  const SystemClock clock;
  for (const int num_threads : {1, 3}) {
    LanePool pool(num_threads);
    std::vector<std::atomic<int>> runs(300);
    pool.Begin(300, [&](int task, int) {
      ++runs[task];
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    });
    while (!pool.Finish(clock.Now() + std::chrono::microseconds(200))) {
    }
    for (const auto& count : runs) EXPECT_EQ(count.load(), 1);
  }
}

// A helper that does not come back: whoever waits for it has a deadline.
TEST(LanePool, DeadlineEndsTheWaitForAHelper) {
  const SystemClock clock;
  LanePool pool(2);
  std::atomic<bool> is_held{false};
  std::atomic<bool> may_go{false};
  std::atomic<int> num_done{0};
  pool.Begin(2, [&](int, int worker) {
    if (worker == 1) is_held = true;
    while (!(worker == 1 ? may_go : is_held)) std::this_thread::yield();
    ++num_done;
  });
  EXPECT_FALSE(pool.Finish(clock.Now() + std::chrono::milliseconds(1)));
  while (!is_held) EXPECT_FALSE(pool.Finish(clock.Now() + std::chrono::milliseconds(1)));
  EXPECT_FALSE(pool.Drop(TimePoint{})) << "the helper is still in its task";
  may_go = true;
  EXPECT_TRUE(pool.Drop(kNoDeadline));
  const int num_then = num_done;
  RunAll(pool, 4, [&](int, int) { ++num_done; });
  EXPECT_EQ(num_done.load(), num_then + 4);
}

// SCHED_BATCH needs no right; for the pool it is a policy like any other.
TEST(LanePool, HelpersFollowTheSchedulingOfTheThreadTheyHelp) {
  LanePool pool(2);
  std::thread caller([&] {
    sched_param parameters{};
    ASSERT_EQ(pthread_setschedparam(pthread_self(), SCHED_BATCH, &parameters), 0);
    ASSERT_TRUE(pool.FollowThisThread());
    std::atomic<int> policy{-1};
    RunAll(pool, 2, [&](int, int worker) {
      if (worker == 1) policy = sched_getscheduler(0);
      while (policy < 0) std::this_thread::yield();
    });
    EXPECT_EQ(policy.load(), SCHED_BATCH);
  });
  caller.join();
}

// On one processor, with a thread whose priority lies between that of ordinary ones and the caller's: it does not run
// while a helper is in a task, or the caller would wait for it, too.
TEST(LanePool, WorkOfAPriorityBetweenDoesNotHoldUpAHelper) {
  std::atomic<bool> is_in_task{false};
  std::atomic<bool> is_done{false};
  std::atomic<int> num_seen{0};
  bool may_be_real_time = true;
  std::thread caller([&] {
    const auto set_fifo = [](int priority) {
      const sched_param parameters{priority};
      return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
    };
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sched_getcpu(), &one);
    ASSERT_EQ(pthread_setaffinity_np(pthread_self(), sizeof one, &one), 0);
    LanePool pool(2);  // its helper stays on this processor
    if (!set_fifo(20)) {
      may_be_real_time = false;
      return;
    }
    ASSERT_TRUE(pool.FollowThisThread());
    std::thread between([&] {
      EXPECT_TRUE(set_fifo(10));
      while (!is_done) num_seen += is_in_task ? 1 : 0;
    });
    std::atomic<bool> is_begun{false};
    RunAll(pool, 2, [&](int, int worker) {
      if (worker == 0) {
        while (!is_begun) std::this_thread::yield();
        return;
      }
      is_in_task = is_begun = true;
      std::this_thread::yield();  // to the caller, which then waits
      // Longer than what the kernel gives ordinary threads when real-time ones have used up their share.
      for (timespec used{}; used.tv_sec == 0 && used.tv_nsec < 200'000'000;) {
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
      }
      is_in_task = false;
    });
    is_done = true;
    between.join();
  });
  caller.join();
  if (!may_be_real_time) GTEST_SKIP() << "this machine gives nobody a real-time priority";
  EXPECT_EQ(num_seen.load(), 0);
}

// ---- Mask -----------------------------------------------------------------------------------------------------------

TEST(ExclusionMask, DilationReachesExactlyAsFarAsAsked) {
  constexpr int kWidth = 61;
  constexpr int kHeight = 47;
  for (const int dilation : {0, 1, 2, 3, 4, 5, 8, 13}) {
    std::vector<std::uint8_t> grey(kWidth * kHeight, 100);
    std::mt19937 random(dilation);
    std::vector<std::pair<int, int>> bright;
    for (int i = 0; i < 6; ++i) {
      bright.emplace_back(random() % kWidth, random() % kHeight);
      grey[bright.back().second * kWidth + bright.back().first] = 250;
    }
    ExclusionMask mask(kWidth, kHeight, {245, 0, dilation});
    mask.Build(grey.data(), kWidth, kHeight, kWidth, {});
    for (int octave = 0; octave < 3; ++octave) {
      for (int y = 0; y < kHeight >> octave; ++y) {
        for (int x = 0; x < kWidth >> octave; ++x) {
          bool is_near = false;
          for (const auto& [bx, by] : bright) {
            is_near |= std::abs((bx >> octave) - x) <= dilation && std::abs((by >> octave) - y) <= dilation;
          }
          ASSERT_EQ(mask.IsExcluded(octave, static_cast<float>(x) + 0.5f, static_cast<float>(y)), is_near)
              << "octave " << octave << " at " << x << ", " << y << ", dilation " << dilation;
        }
      }
    }
  }
}

TEST(ExclusionMask, SurroundIsWhatIsDarkAsFarAsAnEdge) {
  constexpr int kSide = 40;
  std::vector<std::uint8_t> grey(kSide * kSide, 100);
  const auto set = [&](int x0, int y0, int x1, int y1, std::uint8_t value) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) grey[y * kSide + x] = value;
    }
  };
  set(0, 0, 5, kSide, 3);     // left side
  set(20, 30, 24, kSide, 3);  // a bay at the bottom
  set(15, 10, 25, 20, 3);     // a dark lumen
  ExclusionMask mask(kSide, kSide, {256, 12, 0});
  mask.Build(grey.data(), kSide, kSide, kSide, {});
  EXPECT_TRUE(mask.IsExcluded(0, 2.0f, 20.0f));
  EXPECT_TRUE(mask.IsExcluded(0, 4.9f, 39.0f));
  EXPECT_FALSE(mask.IsExcluded(0, 5.0f, 20.0f));
  EXPECT_TRUE(mask.IsExcluded(0, 21.0f, 31.0f));
  EXPECT_FALSE(mask.IsExcluded(0, 20.0f, 15.0f));
  EXPECT_FALSE(mask.IsExcluded(0, 30.0f, 5.0f));
}

// ---- Selection ------------------------------------------------------------------------------------------------------

std::vector<ScaleSpacePoint> RandomPoints(int count, float width, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::vector<ScaleSpacePoint> points(count);
  for (ScaleSpacePoint& p : points) {
    p.octave = static_cast<std::int16_t>(static_cast<int>(random() % 3) - 1);
    p.x = unit(random) * width / std::exp2(static_cast<float>(p.octave));
    p.y = unit(random) * 240.0f / std::exp2(static_cast<float>(p.octave));
    p.response = 0.01f + unit(random);
  }
  return points;
}

TEST(FeatureSelection, FewerPointsThanWantedAreAllKept) {
  FeatureSelection selection(320, 240, 1000);
  EXPECT_TRUE(selection.Select({}, 320, 240, 50).empty());
  const std::vector<ScaleSpacePoint> points = RandomPoints(40, 320, 1);
  std::vector<int> seen(40, 0);
  for (const std::int32_t i : selection.Select(points, 320, 240, 50)) ++seen[i];
  EXPECT_EQ(seen, std::vector<int>(40, 1));
}

TEST(FeatureSelection, StrongestOfAPlaceComeFirst) {
  FeatureSelection selection(320, 240, 1000);
  std::vector<ScaleSpacePoint> points(100);
  for (int i = 0; i < 100; ++i) {
    points[i].x = points[i].y = 30.0f;
    points[i].response = static_cast<float>((i * 37) % 100 + 1);
  }
  const auto selected = selection.Select(points, 320, 240, 10);
  ASSERT_EQ(selected.size(), 10u);
  for (int k = 0; k < 10; ++k) EXPECT_EQ(points[selected[k]].response, static_cast<float>(100 - k));
}

TEST(FeatureSelection, CrowdedPlacesGiveWayToPoorerOnes) {
  FeatureSelection selection(320, 240, 2000);
  // Left third: many strong points. Elsewhere: fewer, of half the strength.
  std::vector<ScaleSpacePoint> points = RandomPoints(1000, 100, 2);
  for (ScaleSpacePoint& p : points) p.response = 0.2f + 0.1f * p.response;
  std::vector<ScaleSpacePoint> poor = RandomPoints(400, 320, 3);
  for (ScaleSpacePoint& p : poor) p.response = 0.1f + 0.05f * p.response;
  points.insert(points.end(), poor.begin(), poor.end());
  int num_poor = 0;
  for (const std::int32_t i : selection.Select(points, 320, 240, 300)) num_poor += i >= 1000 ? 1 : 0;
  EXPECT_GT(num_poor, 60);
  EXPECT_LT(num_poor, 240);
}

TEST(FeatureSelection, TiesGoToTheLowestIndex) {
  FeatureSelection selection(320, 240, 100);
  std::vector<ScaleSpacePoint> points(30);
  for (ScaleSpacePoint& p : points) p.response = 0.5f;
  const auto selected = selection.Select(points, 320, 240, 10);
  ASSERT_EQ(selected.size(), 10u);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(selected[i], i);
}

// ---- Scale space ----------------------------------------------------------------------------------------------------

// Planes with a difference of Gaussians that is a quadratic with its extremum at (x, y, level).
struct QuadraticOctave {
  static constexpr int kSide = 40;
  std::vector<float> memory;
  Plane levels[kNumLevels];

  QuadraticOctave(double x, double y, double level, double height, double curvature_x, double curvature_y) {
    memory.resize(static_cast<std::size_t>(kNumLevels) * kSide * kSide, 0.0f);
    for (int l = 0; l < kNumLevels; ++l) {
      levels[l] = {memory.data() + static_cast<std::size_t>(l) * kSide * kSide, kSide, kSide, kSide};
    }
    for (int l = 1; l < kNumLevels; ++l) {
      for (int r = 0; r < kSide; ++r) {
        for (int c = 0; c < kSide; ++c) {
          const double d = height - curvature_x * (c - x) * (c - x) - curvature_y * (r - y) * (r - y) -
                           0.1 * (l - 1 - level) * (l - 1 - level);
          levels[l].row(r)[c] = levels[l - 1].row(r)[c] + static_cast<float>(d);
        }
      }
    }
  }
};

TEST(RefineExtremum, FindsTheVertexOfAQuadratic) {
  const QuadraticOctave octave(17.3, 20.8, 2.2, 0.5, 0.05, 0.04);
  ScaleSpacePoint point;
  // From a neighbour of the nearest grid point.
  ASSERT_TRUE(RefineExtremum(octave.levels, {18, 20, 2, 0.5f}, {0.01f, 10.0f}, &point));
  EXPECT_NEAR(point.x, 17.3, 1e-3);
  EXPECT_NEAR(point.y, 20.8, 1e-3);
  EXPECT_NEAR(point.scale, kBaseSigma * std::exp2(2.2 / kScalesPerOctave), 1e-3);
  EXPECT_NEAR(point.response, 0.5, 1e-4);
  EXPECT_EQ(point.level, 2);
}

TEST(RefineExtremum, RefusesWeakPointsAndEdges) {
  ScaleSpacePoint point;
  const QuadraticOctave octave(17.3, 20.8, 2.0, 0.5, 0.05, 0.05);
  EXPECT_FALSE(RefineExtremum(octave.levels, {17, 21, 2, 0.5f}, {0.51f, 10.0f}, &point));
  const QuadraticOctave edge(17.3, 20.8, 2.0, 0.5, 0.05, 0.05 / 12);
  EXPECT_FALSE(RefineExtremum(edge.levels, {17, 21, 2, 0.5f}, {0.01f, 10.0f}, &point));
  EXPECT_TRUE(RefineExtremum(edge.levels, {17, 21, 2, 0.5f}, {0.01f, 14.0f}, &point));
  // The vertex lies outside the octave.
  const QuadraticOctave outside(1.0, 20.8, 2.0, 0.5, 0.05, 0.05);
  EXPECT_FALSE(RefineExtremum(outside.levels, {6, 21, 2, 0.5f}, {0.01f, 10.0f}, &point));
}

TEST(FindExtrema, WithoutRoomForAllKeepsTheStrongest) {
  const SiftKernels& kernels = SiftKernelsFor(SimdLevel::kPortable);
  constexpr int kWidth = 160;
  constexpr int kHeight = 64;
  constexpr int kStride = 176;
  constexpr int kPlane = kStride * kHeight + 2 * kPlanePadding;
  std::vector<float> memory(static_cast<std::size_t>(kPlane) * kNumLevels, 0.0f);
  Plane levels[kNumLevels];
  for (int l = 0; l < kNumLevels; ++l) {
    levels[l] = {memory.data() + static_cast<std::size_t>(l) * kPlane + kPlanePadding, kWidth, kHeight, kStride};
  }
  // Peaks of the difference between levels 2 and 3, of different heights.
  std::mt19937 random(1);
  std::vector<float> heights;
  for (int y = 8; y < kHeight - 8; y += 4) {
    for (int x = 8; x < kWidth - 8; x += 4) {
      const float height = 0.1f + 0.001f * static_cast<float>(random() % 1000);
      for (int l = 3; l < kNumLevels; ++l) levels[l].row(y)[x] = height;
      heights.push_back(height);
    }
  }
  std::vector<float> scratch(kExtremaScratchFloats);
  std::vector<Extremum> extrema(heights.size());
  const int all =
      kernels.FindExtrema(levels, 0.05f, 0, kHeight, extrema.data(), static_cast<int>(extrema.size()), scratch.data());
  EXPECT_EQ(all, static_cast<int>(heights.size()));
  const int capacity = 100;
  const int some = kernels.FindExtrema(levels, 0.05f, 0, kHeight, extrema.data(), capacity, scratch.data());
  ASSERT_GE(some, 20);
  ASSERT_LE(some, capacity);
  float weakest = 1e9f;
  for (int i = 0; i < some; ++i) weakest = std::min(weakest, extrema[i].response);
  int num_as_strong = 0;
  for (const float height : heights) num_as_strong += height >= weakest ? 1 : 0;
  EXPECT_EQ(num_as_strong, some);
}

TEST(BlurRows, AgreesWithConvolutionInDouble) {
  constexpr int kWidth = 37;
  constexpr int kHeight = 29;
  constexpr int kStride = 64;
  std::mt19937 random(1);
  std::vector<float> in(kStride * kHeight, 0.0f), out(kStride * kHeight, 0.0f), scratch(kStride + 4 * kPlanePadding);
  for (float& value : in) value = static_cast<float>(random() % 1000) / 1000.0f;
  for (const SimdLevel level : {SimdLevel::kPortable, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
    if (!IsSupported(level)) continue;
    for (int radius = 1; radius <= kMaxKernelRadius; ++radius) {
      GaussianKernel kernel;
      kernel.radius = radius;
      for (int j = 0; j <= radius; ++j) kernel.weights[j] = 1.0f / static_cast<float>(1 + j + radius);
      SiftKernelsFor(level).BlurRows({in.data(), kWidth, kHeight, kStride}, {out.data(), kWidth, kHeight, kStride},
                                     kernel, 0, kHeight, scratch.data());
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          double sum = 0.0;
          for (int dy = -radius; dy <= radius; ++dy) {
            for (int dx = -radius; dx <= radius; ++dx) {
              const int sy = std::clamp(y + dy, 0, kHeight - 1);
              const int sx = std::clamp(x + dx, 0, kWidth - 1);
              sum += static_cast<double>(kernel.weights[std::abs(dy)]) * kernel.weights[std::abs(dx)] *
                     in[sy * kStride + sx];
            }
          }
          ASSERT_NEAR(out[y * kStride + x], sum, 2e-6 * std::max(1.0, sum)) << ToString(level) << " radius " << radius;
        }
      }
    }
  }
}

}  // namespace
}  // namespace haustra::kernels
