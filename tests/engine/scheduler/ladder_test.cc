// The tracker on a device that takes time, on a clock that the test moves: rung by rung down, back up again, and never
// a deadline missed by waiting.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "engine/engine.h"
#include "hal/fakes/manual_clock.h"
#include "hal/fakes/timed_vision_device.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using test::kFramePeriod;
using test::ScriptedColon;

constexpr Duration kLostTime = milliseconds(100);  // SchedulerConfig::lost_time_ms

constexpr TimedVisionDevice::Model kFast{.extract = milliseconds(4),
                                         .match = milliseconds(3),
                                         .guided = milliseconds(1),
                                         .per_feature = microseconds(10),
                                         .per_query = microseconds(4)};

struct Answer {
  FrameResult result;
  Duration latency{0};
};

// Frame after frame as a camera would bring them; mapping between them takes no time.
class Camera {
 public:
  explicit Camera(int num_frames, bool degrade = true, double reduced_share = 0.5)
      : Camera([=](ScriptedColon& colon) {
          colon.config().scheduler.degrade = degrade;
          colon.config().scheduler.reduced_share = reduced_share;
          colon.Move(0.0, 0.03 * num_frames, num_frames);
        }) {}
  explicit Camera(const std::function<void(ScriptedColon&)>& script)
      : device_(colon_.device(), clock_, [this](TimePoint time) { clock_.AdvanceTo(time); }) {
    script(colon_);
    device_.SetModel(kFast);
    engine_ = colon_.MakeEngine(Engine::Mode::kRealTime, device_, &clock_);
  }

  // One frame: at its time, or as soon as the last one is done; of several the newest.
  Answer Next() {
    EXPECT_TRUE(engine_->MayReleaseFrame(clock_.Now() + milliseconds(1000)));
    Result<Frame> frame = colon_.source().Next(kNoDeadline);
    const Duration period = colon_.period();
    while (frame.ok() && frame->timestamp + period <= clock_.Now()) frame = colon_.source().Next(kNoDeadline);
    EXPECT_TRUE(frame.ok());
    next_index_ = frame->index + 1;
    frame->index -= first_index_;
    const TimePoint due = frame->timestamp;
    clock_.AdvanceTo(due);
    Answer answer;
    answer.result = engine_->Track(*frame, due + period, due + period);
    answer.latency = clock_.Now() - due;
    // Maps are made at once: what the mapper asks of the device costs nothing here.
    const TimedVisionDevice::Model model = model_;
    device_.SetModel({});
    while (engine_->BackgroundStep()) {
    }
    device_.SetModel(model);
    return answer;
  }
  std::vector<Answer> Next(int num) {
    std::vector<Answer> answers;
    for (int i = 0; i < num; ++i) answers.push_back(Next());
    return answers;
  }
  void SetModel(const TimedVisionDevice::Model& model) {
    model_ = model;
    device_.SetModel(model);
  }

  // Frames are numbered from 0 again.
  void BeginSession() {
    engine_->BeginSession();
    first_index_ = next_index_;
  }

  ScriptedColon& colon() { return colon_; }
  ManualClock& clock() { return clock_; }

 private:
  ScriptedColon colon_;
  ManualClock clock_;
  TimedVisionDevice device_;
  TimedVisionDevice::Model model_ = kFast;
  std::unique_ptr<Engine> engine_;
  std::uint32_t first_index_ = 0, next_index_ = 0;
};

int Count(const std::vector<Answer>& answers, Rung rung) {
  int count = 0;
  for (const Answer& answer : answers) count += answer.result.rung == rung;
  return count;
}

void ExpectInTime(const std::vector<Answer>& answers) {
  for (const Answer& answer : answers) EXPECT_LE(answer.latency, kFramePeriod) << answer.result.frame_index;
}

TEST(Ladder, FastDeviceTracksWithEverything) {
  Camera camera(150);
  camera.Next(60);
  const std::vector<Answer> answers = camera.Next(90);
  EXPECT_EQ(Count(answers, Rung::kFull), 90);
  for (const Answer& answer : answers) EXPECT_EQ(answer.result.state, TrackingState::kTracking);
  ExpectInTime(answers);
}

