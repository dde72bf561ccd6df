// haustrad in this process, with a scripted camera and a vision device that may fail; no time is asserted.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/control/control_client.h"
#include "platform/daemon/daemon.h"
#include "platform/exit_codes.h"
#include "platform/publish/haustra_pose_ring.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kHangLimit = seconds(60);

// Hands on to a device, unless it is to hang. Each engine gets one of its own.
struct Faults {
  std::atomic<bool> is_lost{false};    // each call is answered so
  std::atomic<bool> is_silent{false};  // a wait is never over
  std::atomic<bool> is_stuck{false};   // a call does not return
  std::atomic<int> num_stuck{0};
  std::atomic<int> num_extractions{0};
};

class FaultyDevice final : public ForwardingVisionDevice {
 public:
  FaultyDevice(std::unique_ptr<VisionDevice> device, Faults& faults)
      : ForwardingVisionDevice(*device), device_(std::move(device)), faults_(faults) {}

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (faults_.is_lost) return Status(StatusCode::kUnavailable);
    ++faults_.num_extractions;
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  bool is_accelerator() const override { return true; }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    for (; faults_.is_stuck; std::this_thread::sleep_for(milliseconds(1))) faults_.num_stuck = 1;
    while (faults_.is_silent) {
      if (SystemClock().Now() >= deadline) return Status(StatusCode::kDeadlineExceeded);
      std::this_thread::sleep_for(milliseconds(1));
    }
    return ForwardingVisionDevice::Wait(ticket, deadline);
  }

 private:
  std::unique_ptr<VisionDevice> device_;
  Faults& faults_;
};

// The same frames again for each engine.
class ColonSource : public FrameSource {
 public:
  ColonSource() { colon_.Move(0.0, 6.0, 150), colon_.Occlude(10000); }
  const CameraCalibration& calibration() const override { return colon_.source().calibration(); }
  std::uint32_t num_frames() const override { return colon_.source().num_frames(); }
  std::optional<PixelFormat> pixel_format() const override { return PixelFormat::kGrey8; }
  ImageView static_mask() const override { return {}; }
  Result<Frame> Next(TimePoint deadline) override { return colon_.source().Next(deadline); }
  test::ScriptedColon& colon() { return colon_; }

 private:
  mutable test::ScriptedColon colon_;
};

// A camera, which stamps its frames and remembers the stamps.
class LiveColonSource final : public ColonSource {
 public:
  LiveColonSource(std::mutex& mutex, std::vector<TimePoint>& stamps) : mutex_(mutex), stamps_(stamps) {}
  std::uint32_t num_frames() const override { return 0; }
  bool is_live() const override { return true; }
  Result<Frame> Next(TimePoint deadline) override {
    std::this_thread::sleep_for(milliseconds(10));
    Result<Frame> frame = ColonSource::Next(deadline);
    if (!frame.ok()) return frame;
    frame->timestamp = SystemClock().Now();
    const std::lock_guard lock(mutex_);
    stamps_.resize(frame->index + 1);
    stamps_[frame->index] = frame->timestamp;
    return frame;
  }

 private:
  std::mutex& mutex_;
  std::vector<TimePoint>& stamps_;
};

class DaemonDevice : public testing::Test {
 protected:
  DaemonDevice() {
    std::string pattern = testing::TempDir() + "daemon_device_XXXXXX";
    folder_ = mkdtemp(pattern.data());
    Daemon::BlockSignals();
    config_.engine = test::SmallEngineConfig();
    config_.engine.rt.enabled = false;
    config_.source.path = "scripted";
    config_.source.rate = 4.0;
    config_.vision.answer_limit_ms = 200;
    config_.watchdog.stop_limit_ms = 60000;
    config_.checkpoint.interval_s = 1;
    config_.files.state_folder = config_.files.runtime_folder = folder_;
    config_.log.level = "error";
  }
  ~DaemonDevice() override {
    faults_.is_lost = faults_.is_silent = faults_.is_stuck = false;
    Terminate();
    daemon_.reset();
    fs::remove_all(folder_);
  }

