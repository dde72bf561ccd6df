// Sessions that are told to stop at any moment of their lives: each ends at once, the next one begins at once, and
// nothing is left of it. A session is a procedure of the service: device, engine and maps of a file are its own.
//   HAUSTRA_RESTARTS=200 test_platform restart_test.cc     as many as wanted, HAUSTRA_RESTART_SEED=7 others
#include <gtest/gtest.h>
#include <malloc.h>
#include <pthread.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "engine/geometry/rng.h"
#include "hal/core/byte_sink.h"
#include "hal/fakes/manual_clock.h"
#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using test::ScriptedColon;

constexpr Duration kLimit = milliseconds(1000) * HAUSTRA_TEST_TIMEOUT_SCALE;
constexpr int kNumFrames = 90;
constexpr double kRate = 3.0;

enum Moment { kBeforeFirstFrame, kInitialising, kFounding, kMapping, kQuestionOut, kMerging, kSaving, kAnyTime };
constexpr std::array kMomentNames = {
    "before the first frame",  "while initialising",    "while a map is founded", "while mapping",
    "while a question is out", "while maps are merged", "while saving",           "at any time"};
// How often what a moment is about may pass before the session is told to stop.
constexpr std::array kMostCalls = {1.0, 6.0, 6.0, 200.0, 80.0, 6.0, 40.0, 1.0};
constexpr int kNumMoments = static_cast<int>(kMomentNames.size());

int NumberFrom(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

int NumEntries(const char* folder) {
  int num = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) num += !entry.path().empty();
  return num;
}
int NumDescriptors() { return NumEntries("/proc/self/fd"); }
// A thread that was joined may stand in the kernel's list for a moment.
int NumThreads(int expected) {
  int num = NumEntries("/proc/self/task");
  for (int i = 0; i < 1000 && num > expected; ++i, num = NumEntries("/proc/self/task")) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  return num;
}
double ResidentMb() {
  long total = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}
// What is taken from malloc and not given back; 0 where a sanitizer owns malloc, which looks for leaks itself.
double HeapMb() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

bool IsOnThread(std::string_view name) {
  char here[16] = "";
  pthread_getname_np(pthread_self(), here, sizeof(here));
  return name == here;
}

// Tells the session to stop; the first time counts.
class StopButton {
 public:
  void Press() {
    if (!stop_.exchange(true)) asked_ = clock_.Now();
  }
  const std::atomic<bool>& stop() const { return stop_; }
  bool is_pressed() const { return stop_; }
  // After the session.
  TimePoint asked() const { return asked_; }

 private:
  SystemClock clock_;
  std::atomic<bool> stop_{false};
  TimePoint asked_;
};

// A file whose first bytes press.
class PressingSink final : public ByteSink {
 public:
  explicit PressingSink(StopButton& button) : button_(button) {}
  Status Write(std::string_view) override {
    button_.Press();
    return Status::Ok();
  }

 private:
  StopButton& button_;
};

// Presses at the n-th call (from 0) that the moment is about. Each object is of one thread.
class Trigger {
 public:
  Trigger(Moment moment, Moment mine, int call, StopButton& button)
      : is_armed_(moment == mine), call_(call), button_(button) {}
  void Call() {
    if (is_armed_ && call_-- == 0) button_.Press();
  }

 private:
  const bool is_armed_;
  int call_;
  StopButton& button_;
};

struct Plan {
  Moment moment = kAnyTime;
  int call = 0;       // the how manieth of its kind
  Duration delay{0};  // kAnyTime
};

// One life: made, run, stopped and taken down. `begun`: when capture asked for its first frame.
class Life final : public FrameSource, public ForwardingVisionDevice, public SessionHooks {
 public:
  Life(const Plan& plan, ScriptedColon& colon, ScriptedVisionDevice& device, const std::string& maps)
      : ForwardingVisionDevice(device),
        plan_(plan),
        first_frame_(plan.moment, kBeforeFirstFrame, 0, button_),
        initialising_(plan.moment, kInitialising, plan.call, button_),
        founding_(plan.moment, kFounding, plan.call, button_),
        mapping_(plan.moment, kMapping, 10 + plan.call, button_),
        question_out_(plan.moment, kQuestionOut, plan.call, button_),
        merging_(plan.moment, kMerging, plan.call, button_),
        saving_after_(5 + plan.call),
        source_(colon.camera().calibration()),
        engine_(colon.MakeEngine(Engine::Mode::kRealTime, *this, &clock_)) {
    source_.AddFrames(kNumFrames, colon.TimeOf(0), test::kFramePeriod);
    EXPECT_TRUE(engine_->LoadAtlas({reinterpret_cast<const std::uint8_t*>(maps.data()), maps.size()}).ok());
  }

  void Run() {
    std::jthread stopper([this](const std::stop_token& over) {
      if (plan_.moment != kAnyTime) return;
      const TimePoint due = clock_.Now() + plan_.delay;
      while (!over.stop_requested() && clock_.Now() < due) std::this_thread::sleep_for(milliseconds(1));
      if (!over.stop_requested()) button_.Press();
    });
    RealTimeOptions options;
    options.rate = kRate;
    options.rt.enabled = false;
    options.hooks = this;
    const auto session = RunRealTime(*this, *engine_, clock_, options, observer, button_.stop());
    EXPECT_TRUE(session.ok()) << session.status().ToString();
  }

  const StopButton& button() const { return button_; }
  TimePoint begun() const { return begun_; }

  test::RecordingObserver observer;