TEST(Ladder, SlowerDeviceIsMetRungByRungAndLeftWhenItIsFastAgain) {
  Camera camera(420);
  camera.Next(100);
  TimedVisionDevice::Model slow = kFast;

  // Full extraction: 4 + 600 * 0.06 = 40 ms. Half the features: 22 ms.
  slow.per_feature = microseconds(60);
  camera.SetModel(slow);
  const std::vector<Answer> fewer_features = camera.Next(40);
  ExpectInTime(fewer_features);
  EXPECT_LE(Count(fewer_features, Rung::kPredicted), 4) << "until it is known, and when it is tried again";
  EXPECT_GE(Count(fewer_features, Rung::kFewerFeatures), 30);
  for (const Answer& answer : fewer_features) {
    EXPECT_EQ(answer.result.state, TrackingState::kTracking);
    if (answer.result.rung != Rung::kFewerFeatures) continue;
    EXPECT_LE(answer.result.num_features, 300) << answer.result.frame_index;
  }

  // The searches now take so long that the local map must shrink, too.
  slow.per_query = microseconds(35);
  camera.SetModel(slow);
  const std::vector<Answer> fewer_points = camera.Next(80);
  ExpectInTime(fewer_points);
  EXPECT_GE(Count(fewer_points, Rung::kFewerPoints), 20);

  camera.SetModel(kFast);
  ExpectInTime(camera.Next(100));
  const std::vector<Answer> again = camera.Next(60);
  EXPECT_EQ(Count(again, Rung::kFull), 60);
  ExpectInTime(again);
}

// A quarter of the features is a quarter of the points in sight: neither a view to be lost in nor a reason to make no
// keyframes, nor one to make many.
TEST(Ladder, LongTimeWithFewerFeaturesIsTrackedAndMappedAsUsual) {
  const auto count_keyframes = [](const std::vector<Answer>& answers) {
    return std::count_if(answers.begin(), answers.end(), [](const Answer& a) { return a.result.is_keyframe; });
  };
  Camera fast(420);
  fast.Next(120);
  const auto usual = count_keyframes(fast.Next(300));

  Camera slow(420, true, 0.25);
  slow.Next(100);
  TimedVisionDevice::Model model = kFast;
  model.per_feature = microseconds(60);
  slow.SetModel(model);
  slow.Next(20);
  const std::vector<Answer> answers = slow.Next(300);
  EXPECT_GE(Count(answers, Rung::kFewerFeatures), 250);
  for (const Answer& answer : answers) {
    EXPECT_EQ(answer.result.state, TrackingState::kTracking) << answer.result.frame_index;
  }
  EXPECT_GE(count_keyframes(answers), usual / 2);
  EXPECT_LE(count_keyframes(answers), usual * 2);
}

// A map that was made of few features shows little of what all of them show, and the other way round: a change of rung
// is no reason to be lost.
TEST(Ladder, ChangeOfRungAfterALongTimeLosesNothing) {
  Camera camera(700, true, 0.25);
  camera.Next(100);
  TimedVisionDevice::Model slow = kFast;
  slow.per_feature = microseconds(60);
  for (const auto& [model, num_frames] : {std::pair{slow, 300}, {kFast, 150}, {slow, 100}}) {
    camera.SetModel(model);
    for (const Answer& answer : camera.Next(num_frames)) {
      EXPECT_EQ(answer.result.state, TrackingState::kTracking) << answer.result.frame_index;
    }
  }
}

TEST(Ladder, StalledDeviceIsAnsweredWithPredictionsAndThenHonestlyWithLost) {
  Camera camera(200);
  const std::vector<Answer> before = camera.Next(100);
  ASSERT_EQ(before.back().result.state, TrackingState::kTracking);
  TimedVisionDevice::Model stalled = kFast;
  stalled.extract = milliseconds(160);
  camera.SetModel(stalled);
  const std::vector<Answer> answers = camera.Next(8);
  constexpr int allowed = 2;  // 200 ms: each stall takes the time of four frames
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(answers[i].result.rung, Rung::kPredicted) << i;
    EXPECT_EQ(answers[i].result.reason, i < allowed ? TrackingReason::kPredicted : TrackingReason::kNoTime) << i;
    EXPECT_EQ(answers[i].result.state, i < allowed ? TrackingState::kTracking : TrackingState::kLost) << i;
    EXPECT_FALSE(answers[i].result.is_keyframe);
    EXPECT_LE(answers[i].latency, i <= allowed ? kFramePeriod : kFramePeriod + kLostTime) << i;
  }
}

