// The real-time session without pictures: capture, tracking, mapping and merging threads of the product, the engine
// itself, and a vision device that sleeps as long as an accelerator would work. Beside it, threads of ordinary
// scheduling that never rest, and a reader that storms the kernel. Counts what misses its deadline. For virtual time
// (realtime_proof.sh) and for any machine.
//   realtime_skeleton FRAMES ordinary|realtime HOGS READERS
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <thread>
#include <vector>

#include "hal/fakes/frame_tag.h"
#include "hal/fakes/timed_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "tests/tools/run/scripted_colon.h"
#include "tools/latency/latency_histogram.h"

namespace haustra {
namespace {

constexpr int kMostLateShown = 200;
constexpr int kNumViews = 150;  // there and back again, for ever

EngineConfig SkeletonConfig() {
  EngineConfig config = test::SmallEngineConfig();
  config.features.max = 160;
  config.memory.max_keyframes = 60;
  config.memory.max_map_points = 6000;
  config.memory.max_local_points = 1500;
  config.memory.max_keyframe_ids = 20000;
  config.mapping.window_keyframes = 8;
  config.mapping.fixed_keyframes = 4;
  return config;
}

// The views of a scripted colon as an endless procedure of so many frames.
class SwingingSource final : public FrameSource {
 public:
  SwingingSource(const CameraCalibration& calibration, std::uint32_t num_frames)
      : calibration_(calibration),
        num_frames_(num_frames),
        pixels_(static_cast<std::size_t>(calibration.width_px) * calibration.height_px, 128) {}

  const CameraCalibration& calibration() const override { return calibration_; }
  std::uint32_t num_frames() const override { return num_frames_; }
  ImageView static_mask() const override { return {}; }
  Result<Frame> Next(TimePoint) override {
    if (next_ == num_frames_) return Status(StatusCode::kNotFound);
    const std::uint32_t phase = next_ % (2 * kNumViews - 2);
    WriteFrameTag(phase < kNumViews ? phase : 2 * kNumViews - 2 - phase, pixels_);
    Frame frame;
    frame.index = next_;
    frame.timestamp = TimePoint(next_ * test::kFramePeriod);
    frame.image = {pixels_.data(), calibration_.width_px, calibration_.height_px, calibration_.width_px,
                   PixelFormat::kGrey8};
    ++next_;
    return frame;
  }

 private:
  CameraCalibration calibration_;
  std::uint32_t num_frames_;
  std::vector<std::uint8_t> pixels_;
  std::uint32_t next_ = 0;
};

class Counter final : public SessionObserver {
 public:
  void OnStart(const RealTimeReport& report) override { std::printf("%s", ToText(report).c_str()); }
  void OnFrame(const FrameOutcome& outcome) override {
    ++num_frames;
    if (outcome.is_dropped) {
      ++num_dropped;
      return;
    }
    latency.Add(outcome.latency);
    start.Add(outcome.begin - outcome.due);
    tracking.Add(outcome.tracking);
    num_late += outcome.is_late;
    if (outcome.is_late && num_late <= kMostLateShown) {
      std::printf("  late: frame %u, %s, %s, wake-up %.3f, tracking %.3f, latency %.3f ms, forced switches %u\n",
                  outcome.result.frame_index, ToString(outcome.result.state).data(),
                  ToString(outcome.result.rung).data(), ToMilliseconds(outcome.begin - outcome.due),
                  ToMilliseconds(outcome.tracking), ToMilliseconds(outcome.latency), outcome.use.involuntary_switches);
    }
    num_tracking += outcome.result.state == TrackingState::kTracking;
    num_predicted += outcome.result.rung == Rung::kPredicted;
    num_reduced += outcome.result.rung != Rung::kFull;
    use += outcome.use;
    if (num_frames % 1000 == 0) {
      std::printf("  %d frames, %d late, %d dropped\n", num_frames, num_late, num_dropped);
      std::fflush(stdout);
    }
  }
  void OnMapEvent(const MapEvent&) override {}
  void OnLatePose(const LatePose&) override {}
  void OnDamagedFrame(std::uint32_t, const std::string&) override {}