 private:
  // The capture thread.
  const CameraCalibration& calibration() const override { return source_.calibration(); }
  std::uint32_t num_frames() const override { return source_.num_frames(); }
  ImageView static_mask() const override { return source_.static_mask(); }
  Result<Frame> Next(TimePoint deadline) override {
    if (begun_ == TimePoint{}) begun_ = clock_.Now();
    first_frame_.Call();
    initialising_.Call();
    return source_.Next(deadline);
  }

  // The threads of the background lane: mapping and merging.
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    OnRequest(lane);
    return ForwardingVisionDevice::EnqueueMatch(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    OnRequest(lane);
    return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request);
  }
  void OnRequest(Lane lane) {
    if (lane != Lane::kBackground) return;
    if (IsOnThread("merging")) {
      question_out_.Call();
    } else {
      founding_.Call();
      mapping_.Call();
      if (has_answer_) merging_.Call();
    }
  }
  // Mapping: the answer that lies there is taken first; when it joins maps, that asks the device.
  void BetweenMapSteps() override {
    has_answer_ = engine_->is_merging() && !engine_->has_merge_work();
    if (plan_.moment != kSaving || button_.is_pressed() || engine_->atlas().keyframes().size() == 0) return;
    if (saving_after_-- > 0) return;
    PressingSink sink(button_);
    EXPECT_TRUE(engine_->SaveAtlas(sink).ok());
  }

  const Plan plan_;
  const SystemClock clock_;
  StopButton button_;
  Trigger first_frame_, initialising_, founding_, mapping_, question_out_, merging_;
  int saving_after_;
  bool has_answer_ = false;  // mapping thread
  TimePoint begun_;
  ScriptedFrameSource source_;
  std::unique_ptr<Engine> engine_;
};

std::string MapsOfFormerVisit() {
  ScriptedColon colon;
  colon.Move(5.5, 7.5, 50);
  const auto engine = colon.MakeEngine();
  test::RecordingObserver observer;
  EXPECT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), observer, test::kNeverStop).ok());
  StringSink sink;
  EXPECT_TRUE(engine->SaveAtlas(sink).ok());
  return sink.bytes();
}

TEST(Restart, AtAnyMomentOfASessionWithinASecondAndWithoutALeak) {
  RecordProperty("req", "DMN-004");
  const int num_rounds = NumberFrom("HAUSTRA_RESTARTS", 3 * kNumMoments);
  // Every life begins where nobody has been and comes to what the maps show.
  const std::string maps = MapsOfFormerVisit();
  ScriptedColon colon;
  colon.Move(2.5, 6.5, kNumFrames);
  Rng rng(static_cast<std::uint64_t>(NumberFrom("HAUSTRA_RESTART_SEED", 1)));
  const SystemClock clock;
  std::thread([] {}).join();  // a sanitizer's own thread comes with the first one
  const int num_threads = NumThreads(1), num_descriptors = NumDescriptors();
  std::array<int, kNumMoments> num_reached{};
  Duration longest{0};
  int num_merged = 0;
  double heap_mb = 0.0, resident_mb = 0.0;
  TimePoint asked;
  for (int round = 0; round < num_rounds; ++round) {
    Plan plan;
    plan.moment = static_cast<Moment>(round % kNumMoments);
    plan.call = static_cast<int>(rng.Uniform(0.0, kMostCalls[plan.moment]));
    plan.delay = Duration(static_cast<std::int64_t>(rng.Uniform(0.0, 1.2e9)));
    SCOPED_TRACE(std::string("round ") + std::to_string(round) + ", " + kMomentNames[plan.moment]);
    {
      ScriptedVisionDevice device(colon.device().plan(), {});
      device.CopyScript(colon.device());
      Life life(plan, colon, device, maps);
      life.Run();
      // From one session's end to the begin of the next; one that was over before has nothing to be told.
      if (asked != TimePoint{}) {
        longest = std::max(longest, life.begun() - asked);
        EXPECT_LT(life.begun() - asked, kLimit);
      }
      asked = life.button().is_pressed() ? life.button().asked() : TimePoint{};
      num_reached[plan.moment] += life.button().is_pressed();
      for (const MapEvent& event : life.observer.events) num_merged += event.kind == MapEventKind::kMerged;
    }
    ASSERT_EQ(NumThreads(num_threads), num_threads);
    ASSERT_EQ(NumDescriptors(), num_descriptors);
    // What is made once has been made in the first lives.
    if (round != kNumMoments - 1) continue;
    heap_mb = HeapMb();
    resident_mb = ResidentMb();
  }
  const double more_heap_mb = HeapMb() - heap_mb, more_resident_mb = ResidentMb() - resident_mb;
  // A session takes tens of megabytes, the smallest thing of one some kilobytes.
  EXPECT_LT(more_heap_mb, 0.002 * num_rounds + 0.05);
  EXPECT_LT(more_resident_mb, 64.0);
  int num_all = 0;
  for (int i = 0; i < kNumMoments; ++i) {
    std::printf("%-24s %4d\n", kMomentNames[i], num_reached[i]);
    num_all += num_reached[i];
  }
  std::printf(
      "stopped %d of %d sessions (%d maps merged), longest until the next one began %.0f ms, heap %+.3f MB, "
      "resident %+.1f MB\n",
      num_all, num_rounds, num_merged, ToMilliseconds(longest), more_heap_mb, more_resident_mb);
  EXPECT_GE(num_all, num_rounds / 2);
}

}  // namespace
}  // namespace haustra