// The pose that the mapper has answered with is of an earlier frame, and nothing has been measured in its map.
TEST(Ladder, FoundPlaceThatThereWasNoTimeToTryIsNoPoseAndIsTriedAgain) {
  const auto come_back = [](ScriptedColon& colon) {
    colon.Move(0.0, 4.0, 100);
    colon.Occlude(5);
    colon.Move(12.0, 15.0, 75);
    colon.Occlude(5);
    colon.Move(2.0, 1.0, 25);
  };
  Camera undisturbed(come_back), camera(come_back);
  std::vector<Answer> answers = undisturbed.Next(150);
  const MapId second = answers.back().result.map_id;
  const auto is_back = [&](const FrameResult& result) {
    return result.reason == TrackingReason::kRelocalised && result.map_id != second;
  };
  while (answers.size() < 195 && !is_back(answers.back().result)) answers.push_back(undisturbed.Next());
  ASSERT_TRUE(is_back(answers.back().result));
  const MapId first = answers.back().result.map_id;

  camera.Next(static_cast<int>(answers.size()) - 1);
  TimedVisionDevice::Model stalled = kFast;
  stalled.guided = milliseconds(400);
  camera.SetModel(stalled);
  const FrameResult untried = camera.Next().result;
  EXPECT_EQ(untried.state, TrackingState::kLost);
  EXPECT_EQ(untried.reason, TrackingReason::kNoTime);
  camera.SetModel(kFast);
  FrameResult found;
  for (int i = 0; i < 5 && found.state != TrackingState::kTracking; ++i) found = camera.Next().result;
  EXPECT_EQ(found.reason, TrackingReason::kRelocalised) << ToString(found.reason);
  EXPECT_EQ(found.map_id, first);
  EXPECT_FALSE(found.is_keyframe);
}

// Nor does a new map end before it was tried, however long the device takes.
TEST(Ladder, NewMapThatThereWasNoTimeToTryIsTriedAgain) {
  Camera camera(200);
  FrameResult proposed = camera.Next().result;
  while (proposed.reason != TrackingReason::kMapProposed) proposed = camera.Next().result;
  TimedVisionDevice::Model stalled = kFast;
  stalled.guided = milliseconds(400);
  camera.SetModel(stalled);
  const FrameResult untried = camera.Next().result;
  EXPECT_NE(untried.state, TrackingState::kTracking);
  EXPECT_EQ(untried.reason, TrackingReason::kNoTime);
  camera.SetModel(kFast);
  FrameResult later = untried;
  for (int i = 0; i < 15 && later.reason == TrackingReason::kNoTime; ++i) later = camera.Next().result;
  EXPECT_GE(later.frame_index, untried.frame_index + 6) << "a prediction would have lasted";
  EXPECT_EQ(later.reason, TrackingReason::kTracked) << ToString(later.reason);
  EXPECT_EQ(later.map_id, 0);
}

// Too slow for the deadline, but not for a scope that is lost.
TEST(Ladder, LostFrameTakesItsTimeAndAllFeatures) {
  Camera camera(200);
  camera.Next(100);
  TimedVisionDevice::Model slow = kFast;
  slow.extract = milliseconds(60);
  camera.SetModel(slow);
  const std::vector<Answer> answers = camera.Next(6);
  const Answer& lost = answers[answers.size() - 2];
  const Answer& found = answers.back();
  EXPECT_EQ(lost.result.reason, TrackingReason::kNoTime);
  EXPECT_EQ(found.result.reason, TrackingReason::kRelocalised);
  EXPECT_EQ(found.result.rung, Rung::kFull);
  EXPECT_GT(found.latency, kFramePeriod);
  EXPECT_LE(found.latency, kFramePeriod + kLostTime);
}

