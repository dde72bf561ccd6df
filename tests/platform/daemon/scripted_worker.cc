// A worker of haustrad with a scripted camera and a vision device that fails when it is told to:
//
//     haustra_scripted_worker SCRIPT --worker 3
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/daemon/worker.h"
#include "platform/exit_codes.h"
#include "tests/platform/daemon/scripted_worker.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

std::atomic<test::WorkerScript*> script_of_process{nullptr};

// Hands on to a device, unless it is to hang.
class FaultyDevice final : public ForwardingVisionDevice {
 public:
  FaultyDevice(std::unique_ptr<VisionDevice> device, test::WorkerScript& script)
      : ForwardingVisionDevice(*device), device_(std::move(device)), script_(script) {}

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (script_.is_lost) return Status(StatusCode::kUnavailable);
    ++script_.num_extractions;
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  bool is_accelerator() const override { return true; }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    for (; script_.is_stuck; std::this_thread::sleep_for(milliseconds(1))) script_.num_stuck = 1;
    while (script_.is_silent) {
      if (SystemClock().Now() >= deadline) return Status(StatusCode::kDeadlineExceeded);
      std::this_thread::sleep_for(milliseconds(1));
    }
    return ForwardingVisionDevice::Wait(ticket, deadline);
  }

 private:
  std::unique_ptr<VisionDevice> device_;
  test::WorkerScript& script_;
};

// The same frames again for each worker.
class ColonSource : public FrameSource {
 public:
  explicit ColonSource(const test::WorkerScript& script) {
    if (!script.is_dark) colon_.Move(0.0, 6.0, 150);
    colon_.Occlude(4000);
  }
  const CameraCalibration& calibration() const override { return colon_.source().calibration(); }
  std::uint32_t num_frames() const override { return colon_.source().num_frames(); }
  std::optional<PixelFormat> pixel_format() const override { return PixelFormat::kGrey8; }
  ImageView static_mask() const override { return {}; }
  Result<Frame> Next(TimePoint deadline) override { return colon_.source().Next(deadline); }
  test::ScriptedColon& colon() { return colon_; }

 private:
  mutable test::ScriptedColon colon_;
};

// A camera, which stamps its frames and writes the stamps down.
class LiveColonSource final : public ColonSource {
 public:
  explicit LiveColonSource(test::WorkerScript& script) : ColonSource(script), script_(script) {}
  std::uint32_t num_frames() const override { return 0; }
  bool is_live() const override { return true; }
  std::optional<TimePoint> recovering_since() const override {
    const std::int64_t call_ns = call_ns_;
    return call_ns == 0 ? std::optional<TimePoint>() : TimePoint(Duration(call_ns));
  }
  Result<Frame> Next(TimePoint deadline) override {
    std::this_thread::sleep_for(milliseconds(10 + script_.first_frame_ms.exchange(0)));
    while (script_.num_slow_calls > 0 || script_.has_stuck_call) {
      call_ns_ = SystemClock().Now().time_since_epoch().count();
      do {
        if (script_.has_stuck_call) script_.num_stuck = 1;
        std::this_thread::sleep_for(milliseconds(1000));
      } while (script_.has_stuck_call);
      --script_.num_slow_calls;
    }
    call_ns_ = 0;
    if (script_.is_unplugged) return Unavailable("/dev/video7: the tower sends 1280x720");
    Result<Frame> frame = ColonSource::Next(deadline);
    if (!frame.ok()) return frame;
    frame->timestamp = SystemClock().Now();
    if (script_.do_stamps_jump) frame->refused_stamp = frame->timestamp + std::chrono::hours(1);
    if (script_.are_all_torn) return DataLoss("torn");
    if (frame->index < script_.stamps_ns.size()) {
      script_.stamps_ns[frame->index] = frame->timestamp.time_since_epoch().count();
    }
    return frame;
  }

 private:
  test::WorkerScript& script_;
  std::atomic<std::int64_t> call_ns_{0};
};

int Run(const std::string& path) {
  if (!BecomeWorker()) return kExitSystem;
  test::WorkerScript* script = test::MapScript(path);
  if (script == nullptr) return kExitIo;
  script_of_process = script;
  if (script->talks_nonsense) {
    for (std::string bytes(100, 'x');; std::this_thread::sleep_for(milliseconds(10))) {
      (void)send(kWorkerChannel, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
  }
  WorkerParts parts;
  ColonSource* colon = nullptr;  // the source, which is opened before the device is made
  parts.open_source = [script, &colon](const SourceConfig&) -> Result<std::unique_ptr<FrameSource>> {
    ++script->num_opens;
    if (script->num_waits > 0) {
      --script->num_waits;
      return Unavailable("there is no camera");
    }
    if (const int error = script->open_error; error != 0) {
      return Status(static_cast<StatusCode>(error), "/dev/video7: does not offer 1920x1080; it offers 1280x720");
    }
    std::unique_ptr<ColonSource> source =
        script->is_live ? std::make_unique<LiveColonSource>(*script) : std::make_unique<ColonSource>(*script);
    colon = source.get();
    return std::unique_ptr<FrameSource>(std::move(source));
  };
  parts.make_device = [script, &colon](const DaemonConfig& config, const CameraCalibration& calibration) {
    ++script->num_devices;
    script->pid = ::getpid();
    script->is_lost = script->is_silent = script->is_stuck = false;  // a new one works
    while (script->is_making_held) std::this_thread::sleep_for(milliseconds(1));
    if (script->cannot_start) std::_Exit(9);
    auto device = std::make_unique<ScriptedVisionDevice>(Engine::PlanFor(config.engine, calibration),
                                                         ScriptedVisionDevice::Options{});
    device->CopyScript(colon->colon().device());
    return Result<std::unique_ptr<VisionDevice>>(std::make_unique<FaultyDevice>(std::move(device), *script));
  };
  return RunWorker(kWorkerChannel, parts);
}

}  // namespace
}  // namespace haustra

#ifdef __SANITIZE_THREAD__
// The sanitizer calls it at each report. The worker is killed in the end: its exit code would tell nobody.
extern "C" void __tsan_on_report(void*) {
  if (haustra::test::WorkerScript* script = haustra::script_of_process) ++script->num_races;
}
#endif

int main(int argc, char** argv) {
  if (argc != 4 || argv[2] != std::string(haustra::kWorkerOption)) {
    std::fprintf(stderr, "%s is started by a test\n", argv[0]);
    return 64;
  }
  std::_Exit(haustra::Run(argv[1]));
}
