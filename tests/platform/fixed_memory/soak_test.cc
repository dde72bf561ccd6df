// The soak run judges its own process: a session that leaks must fail it, one that does not must pass.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "hal/fakes/manual_clock.h"
#include "hal/fakes/scripted_frame_source.h"
#include "tests/sanitized.h"
#include "tests/tools/run/scripted_colon.h"
#include "tools/soak/looping_source.h"
#include "tools/soak/soak_monitor.h"

namespace haustra {
namespace {

using testing::HasSubstr;

// Hands everything on, and may keep memory for every frame, or a feature set for every tenth one.
class LeakingObserver final : public SessionObserver {
 public:
  LeakingObserver(SoakMonitor* monitor, std::size_t bytes_a_frame) : monitor_(monitor), bytes_(bytes_a_frame) {}
  void OnFrame(const FrameOutcome& outcome) override {
    if (bytes_ > 0) {
      leaked_.push_back(std::make_unique<char[]>(bytes_));
      std::memset(leaked_.back().get(), 1, bytes_);
    }
    if (sets_of_ != nullptr && outcome.result.frame_index % 10 == 0) {
      EXPECT_TRUE(sets_of_->CreateFeatureSet().ok());
    }
    FrameOutcome slowed = outcome;
    slowed.latency = std::chrono::milliseconds(10) + drift_ * static_cast<int>(outcome.result.frame_index);
    monitor_->OnFrame(slowed);
  }
  void OnMapEvent(const MapEvent& event) override { monitor_->OnMapEvent(event); }
  void OnLatePose(const LatePose&) override {}
  void OnDamagedFrame(std::uint32_t, const std::string&) override {}
  void Drift(Duration a_frame) { drift_ = a_frame; }
  void LoseSetsOf(VisionDevice* device) { sets_of_ = device; }

 private:
  SoakMonitor* monitor_;
  std::size_t bytes_;
  Duration drift_{0};
  VisionDevice* sets_of_ = nullptr;
  std::vector<std::unique_ptr<char[]>> leaked_;
};

SoakOptions Quick() {
  SoakOptions options;
  options.interval = std::chrono::milliseconds(400);
  options.warm_up = std::chrono::seconds(4);
  options.max_pool_ratio = 1.25;  // sequential procedures repeat
  return options;
}

struct SoakOutcome {
  SoakVerdict verdict;
  std::vector<SoakSample> samples;
};

struct Faults {
  std::size_t bytes_a_frame = 0;
  Duration drift{0};
  bool loses_sets = false;
};

// Procedures as far into the colon as `depths` says.
SoakOutcome Soak(const Faults& faults, const std::vector<double>& depths = {1.2}) {
  SoakOutcome outcome;
  SoakOptions options = Quick();
  // Sanitizers keep what a procedure frees.
  if (test::kIsSanitized && depths.size() > 1) options.max_growth_mb = 200.0;
  SoakMonitor monitor(
      options, [&](const SoakSample& sample) { outcome.samples.push_back(sample); }, nullptr);
  for (const double depth : depths) {
    test::ScriptedColon colon;
    colon.Move(0.0, depth, 40);
    colon.Occlude(5);
    colon.Move(depth - 0.1, 0.1, 40);
    // What is judged shows nothing, and so is quick: the leak is the observer's.
    colon.Occlude(215);
    const auto engine = colon.MakeEngine();
    LeakingObserver observer(&monitor, faults.bytes_a_frame);
    observer.Drift(faults.drift);
    if (faults.loses_sets) observer.LoseSetsOf(&colon.device());
    const std::atomic<bool> never{false};
    monitor.Begin(*engine);
    EXPECT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), observer, never).ok());
  }
  outcome.verdict = monitor.Judge();
  return outcome;
}

TEST(Soak, SteadySessionPasses) {
  const SoakOutcome outcome = Soak({});
  EXPECT_TRUE(outcome.verdict.is_passed) << outcome.verdict.text;
  EXPECT_THAT(outcome.verdict.text, HasSubstr("passed"));
  ASSERT_GT(outcome.samples.size(), 20u);
  std::uint32_t num_frames = 0;
  for (const SoakSample& sample : outcome.samples) {
    EXPECT_GT(sample.rss_mb, 1.0);
    EXPECT_NEAR(sample.p50_ms, 10.0, 1e-3);
    num_frames += sample.frames;
  }
  EXPECT_GT(num_frames, 280u);
  EXPECT_GT(outcome.samples.back().pools.keyframes, 5u);
  EXPECT_GT(outcome.samples.back().pools.map_points, 300u);
}