  void Start() {
    DaemonParts parts;
    parts.open_source = [this](const SourceConfig&) -> Result<std::unique_ptr<FrameSource>> {
      if (is_live_) return std::unique_ptr<FrameSource>(std::make_unique<LiveColonSource>(stamps_mutex_, stamps_));
      return std::unique_ptr<FrameSource>(std::make_unique<ColonSource>());
    };
    parts.make_device = [this](const DaemonConfig& config, const CameraCalibration& calibration) {
      ++num_devices_;
      faults_.is_lost = false;  // a new one works
      while (is_making_held_) std::this_thread::sleep_for(milliseconds(1));
      auto device = std::make_unique<ScriptedVisionDevice>(Engine::PlanFor(config.engine, calibration),
                                                           ScriptedVisionDevice::Options{});
      device->CopyScript(script_.colon().device());
      return Result<std::unique_ptr<VisionDevice>>(std::make_unique<FaultyDevice>(std::move(device), faults_));
    };
    has_ended_ = false;
    daemon_.reset();
    daemon_ = std::make_unique<Daemon>(config_, ConfigSource{}, clock_, parts);
    thread_ = std::thread([this] {
      exit_code_ = daemon_->Run();
      has_ended_ = true;
    });
    ASSERT_TRUE(Until([&] { return StatusValue("state") == "idle"; }));
  }
  // A procedure with a map and a checkpoint.
  void BeginAndMap() {
    ASSERT_NO_FATAL_FAILURE(Start());
    ASSERT_EQ(Ask("begin case-1"), "procedure 1\n");
    ASSERT_TRUE(Until([&] { return !StatusValue("checkpoint_age_s").empty(); })) << Ask("status");
  }
  void Terminate() {
    if (!thread_.joinable()) return;
    if (!has_ended_) ::kill(::getpid(), SIGTERM);
    thread_.join();
  }
  bool HasEnded() {
    return Until([&] { return has_ended_.load(); });
  }

  static bool Until(const std::function<bool()>& is_so, Duration hang_limit = kHangLimit) {
    const SystemClock clock;
    const TimePoint limit = clock.Now() + hang_limit;
    while (!is_so()) {
      if (clock.Now() > limit) return false;
      std::this_thread::sleep_for(milliseconds(10));
    }
    return true;
  }
  std::string Ask(const std::string& request) const {
    Result<ControlClient> client = ControlClient::Connect(folder_ + "/control");
    if (!client.ok()) return "error: " + client.status().message();
    const Result<std::string> reply = client->Ask(request, kHangLimit);
    return reply.ok() ? *reply : "error: " + reply.status().message();
  }
  std::string StatusValue(const std::string& key) const {
    const std::string text = "\n" + Ask("status");
    const std::size_t at = text.find("\n" + key + " ");
    if (at == std::string::npos) return "";
    const std::size_t begin = at + key.size() + 2;
    return text.substr(begin, text.find('\n', begin) - begin);
  }
  bool Exists(const std::string& name) const { return fs::exists(folder_ + "/" + name); }

  const SystemClock clock_;
  std::string folder_;
  DaemonConfig config_;
  Faults faults_;
  ColonSource script_;
  bool is_live_ = false;
  std::mutex stamps_mutex_;
  std::vector<TimePoint> stamps_;  // of a live camera, by frame
  std::atomic<int> num_devices_{0};
  std::atomic<bool> is_making_held_{false};
  std::unique_ptr<Daemon> daemon_;
  std::thread thread_;
  std::atomic<bool> has_ended_{false};
  int exit_code_ = -1;
};