// What is found of the map is too little to be made less.
TEST(Ladder, FewInliersAskForAllFeatures) {
  Camera camera(200, true, 0.06);
  camera.Next(100);
  TimedVisionDevice::Model slow = kFast;
  slow.per_feature = microseconds(60);
  camera.SetModel(slow);
  camera.Next(10);
  const std::vector<Answer> answers = camera.Next(40);
  int num_thin = 0;
  for (std::size_t i = 0; i + 1 < answers.size(); ++i) {
    const FrameResult& result = answers[i].result;
    if (result.state != TrackingState::kTracking) continue;
    const bool is_thin = result.num_inliers < 2 * EngineConfig{}.tracking.min_inliers;
    num_thin += is_thin;
    EXPECT_EQ(answers[i + 1].result.num_features > 60, is_thin) << i << " " << result.num_inliers;
  }
  EXPECT_GE(num_thin, 3);
}

// A scope keeps its course for a time, not for a number of frames.
TEST(Ladder, PredictionsLastAsLongAtEveryRate) {
  for (const auto& [period, allowed] :
       {std::pair{microseconds(16'667), 12}, {microseconds(40'000), 5}, {microseconds(100'000), 2}}) {
    Camera camera([period = Duration(period)](ScriptedColon& colon) {
      colon.SetPeriod(period);
      colon.Move(0.0, 4.0, 140);
    });
    camera.SetModel({.extract = milliseconds(1)});
    ASSERT_EQ(camera.Next(100).back().result.state, TrackingState::kTracking) << period.count();
    camera.SetModel({.extract = period - milliseconds(1)});
    const std::vector<Answer> answers = camera.Next(allowed + 1);
    for (int i = 0; i <= allowed; ++i) {
      EXPECT_EQ(answers[i].result.reason, i < allowed ? TrackingReason::kPredicted : TrackingReason::kNoTime)
          << period.count() << " us, frame " << i;
    }
  }
}

// Frames that the source drops between two answers are time that goes by, too.
TEST(Ladder, PredictionsLastNoLongerWhereFramesAreDropped) {
  Camera camera(140);
  const FrameResult measured = camera.Next(100).back().result;
  ASSERT_EQ(measured.reason, TrackingReason::kTracked);
  camera.SetModel({.extract = kFramePeriod - milliseconds(1)});
  FrameResult predicted, answered = measured;
  for (int i = 0; i < 10 && answered.state == TrackingState::kTracking; ++i) {
    predicted = answered;
    for (int dropped = 0; dropped < 2; ++dropped) ASSERT_TRUE(camera.colon().source().Next(kNoDeadline).ok());
    answered = camera.Next().result;
  }
  EXPECT_EQ(predicted.reason, TrackingReason::kPredicted);
  EXPECT_LE(ToMilliseconds(predicted.timestamp - measured.timestamp), EngineConfig{}.scheduler.max_predicted_ms);
}

// Frames that are numbered anew are not on the course of those before.
TEST(Ladder, NothingIsPredictedFromAnEarlierSession) {
  Camera camera(140);
  ASSERT_EQ(camera.Next(100).back().result.reason, TrackingReason::kTracked);
  camera.BeginSession();
  camera.SetModel({.extract = kFramePeriod - milliseconds(1)});
  EXPECT_EQ(camera.Next().result.reason, TrackingReason::kNoTime);
}

// At 60 Hz the seventh frame in a row that is not measured lies on the course, too.
TEST(Ladder, PredictedPoseLiesOnTheCourseForAsLongAtAHighRate) {
  const auto script = [](ScriptedColon& colon) {
    colon.SetPeriod(microseconds(16'667));
    colon.Move(0.0, 4.0, 140);
  };
  Camera camera(script), undisturbed(script);
  for (Camera* each : {&camera, &undisturbed}) {
    each->SetModel({.extract = milliseconds(1)});
    each->Next(100);
  }
  camera.SetModel({.extract = milliseconds(16)});
  const FrameResult predicted = camera.Next(7).back().result;
  const FrameResult measured = undisturbed.Next(7).back().result, later = undisturbed.Next().result;
  ASSERT_EQ(predicted.reason, TrackingReason::kPredicted);
  ASSERT_EQ(measured.reason, TrackingReason::kTracked);
  const auto centre = [](const FrameResult& result) { return result.cam_from_map.InverseTranslation(); };
  EXPECT_LT((centre(predicted) - centre(measured)).norm(), 2.0 * (centre(later) - centre(measured)).norm());
}

// The scope keeps its course, so the prediction is near the pose that would have been measured.
TEST(Ladder, PredictedPoseLiesOnTheCourse) {
  Camera camera(120), undisturbed(120);
  camera.Next(100);
  undisturbed.Next(100);
  TimedVisionDevice::Model stalled = kFast;
  stalled.extract = milliseconds(38);
  camera.SetModel(stalled);
  const Answer predicted = camera.Next();
  const Answer measured = undisturbed.Next(), later = undisturbed.Next();
  ASSERT_EQ(predicted.result.reason, TrackingReason::kPredicted);
  ASSERT_EQ(measured.result.reason, TrackingReason::kTracked);
  EXPECT_EQ(predicted.result.map_id, measured.result.map_id);
  const auto centre = [](const Answer& answer) { return answer.result.cam_from_map.InverseTranslation(); };
  const double step = (centre(later) - centre(measured)).norm();
  EXPECT_LT((centre(predicted) - centre(measured)).norm(), 0.5 * step);
  // Relative to a keyframe it says the same.
  EXPECT_NE(predicted.result.reference_keyframe, kNoId);
}

// haustra_pose_ring.h: poses compare when map and epoch agree. Two maps are joined, and the first frame that hears of
// it is answered with a prediction.
TEST(Ladder, PredictedPoseCarriesMapAndEpochOfThePoseThatWouldHaveBeenMeasured) {
  const auto come_back = [](ScriptedColon& colon) { colon.MoveAwayAndBack(); };
  Camera undisturbed(come_back), camera(come_back);
  std::vector<Answer> answers;
  while (answers.size() < 250 && (answers.empty() || answers.back().result.map_epoch == 0)) {
    answers.push_back(undisturbed.Next());
  }
  const FrameResult joined = answers.back().result;
  ASSERT_GT(joined.map_epoch, 0u) << "no map was moved";
  ASSERT_EQ(joined.reason, TrackingReason::kTracked);
  camera.Next(static_cast<int>(answers.size()) - 1);
  TimedVisionDevice::Model stalled = kFast;
  stalled.extract = milliseconds(38);
  camera.SetModel(stalled);
  const FrameResult predicted = camera.Next().result;
  ASSERT_EQ(predicted.reason, TrackingReason::kPredicted);
  EXPECT_EQ(predicted.map_id, joined.map_id);
  EXPECT_EQ(predicted.map_epoch, joined.map_epoch);
  const Eigen::Vector3d apart = predicted.cam_from_map.InverseTranslation() - joined.cam_from_map.InverseTranslation();
  const FrameResult later = undisturbed.Next().result;
  const Eigen::Vector3d step = later.cam_from_map.InverseTranslation() - joined.cam_from_map.InverseTranslation();
  EXPECT_LT(apart.norm(), step.norm());
}

TEST(Ladder, ShortStallCostsItsFrameAndNoMore) {
  Camera camera(200);
  camera.Next(100);
  TimedVisionDevice::Model stalled = kFast;
  stalled.extract = milliseconds(45);
  camera.SetModel(stalled);
  EXPECT_EQ(camera.Next().result.rung, Rung::kPredicted);
  camera.SetModel(kFast);
  const std::vector<Answer> answers = camera.Next(50);
  EXPECT_GE(Count(answers, Rung::kFull), 48);
  ExpectInTime(answers);
  for (const Answer& answer : answers) EXPECT_EQ(answer.result.state, TrackingState::kTracking);
}

// Extraction takes 10 ms, and to compare two views 35: no frame has so much time. It is taken now and then, since a
// scope without a map has no pose that could be late.
TEST(Ladder, MapIsFoundedWhereNoFrameHasTheTimeForIt) {
  Camera camera(200);
  TimedVisionDevice::Model slow = kFast;
  slow.match = milliseconds(35);
  camera.SetModel(slow);
  const std::vector<Answer> answers = camera.Next(100);
  EXPECT_EQ(answers.back().result.state, TrackingState::kTracking);
  const auto is_late = [](const Answer& answer) { return answer.latency > kFramePeriod; };
  EXPECT_LE(std::count_if(answers.begin(), answers.end(), is_late), 25);
  const auto has_no_time = [](const Answer& answer) { return answer.result.reason == TrackingReason::kNoTime; };
  EXPECT_GE(std::count_if(answers.begin(), answers.end(), has_no_time), 3);
}

// The same of a scope that has lost its map and sees it again. The mapper does not find it for the tracker here.
TEST(Ladder, MapIsFoundAgainWhereNoFrameHasTheTimeForIt) {
  Camera camera([](ScriptedColon& colon) {
    colon.config().place.relocalisation.min_inliers = 8000;
    colon.Move(0.0, 1.5, 50);
    colon.Occlude(5);
    colon.Move(1.5, 2.7, 40);
  });
  ASSERT_EQ(camera.Next(50).back().result.state, TrackingState::kTracking);
  TimedVisionDevice::Model slow = kFast;
  slow.match = milliseconds(35);
  camera.SetModel(slow);
  ASSERT_EQ(camera.Next(5).back().result.state, TrackingState::kLost);
  const std::vector<Answer> answers = camera.Next(15);
  const auto is_found = [](const Answer& answer) { return answer.result.reason == TrackingReason::kRelocalised; };
  EXPECT_EQ(std::count_if(answers.begin(), answers.end(), is_found), 1);
  EXPECT_EQ(answers.back().result.state, TrackingState::kTracking);
}

TEST(Ladder, SwitchedOffWaitsForEverything) {
  Camera camera(110, false);
  camera.Next(100);
  TimedVisionDevice::Model stalled = kFast;
  stalled.extract = milliseconds(60);
  camera.SetModel(stalled);
  const Answer answer = camera.Next();
  EXPECT_EQ(answer.result.rung, Rung::kFull);
  EXPECT_EQ(answer.result.reason, TrackingReason::kTracked);
  EXPECT_GT(answer.latency, kFramePeriod);
}

// The same frames and the same times give the same answers to the bit, and without a deadline the clock changes
// nothing.
TEST(Ladder, SameTimesGiveTheSameAnswers) {
  Camera a(150), b(150);
  for (int i = 0; i < 150; ++i) {
    if (i == 80) {
      TimedVisionDevice::Model slow = kFast;
      slow.per_feature = microseconds(60);
      a.SetModel(slow);
      b.SetModel(slow);
    }
    const Answer x = a.Next(), y = b.Next();
    ASSERT_EQ(x.result.rung, y.result.rung);
    ASSERT_EQ(x.latency, y.latency);
    ASSERT_EQ(x.result.cam_from_map.translation, y.result.cam_from_map.translation);
  }
}

TEST(Ladder, SequentialModeDoesNotKnowTheClock) {
  std::vector<FrameResult> results[2];
  for (int with_clock = 0; with_clock < 2; ++with_clock) {
    ScriptedColon colon;
    colon.Move(0.0, 3.0, 100);
    ManualClock clock;
    TimedVisionDevice device(colon.device(), clock, [&clock](TimePoint time) { clock.AdvanceTo(time); });
    TimedVisionDevice::Model slow = kFast;
    slow.extract = milliseconds(500);
    device.SetModel(slow);
    const auto engine = colon.MakeEngine(Engine::Mode::kSequential, device, with_clock == 1 ? &clock : nullptr);
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      results[with_clock].push_back(engine->Track(*frame, kNoDeadline));
      while (engine->BackgroundStep()) {
      }
    }
  }
  ASSERT_EQ(results[0].size(), results[1].size());
  for (std::size_t i = 0; i < results[0].size(); ++i) {
    EXPECT_EQ(results[0][i].rung, Rung::kFull);
    EXPECT_EQ(results[0][i].reason, results[1][i].reason);
    EXPECT_EQ(results[0][i].cam_from_map.translation, results[1][i].cam_from_map.translation);
    EXPECT_EQ(results[0][i].cam_from_map.rotation.coeffs(), results[1][i].cam_from_map.rotation.coeffs());
  }
}

}  // namespace
}  // namespace haustra