TEST(Soak, LeakFails) {
  // 200 kB a frame for 200 frames after the warm-up: 30 MB between the middles of the first and the last quarter.
  const SoakOutcome outcome = Soak({.bytes_a_frame = 200'000});
  EXPECT_FALSE(outcome.verdict.is_passed);
  EXPECT_THAT(outcome.verdict.text, HasSubstr("resident memory grew by"));
  EXPECT_GT(outcome.verdict.growth_mb, 25.0);
  // The thread sanitizer keeps four bytes and more for each that is written.
  EXPECT_LT(outcome.verdict.growth_mb, test::kIsSanitized ? 300.0 : 35.0);
}

TEST(Soak, LatencyDriftFails) {
  const SoakOutcome outcome = Soak({.drift = std::chrono::microseconds(100)});
  EXPECT_FALSE(outcome.verdict.is_passed);
  EXPECT_THAT(outcome.verdict.text, HasSubstr("median latency drifted"));
}

TEST(Soak, FeatureSetsThatNobodyReleasesFail) {
  const SoakOutcome outcome = Soak({.loses_sets = true});
  EXPECT_FALSE(outcome.verdict.is_passed);
  EXPECT_THAT(outcome.verdict.text, HasSubstr("feature sets that belong to no keyframe grew from"));
  EXPECT_THAT(outcome.verdict.text, HasSubstr("in procedure 1"));
}

TEST(Soak, ProceduresThatAreAlikePass) {
  const SoakOutcome outcome = Soak({}, {1.2, 1.2, 1.2, 1.2});
  EXPECT_TRUE(outcome.verdict.is_passed) << outcome.verdict.text;
  EXPECT_THAT(outcome.verdict.text, HasSubstr("pools of 4 procedures steady"));
  // Time runs on, and each begins with empty pools.
  for (std::size_t i = 1; i < outcome.samples.size(); ++i) {
    const SoakSample& before = outcome.samples[i - 1];
    const SoakSample& sample = outcome.samples[i];
    EXPECT_GT(sample.video_s, before.video_s);
    EXPECT_GE(sample.loose_sets, 0);
    if (sample.procedure == before.procedure) continue;
    EXPECT_EQ(sample.procedure, before.procedure + 1);
    EXPECT_LT(sample.procedure_s, 1.0);
    EXPECT_LT(sample.pools.keyframes, before.pools.keyframes);
  }
  EXPECT_EQ(outcome.samples.back().procedure, 3);
}

TEST(Soak, ProceduresThatUseMoreAndMoreOfAPoolFail) {
  const SoakOutcome outcome = Soak({}, {1.2, 1.2, 2.0, 2.4});
  EXPECT_FALSE(outcome.verdict.is_passed);
  EXPECT_THAT(outcome.verdict.text, HasSubstr("map points in use grew from"));
  EXPECT_THAT(outcome.verdict.text, HasSubstr("over 4 procedures"));
  EXPECT_TRUE(Soak({}, {2.4, 2.0, 1.2, 1.2}).verdict.is_passed);
}

TEST(Soak, TooShortARunProvesNothing) {
  test::ScriptedColon colon;
  colon.Occlude(120);
  const auto engine = colon.MakeEngine();
  SoakMonitor monitor(Quick(), nullptr, nullptr);
  monitor.Begin(*engine);
  const std::atomic<bool> never{false};
  EXPECT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), monitor, never).ok());
  EXPECT_FALSE(monitor.Judge().is_passed);
  EXPECT_THAT(monitor.Judge().text, HasSubstr("samples after the warm-up"));
}

// Five frames, 40 ms apart, the second of them damaged.
Result<std::unique_ptr<FrameSource>> FiveFrames(bool) {
  auto source = std::make_unique<ScriptedFrameSource>(test::ColonCalibration());
  for (int i = 0; i < 5; ++i) {
    if (i == 1) {
      source->AddFailure(StatusCode::kDataLoss, "damaged");
    } else {
      source->AddFrame(TimePoint(std::chrono::milliseconds(7000 + 40 * i)));
    }
  }
  return std::unique_ptr<FrameSource>(std::move(source));
}

TEST(LoopingSource, NumbersAndTimeRunOn) {
  for (const bool back_and_forth : {false, true}) {
    std::vector<bool> directions;
    auto source = LoopingSource::Create(
        [&](bool reversed) {
          directions.push_back(reversed);
          return FiveFrames(reversed);
        },
        back_and_forth, std::chrono::seconds(1));
    ASSERT_TRUE(source.ok());
    std::uint32_t next = 0;
    TimePoint last;
    for (Result<Frame> frame = (*source)->Next(kNoDeadline); frame.code() != StatusCode::kNotFound;
         frame = (*source)->Next(kNoDeadline)) {
      if (frame.ok()) {
        EXPECT_EQ(frame->index, next);
        if (next > 0) {
          EXPECT_GT(frame->timestamp, last);
          EXPECT_LE(frame->timestamp - last, std::chrono::milliseconds(80));
        }
        last = frame->timestamp;
      }
      ++next;
    }
    EXPECT_EQ(last, TimePoint(std::chrono::milliseconds(7960)));
    ASSERT_GT(directions.size(), 3u);
    for (std::size_t i = 0; i < directions.size(); ++i) EXPECT_EQ(directions[i], back_and_forth && i % 2 == 1) << i;
  }
}

TEST(LoopingSource, SequenceWithoutFramesIsAnError) {
  auto source = LoopingSource::Create(
      [](bool) -> Result<std::unique_ptr<FrameSource>> {
        return std::unique_ptr<FrameSource>(std::make_unique<ScriptedFrameSource>(test::ColonCalibration()));
      },
      true, std::chrono::seconds(1));
  ASSERT_TRUE(source.ok());
  EXPECT_EQ((*source)->Next(kNoDeadline).code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace haustra