TEST_F(DaemonDevice, LostDeviceIsMadeAnewOnceAndTheProcedureGoesOn) {
  RecordProperty("req", "DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  faults_.is_lost = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && StatusValue("procedure") == "2"; }));
  EXPECT_EQ(num_devices_, 2);
  EXPECT_EQ(StatusValue("label"), "case-1");
  ASSERT_TRUE(Until([&] { return StatusValue("maps") == "1"; })) << "from the checkpoint";
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
}

TEST_F(DaemonDevice, DeviceThatIsLostAgainEndsTheServiceAndTheCheckpointStands) {
  RecordProperty("req", "DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  faults_.is_lost = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && StatusValue("procedure") == "2"; }));
  faults_.is_lost = true;
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_EQ(num_devices_, 2);
  EXPECT_FALSE(daemon_->is_given_up());
  EXPECT_TRUE(Exists("checkpoint.atlas"));
  EXPECT_TRUE(Exists("procedure"));
}

TEST_F(DaemonDevice, DeviceThatHangsEndsTheServiceAndTheCheckpointStands) {
  RecordProperty("req", "DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  faults_.is_silent = true;
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_EQ(num_devices_, 1) << "one that hangs is not made anew in this process";
  EXPECT_TRUE(daemon_->is_given_up());
  EXPECT_TRUE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, EndComesThroughWhileADriverHangs) {
  RecordProperty("req", "DMN-010");
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  faults_.is_stuck = true;
  ASSERT_TRUE(Until([&] { return faults_.num_stuck > 0; }));
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_TRUE(daemon_->is_given_up());
  EXPECT_FALSE(Exists("checkpoint.atlas"));
  EXPECT_FALSE(Exists("procedure"));
}

TEST_F(DaemonDevice, StopComesThroughWhileADriverHangs) {
  RecordProperty("req", "DMN-010");
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  faults_.is_stuck = true;
  ASSERT_TRUE(Until([&] { return faults_.num_stuck > 0; }));
  ::kill(::getpid(), SIGTERM);
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_TRUE(daemon_->is_given_up());
  EXPECT_TRUE(Exists("checkpoint.atlas"));
}

// "haustra_checkpoints_total{result=\"written\"} 3" gives 3.
double Metric(const std::string& text, const std::string& name) {
  const std::size_t at = text.find("\n" + name + " ");
  return at == std::string::npos ? -1.0 : std::stod(text.substr(at + name.size() + 2));
}

TEST_F(DaemonDevice, CountersDoNotRunBackwardsAndGaugesAreOfTheOpenProcedure) {
  RecordProperty("req", "DMN-008");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const std::string checkpoints = "haustra_checkpoints_total{result=\"written\"}";
  const std::string frames = "haustra_tracking_latency_seconds_count";
  const std::string keyframes = "haustra_pool_used{pool=\"keyframes\"}";
  const std::string before = Ask("metrics");
  EXPECT_GE(Metric(before, checkpoints), 1.0);
  EXPECT_GE(Metric(before, keyframes), 1.0);
  ASSERT_EQ(Ask("end wipe"), "wiped\n");
  const std::string after = Ask("metrics");
  EXPECT_GE(Metric(after, checkpoints), Metric(before, checkpoints));
  EXPECT_GE(Metric(after, frames), Metric(before, frames));
  EXPECT_EQ(Metric(after, keyframes), 0.0);
  ASSERT_EQ(Ask("begin case-2"), "procedure 2\n");
  const std::string next = Ask("metrics");
  EXPECT_GE(Metric(next, checkpoints), Metric(after, checkpoints));
  EXPECT_GE(Metric(next, frames), Metric(after, frames));
}

TEST_F(DaemonDevice, WorkThatTakesLongDoesNotStopItsHeart) {
  RecordProperty("req", "DMN-002");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  haustra_ring ring;
  ASSERT_EQ(haustra_ring_open(&ring, (folder_ + "/poses").c_str()), HAUSTRA_OK);
  is_making_held_ = true;
  std::thread client([&] { EXPECT_EQ(Ask("end wipe"), "wiped\n"); });
  const bool is_held = Until([&] { return num_devices_ == 2; });
  const std::int64_t begin = haustra_now_ns();
  const bool beats =
      Until([&] { return __atomic_load_n(&ring.file->header.alive_ns, __ATOMIC_ACQUIRE) > begin; }, seconds(5));
  is_making_held_ = false;
  client.join();
  haustra_ring_close(&ring);
  EXPECT_TRUE(is_held);
  EXPECT_TRUE(beats);
}

// Who only looks is answered while a procedure ends, with what held before.
TEST_F(DaemonDevice, StatusIsAnsweredWhileAProcedureEnds) {
  RecordProperty("req", "CTL-003");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const auto look = [this](const std::string& what) {
    Result<ControlClient> client = ControlClient::Connect(folder_ + "/status");
    if (!client.ok()) return "error: " + client.status().message();
    const Result<std::string> reply = client->Ask(what, seconds(5));
    return reply.ok() ? *reply : "error: " + reply.status().message();
  };
  EXPECT_EQ(look("status").find("busy yes"), std::string::npos);
  is_making_held_ = true;
  std::thread client([&] { EXPECT_EQ(Ask("end wipe"), "wiped\n"); });
  const bool is_held = Until([&] { return num_devices_ == 2; });
  const std::string status = look("status");
  const std::string metrics = look("metrics");
  is_making_held_ = false;
  client.join();
  EXPECT_TRUE(is_held);
  EXPECT_NE(status.find("busy yes"), std::string::npos) << status;
  EXPECT_NE(metrics.find("haustra_"), std::string::npos) << metrics;
  EXPECT_EQ(look("status").find("busy yes"), std::string::npos);
}

TEST_F(DaemonDevice, IsWarmBeforeTheFirstProcedureBegins) {
  RecordProperty("req", "DMN-004");
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(faults_.num_extractions, 1);
}

TEST_F(DaemonDevice, SocketForStatusBeginsNothing) {
  RecordProperty("req", "CTL-003");
  ASSERT_NO_FATAL_FAILURE(Start());
  Result<ControlClient> client = ControlClient::Connect(folder_ + "/status");
  ASSERT_TRUE(client.ok()) << client.status().ToString();
  EXPECT_EQ(client->Ask("begin", kHangLimit).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(client->Ask("status", kHangLimit)->find("summary idle"), 0u);
  EXPECT_EQ(StatusValue("state"), "idle");
}

TEST_F(DaemonDevice, StopSavesWhatCouldNotBeKept) {
  RecordProperty("req", "DMN-004");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  fs::remove_all(folder_ + "/saved");
  EXPECT_TRUE(Ask("end keep").starts_with("error: data not kept"));
  ASSERT_EQ(StatusValue("state"), "stopped");
  fs::remove(folder_ + "/checkpoint.atlas");
  Terminate();
  EXPECT_EQ(exit_code_, kExitOk);
  EXPECT_TRUE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, AfterAStopInOrderSomebodySaysThatTheProcedureGoesOn) {
  RecordProperty("req", "DATA-003");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  Terminate();
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(StatusValue("interrupted"), "yes");
  EXPECT_EQ(StatusValue("label"), "case-1");
  EXPECT_TRUE(Ask("resume").starts_with("procedure "));
  EXPECT_EQ(StatusValue("label"), "case-1");
}

TEST_F(DaemonDevice, PoseBearsTheStampOfItsFrame) {
  RecordProperty("req", "TRK-002");
  is_live_ = true;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Ask("begin"), "procedure 1\n");
  haustra_ring ring;
  ASSERT_EQ(haustra_ring_open(&ring, (folder_ + "/poses").c_str()), HAUSTRA_OK);
  haustra_pose pose{};
  ASSERT_TRUE(Until([&] { return haustra_ring_latest_pose(&ring, &pose) == HAUSTRA_OK && pose.frame_index >= 5; }));
  haustra_ring_close(&ring);
  const std::lock_guard lock(stamps_mutex_);
  EXPECT_EQ(static_cast<std::int64_t>(pose.captured_ns), stamps_.at(pose.frame_index).time_since_epoch().count());
}

}  // namespace
}  // namespace haustra