  int num_frames = 0, num_dropped = 0, num_late = 0, num_tracking = 0, num_predicted = 0, num_reduced = 0;
  LatencyHistogram latency, start, tracking;
  ThreadUse use;
};

void Hog(const std::atomic<bool>& stop) {
  volatile std::uint64_t x = 0;
  while (!stop.load(std::memory_order_relaxed)) {
    for (int i = 0; i < 10000; ++i) x = x + 1;
  }
}

// Long stretches inside the kernel, as the symbol table has.
void StormKernel(const std::atomic<bool>& stop) {
  static thread_local char buffer[65536];
  while (!stop.load(std::memory_order_relaxed)) {
    const int file = open("/proc/kallsyms", O_RDONLY | O_CLOEXEC);
    if (file < 0) return;
    while (!stop.load(std::memory_order_relaxed) && read(file, buffer, sizeof(buffer)) > 0) {
    }
    close(file);
  }
}

void SleepUntil(TimePoint time) {
  if (time == kNoDeadline) return;
  const std::int64_t ns = time.time_since_epoch().count();
  const timespec until{ns / 1'000'000'000, ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

int Main(int argc, char** argv) {
  if (argc != 5 || (std::strcmp(argv[2], "ordinary") != 0 && std::strcmp(argv[2], "realtime") != 0)) {
    std::fprintf(stderr, "usage: realtime_skeleton FRAMES ordinary|realtime HOGS READERS\n");
    return 64;
  }
  const auto num_frames = static_cast<std::uint32_t>(std::strtoul(argv[1], nullptr, 10));
  const bool is_realtime = std::strcmp(argv[2], "realtime") == 0;

  const EngineConfig config = SkeletonConfig();
  test::ScriptedColon colon(TimePoint{}, config);
  colon.Move(0.0, 0.02 * kNumViews, kNumViews);
  const SystemClock clock;
  TimedVisionDevice device(colon.device(), clock, SleepUntil);
  TimedVisionDevice::Model model;
  model.extract = std::chrono::milliseconds(8);
  model.match = std::chrono::milliseconds(2);
  model.guided = std::chrono::milliseconds(1);
  device.SetModel(model);
  device.SetAccelerator(true);
  Engine engine(config, colon.camera(), device, Engine::Mode::kRealTime, &clock, ImageView{});
  SwingingSource source(colon.camera().calibration(), num_frames);

  std::atomic<bool> stop{false};
  std::vector<std::thread> load;
  for (int i = 0; i < std::atoi(argv[3]); ++i) load.emplace_back([&stop] { Hog(stop); });
  for (int i = 0; i < std::atoi(argv[4]); ++i) load.emplace_back([&stop] { StormKernel(stop); });

  RealTimeOptions options;
  options.rt.enabled = is_realtime;
  Counter counter;
  const std::atomic<bool> never{false};
  const Result<SessionSummary> session = RunRealTime(source, engine, clock, options, counter, never);
  stop = true;
  for (std::thread& thread : load) thread.join();
  if (!session.ok()) {
    std::printf("%s\n", session.status().ToString().c_str());
    return 1;
  }
  const auto line = [](const char* name, const LatencyHistogram& h) {
    std::printf("  %-10s p50 %8.3f  p99 %8.3f  p99.9 %8.3f  max %8.3f ms\n", name, ToMilliseconds(h.Quantile(0.5)),
                ToMilliseconds(h.Quantile(0.99)), ToMilliseconds(h.Quantile(0.999)), ToMilliseconds(h.max()));
  };
  line("wake-up", counter.start);
  line("tracking", counter.tracking);
  line("latency", counter.latency);
  std::printf("  keyframes %llu, faults %u minor %u major, switches %u voluntary %u forced\n",
              static_cast<unsigned long long>(engine.mapper_counters().num_keyframes), counter.use.minor_faults,
              counter.use.major_faults, counter.use.voluntary_switches, counter.use.involuntary_switches);
  std::printf("RESULT %s: frames %d, late %d, dropped %d, reduced %d, predicted %d, tracking %d\n", argv[2],
              counter.num_frames, counter.num_late, counter.num_dropped, counter.num_reduced, counter.num_predicted,
              counter.num_tracking);
  return 0;
}

}  // namespace
}  // namespace haustra

int main(int argc, char** argv) { return haustra::Main(argc, argv); }
