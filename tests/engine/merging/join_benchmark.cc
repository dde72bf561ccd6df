// How long a keyframe waits for a join. Joins synthetic maps of 300, 1000 and 3000 keyframes, seen by the scripted
// device, in slices as real-time mode does, and puts a keyframe between any two slices as mapping would. One that comes
// at the worst moment waits for the longest slice and the snapshot that is built after it. Loop: half of the keyframes
// out, half back, with drift. Merge: two maps of half the size, so that as much as possible moves.
//
//     join_benchmark [--cpu] [KEYFRAMES...]      --cpu: time of this thread, for a machine that others use, too
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/atlas/local_map.h"
#include "engine/merging/merger.h"
#include "tests/engine/merging/known_join.h"

namespace haustra::test {
namespace {

class ChosenClock final : public Clock {
 public:
  explicit ChosenClock(bool is_cpu) : id_(is_cpu ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC) {}
  TimePoint Now() const override {
    timespec time{};
    clock_gettime(id_, &time);
    return TimePoint(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
  }

 private:
  clockid_t id_;
};

double Milliseconds(Duration duration) { return std::chrono::duration<double, std::milli>(duration).count(); }

// The drift of a whole loop is the same however many keyframes it has.
LoopShape ShapeOf(int num_keyframes) {
  const double n = num_keyframes;
  LoopShape shape;
  shape.num_keyframes = num_keyframes;
  shape.step = 0.2;
  shape.landmarks_per_length = 240.0;
  shape.drift =
      Sim3(1.0 + 0.1 / n, ExpSO3(Eigen::Vector3d(0.05, -0.025, 0.025) / n), Eigen::Vector3d(0.3, 0.2, -0.3) / n);
  return shape;
}

bool Measure(int num_keyframes, bool is_loop, bool is_sliced, const ChosenClock& clock) {
  KnownJoin join(5, num_keyframes + 200);
  if (is_loop) {
    MakeLoop(ShapeOf(num_keyframes), &join);
  } else {
    const Sim3 moved(0.6, ExpSO3({-0.2, 0.7, 1.1}), {1.0, 3.0, -2.0});
    MakeTwoMaps(num_keyframes / 2, num_keyframes / 2, 0.2, Sim3{}, moved, &join);
    join.plan.b_from_a.translation += Eigen::Vector3d(0.03, -0.02, 0.02);
  }
  const NoiseModel noise{join.colon.config().noise};
  const MergingConfig options;
  SchurBundleAdjuster adjuster;
  Merger merger(join.colon.config(), options, noise, join.colon.camera(), join.colon.device(), adjuster);
  LocalMapBuilder builder(join.colon.config().memory.max_keyframes, join.colon.config().memory.max_map_points);
  LocalMap snapshot(join.colon.config().memory.max_local_points);
  const std::uint32_t num_points = join.atlas.points().size();

  Duration longest{0}, total{0}, publishing{0};
  int num_slices = 0, num_added = 0, newest = join.frame_a;
  TimePoint start = clock.Now();
  if (!merger.Begin(join.plan, join.atlas).ok()) return false;
  for (bool is_done = false; !is_done;) {
    const JoinLimits limits{
        &clock, is_sliced ? start + std::chrono::milliseconds(options.slice_milliseconds) : kNoDeadline, kNoDeadline};
    const Result<Merger::Progress> progress = merger.Step(limits, join.frame(newest).keyframe, &join.atlas);
    if (!progress.ok()) return false;
    is_done = *progress == Merger::Progress::kDone;
    if (merger.outcome().is_reframed || is_done) {
      const TimePoint begin = clock.Now();
      builder.Build(join.atlas, join.frame(newest).keyframe, &snapshot);
      publishing = std::max(publishing, clock.Now() - begin);
    }
    const Duration waited = clock.Now() - start;
    longest = std::max(longest, waited);
    total += waited;
    ++num_slices;
    if (is_sliced && !is_done && num_added < 100) {
      newest = join.InsertBeside(newest, num_added++ % 2 == 0 ? 0.1 : -0.08);
    }
    start = clock.Now();
  }
  const bool is_sound = CheckInvariants(join.atlas).ok() && join.RelativeError(join.frame_a, join.frame_b) < 0.05;
  std::printf("| %d | %u | %s | %s | %d | %.0f | %.0f | %.1f |%s\n", num_keyframes, num_points,
              is_loop ? "loop" : "merge", is_sliced ? "slices" : "one piece", num_slices, Milliseconds(total),
              Milliseconds(longest), Milliseconds(publishing), is_sound ? "" : " WRONG RESULT");
  std::fflush(stdout);
  return is_sound;
}

}  // namespace
}  // namespace haustra::test

int main(int argc, char** argv) {
  bool is_cpu = false;
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--cpu") == 0) {
      is_cpu = true;
    } else {
      sizes.push_back(std::atoi(argv[i]));
    }
  }
  if (sizes.empty()) sizes = {300, 1000, 3000};
  const haustra::test::ChosenClock clock(is_cpu);
  std::printf("| keyframes | points | join | made in | slices | all, ms | longest wait, ms | of it snapshot, ms |\n");
  std::printf("|---:|---:|---|---|---:|---:|---:|---:|\n");
  bool is_sound = true;
  for (const int size : sizes) {
    for (const bool is_loop : {true, false}) {
      for (const bool is_sliced : {false, true}) {
        is_sound = haustra::test::Measure(size, is_loop, is_sliced, clock) && is_sound;
      }
    }
  }
  return is_sound ? 0 : 1;
}
