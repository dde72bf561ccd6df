// haustrad in this process and its worker in another, with a scripted camera and a vision device that may fail
// (scripted_worker.cc); no time is asserted.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "platform/clock/system_clock.h"
#include "platform/control/control_client.h"
#include "platform/daemon/daemon.h"
#include "platform/daemon/procedure_number.h"
#include "platform/daemon/procedure_store.h"
#include "platform/daemon/worker.h"
#include "platform/exit_codes.h"
#include "platform/publish/depth_table_writer.h"
#include "platform/publish/haustra_pose_ring.h"
#include "platform/publish/view_ring_writer.h"
#include "tests/engine/system/small_config.h"
#include "tests/platform/daemon/scripted_worker.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kHangLimit = seconds(60);

// The disk, as files in saved/ meet it.
std::atomic<bool> is_disk_held{false};  // it takes its time
std::atomic<bool> is_disk_full{false};  // it says so in the end
std::atomic<int> num_syncs_begun{0};
// Likewise of checkpoints.
std::atomic<bool> is_checkpoint_held{false};
std::atomic<int> num_checkpoints_begun{0};
// No file or folder of that name comes to the disk; null: all do.
std::atomic<const char*> broken_name{nullptr};

fs::path PathOf(int file) {
  std::error_code error;
  return fs::read_symlink("/proc/self/fd/" + std::to_string(file), error);
}

}  // namespace
}  // namespace haustra

// In place of the C library's.
extern "C" int fsync(int file) {
  const std::filesystem::path path = haustra::PathOf(file);
  if (const char* name = haustra::broken_name; name != nullptr && path.filename() == name) {
    errno = EIO;
    return -1;
  }
  if (path.filename().string().starts_with("checkpoint.atlas.partial")) {
    ++haustra::num_checkpoints_begun;
    while (haustra::is_checkpoint_held) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (path.parent_path().filename() == "saved") {
    ++haustra::num_syncs_begun;
    while (haustra::is_disk_held) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    // To overwrite what is there takes no room.
    if (haustra::is_disk_full && std::ifstream(path).peek() != 0) {
      errno = ENOSPC;
      return -1;
    }
  }
  return static_cast<int>(::syscall(SYS_fsync, file));
}

namespace haustra {
namespace {

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
    config_.watchdog.stop_limit_ms = config_.watchdog.worker_limit_ms = 60000;
    config_.watchdog.tracking_limit_ms = config_.watchdog.capture_limit_ms = 60000;
    config_.checkpoint.interval_s = 1;
    config_.files.state_folder = config_.files.runtime_folder = folder_;
    config_.log.level = "error";
    script_ = new (test::MapScript(folder_ + "/script")) test::WorkerScript;
    num_syncs_begun = num_checkpoints_begun = 0;
  }
  ~DaemonDevice() override {
    script_->is_making_held = is_disk_held = is_disk_full = is_checkpoint_held = false;
    broken_name = nullptr;
    Terminate();
    daemon_.reset();
    EXPECT_EQ(script_->num_races, 0) << "the thread sanitizer has reported a worker";
    munmap(script_, sizeof *script_);
    fs::remove_all(folder_);
  }

  void Start(bool awaits_idle = true) {
    has_ended_ = false;
    daemon_.reset();
    daemon_ = std::make_unique<Daemon>(
        config_, config_source_, clock_,
        StarterOf({HAUSTRA_SCRIPTED_WORKER, folder_ + "/script", kWorkerOption, std::to_string(kWorkerChannel)}));
    thread_ = std::thread([this] {
      exit_code_ = daemon_->Run();
      has_ended_ = true;
    });
    if (!awaits_idle) return;
    ASSERT_TRUE(Until([&] { return StatusValue("state") == "idle"; })) << Ask("status");
  }
  // A procedure with a map and a checkpoint.
  void BeginAndMap() {
    ASSERT_NO_FATAL_FAILURE(Start());
    ASSERT_EQ(Begin("case-1"), 1u);
    ASSERT_TRUE(Until([&] { return !StatusValue("checkpoint_age_s").empty(); })) << Ask("status");
  }
  void Terminate() {
    if (!thread_.joinable()) return;
    if (!has_ended_) ::kill(::getpid(), SIGTERM);
    thread_.join();
  }
  static std::string RefusalOf(const std::string& meant, const std::string& open) {
    return "error: meant for procedure " + meant + ", but it is procedure " + open +
           " that is open now: nothing was done";
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
  // Which procedure of this run of the service it is; 0: none was begun.
  std::uint64_t Begin(const std::string& label) const {
    const std::string answer = Ask(label.empty() ? "begin" : "begin " + label);
    const std::string head = "procedure ";
    EXPECT_TRUE(answer.starts_with(head)) << answer;
    return answer.starts_with(head) ? CountIn(answer.substr(head.size())) : 0;
  }
  static std::uint64_t CountIn(const std::string& number) {
    return number.empty() ? 0 : std::stoull(number) % kProceduresPerRun;
  }
  std::string StatusValue(const std::string& key) const {
    const std::string text = "\n" + Ask("status");
    const std::size_t at = text.find("\n" + key + " ");
    if (at == std::string::npos) return "";
    const std::size_t begin = at + key.size() + 2;
    return text.substr(begin, text.find('\n', begin) - begin);
  }
  // Tracking that is late, as on a machine with other work, may lose itself and begin a second map.
  bool HasMaps() const {
    const std::string num_maps = StatusValue("maps");
    return !num_maps.empty() && num_maps != "0";
  }
  bool Exists(const std::string& name) const { return fs::exists(folder_ + "/" + name); }
  // Which file it is, whatever its name; 0: none.
  ino_t Inode(const std::string& name) const {
    struct stat info {};
    return ::stat((folder_ + "/" + name).c_str(), &info) == 0 ? info.st_ino : 0;
  }
  std::set<std::string> NamesInSaved() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ + "/saved")) names.insert(entry.path().filename());
    return names;
  }
  struct Kept {
    std::string answer;  // to `end keep`
    std::set<std::string> names;
    bool is_checkpoint = false;  // that case-1.atlas was before
  };
  // `end keep`, whose worker goes when the maps are on their way to the disk.
  Kept EndKeepWithoutWorker(const std::function<void()>& lose_worker) {
    Kept kept;
    is_disk_held = true;
    std::thread client([&] { kept.answer = Ask("end keep"); });
    EXPECT_TRUE(Until([&] { return num_syncs_begun > 0; }));
    const ino_t checkpoint = Inode("checkpoint.atlas");
    EXPECT_NE(checkpoint, 0u);
    lose_worker();
    EXPECT_TRUE(Until([&] { return StatusValue("worker").empty(); })) << Ask("status");
    is_disk_held = false;
    client.join();
    kept.names = NamesInSaved();
    kept.is_checkpoint = Inode("saved/case-1.atlas") == checkpoint;
    return kept;
  }
  void KillWorker() const { ::kill(std::stoi(StatusValue("worker")), SIGKILL); }

  const SystemClock clock_;
  std::string folder_;
  DaemonConfig config_;
  ConfigSource config_source_;
  test::WorkerScript* script_ = nullptr;
  std::unique_ptr<Daemon> daemon_;
  std::thread thread_;
  std::atomic<bool> has_ended_{false};
  int exit_code_ = -1;
};

TEST_F(DaemonDevice, StatusSaysWhichDeviceWasChosen) {
  config_.vision.device = "auto";
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(StatusValue("device"), std::string(ResolveVisionDevice("auto"))) << Ask("status");
}

// A crash left them, and what they show is not to be published any more.
TEST_F(DaemonDevice, PicturesOfACrashAreWipedAlsoWhenNoneAreToBePublished) {
  RecordProperty("req", "DATA-001");
  const auto view = ViewRingWriter::Create(folder_ + "/view", 0600, static_cast<gid_t>(-1));
  const auto depth = DepthTableWriter::Create(folder_ + "/depth", 0600, static_cast<gid_t>(-1), 4);
  ASSERT_TRUE(view.ok() && depth.ok());
  const std::vector<std::uint8_t> pixels(64 * 48, 90);
  Frame frame;
  frame.image = {pixels.data(), 64, 48, 64, PixelFormat::kGrey8};
  (*view)->PublishPicture(frame, 1);
  haustra_depth_camera camera{};
  camera.procedure = 1;
  camera.step_px = 8;
  camera.grid_width = camera.grid_height = 2;
  (*depth)->PublishCamera(camera);
  haustra_view viewer;
  haustra_depth_table table;
  ASSERT_EQ(haustra_view_open(&viewer, (folder_ + "/view").c_str()), HAUSTRA_OK);
  ASSERT_EQ(haustra_depth_open(&table, (folder_ + "/depth").c_str()), HAUSTRA_OK);
  const auto picture = std::make_unique<haustra_picture>();
  EXPECT_EQ(haustra_view_latest_picture(&viewer, picture.get()), HAUSTRA_OK);
  EXPECT_EQ(haustra_depth_read_camera(&table, &camera), HAUSTRA_OK);
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_FALSE(Exists("view"));
  EXPECT_FALSE(Exists("depth"));
  // Who looks at them sees nothing any more.
  EXPECT_NE(haustra_view_latest_picture(&viewer, picture.get()), HAUSTRA_OK);
  EXPECT_NE(haustra_depth_read_camera(&table, &camera), HAUSTRA_OK);
  haustra_view_close(&viewer);
  haustra_depth_close(&table);
}

// Four seconds from frame to frame.
TEST_F(DaemonDevice, RecordingWithPausesLongerThanTheWatchdogWaitsCostsNoWorker) {
  RecordProperty("req", "DMN-010");
  config_.source.rate = 0.01;
  config_.watchdog.capture_limit_ms = 1500;
  ASSERT_NO_FATAL_FAILURE(Start());
  script_->num_extractions = 0;
  ASSERT_EQ(Begin("case-1"), 1u);
  EXPECT_TRUE(Until([&] { return script_->num_extractions >= 2 || has_ended_; }));
  EXPECT_EQ(script_->num_devices, 1);
  EXPECT_FALSE(has_ended_);
}

TEST_F(DaemonDevice, LostDeviceCostsAWorkerAndTheProcedureGoesOn) {
  RecordProperty("req", "DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const std::string first = StatusValue("worker");
  script_->is_lost = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 2; }));
  EXPECT_EQ(script_->num_devices, 2);
  EXPECT_NE(StatusValue("worker"), first);
  EXPECT_EQ(StatusValue("label"), "case-1");
  EXPECT_EQ(StatusValue("worker_faults"), "1");
  EXPECT_EQ(StatusValue("last_fault"), "the vision device is lost");
  ASSERT_TRUE(Until([&] { return HasMaps(); })) << "from the checkpoint";
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
}

TEST_F(DaemonDevice, DeviceThatIsLostAgainEndsTheServiceAndTheCheckpointStands) {
  RecordProperty("req", "DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_lost = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 2; }));
  script_->is_lost = true;
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_EQ(script_->num_devices, 2);
  EXPECT_TRUE(Exists("checkpoint.atlas"));
  EXPECT_TRUE(Exists("procedure"));
}

TEST_F(DaemonDevice, DeviceThatHangsCostsAWorkerAndTheSecondOneEndsTheService) {
  RecordProperty("req", "DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_silent = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 2; }));
  EXPECT_EQ(StatusValue("last_fault"), "the vision device hangs");
  script_->is_silent = true;
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_EQ(script_->num_devices, 2);
  EXPECT_TRUE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, DriverThatHangsCostsAWorker) {
  RecordProperty("req", "DMN-002,DMN-010");
  config_.watchdog.tracking_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_stuck = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 2; }));
  EXPECT_TRUE(StatusValue("last_fault").starts_with("tracking thread hangs")) << Ask("status");
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
}

TEST_F(DaemonDevice, EndComesThroughWhileADriverHangs) {
  RecordProperty("req", "DMN-010");
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_stuck = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
  EXPECT_FALSE(Exists("checkpoint.atlas"));
  EXPECT_FALSE(Exists("procedure"));
  EXPECT_EQ(Begin("case-2"), 2u) << "the next patient has a worker that works";
}

TEST_F(DaemonDevice, ProcedureThatCannotBeWipedKeepsTheNextOneOut) {
  RecordProperty("req", "DATA-001,DATA-003");
  config_.checkpoint.interval_s = 0;
  ASSERT_NO_FATAL_FAILURE(Start());
  const std::string checkpoint = folder_ + "/checkpoint.atlas";
  for (const std::string how : {"wipe", "keep"}) {
    ASSERT_TRUE(Ask("begin " + how).starts_with("procedure "));
    ASSERT_TRUE(Until([&] { return HasMaps(); })) << Ask("status");
    // No file: it can be neither overwritten nor removed, by anybody.
    fs::create_directory(checkpoint);
    const std::string answer = Ask("end " + how);
    EXPECT_TRUE(answer.starts_with("error: ") && answer.find(checkpoint) != std::string::npos) << answer;
    EXPECT_EQ(StatusValue("interrupted"), "yes");
    const std::string refusal = Ask("begin next");
    EXPECT_NE(refusal.find("'" + how + "' was not wiped: end it again first"), std::string::npos) << refusal;
    EXPECT_NE(refusal.find(checkpoint), std::string::npos) << refusal;
    EXPECT_TRUE(Exists("procedure")) << "the next service must know";
    fs::remove(checkpoint);
    EXPECT_EQ(Ask("end " + how), how == "wipe" ? "wiped\n" : "kept as keep\n");
    EXPECT_FALSE(Exists("procedure"));
  }
  EXPECT_TRUE(Exists("saved/keep.atlas"));
  EXPECT_FALSE(Exists("saved/keep-2.atlas"));
}

// Of before a crash. Somebody ended it while there was no camera, and it could not be wiped.
TEST_F(DaemonDevice, ProcedureThatSomebodyEndedDoesNotGoOnWhenTheCameraComes) {
  RecordProperty("req", "DATA-001,DMN-005");
  for (const std::string how : {"wipe", "keep"}) {
    // A record of this boot, and young: it would go on by itself.
    ASSERT_TRUE(ProcedureStore::Open(folder_).value()->WriteOpen("case-1", RecordedState::kRunning).ok());
    config_.source.path = "v4l2:scripted";
    script_->open_error = static_cast<int>(StatusCode::kUnavailable);
    Start(false);
    ASSERT_TRUE(Until([&] { return StatusValue("state") == "waiting_for_source"; })) << Ask("status");
    fs::create_directory(folder_ + "/checkpoint.atlas");
    const std::string answer = Ask("end " + how);
    EXPECT_TRUE(answer.starts_with("error: ")) << answer;
    script_->open_error = 0;
    ASSERT_TRUE(Until([&] { return StatusValue("state") == "idle" || StatusValue("state") == "running"; }));
    EXPECT_EQ(StatusValue("state"), "idle") << how;
    EXPECT_EQ(StatusValue("interrupted"), "yes") << how;
    fs::remove(folder_ + "/checkpoint.atlas");
    EXPECT_EQ(Ask("end wipe"), "wiped\n");
    Terminate();
    daemon_.reset();
  }
}

// The first dies in its start. The second has as long as the first had.
TEST_F(DaemonDevice, NextWorkerHasTheWholeTimeToStart) {
  RecordProperty("req", "DMN-007");
  config_.watchdog.work_limit_ms = 14000;
  script_->is_making_held = true;
  Start(false);
  for (const int taken_s : {11, 6}) {
    ASSERT_TRUE(Until([&] { return script_->pid != 0 || has_ended_; }));
    std::this_thread::sleep_for(seconds(taken_s));
    if (taken_s == 11) ::kill(script_->pid.exchange(0), SIGKILL);
  }
  script_->is_making_held = false;
  EXPECT_TRUE(Until([&] { return has_ended_ || StatusValue("state") == "idle"; })) << Ask("status");
  EXPECT_FALSE(has_ended_);
}

TEST_F(DaemonDevice, CheckpointThatCannotBeOverwrittenIsNotSaidToBeWiped) {
  RecordProperty("req", "DATA-001,DATA-003");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  broken_name = "checkpoint.atlas";
  for (const std::string turn : {"first", "again"}) {
    const std::string answer = Ask("end wipe");
    EXPECT_TRUE(answer.starts_with("error: ") && answer.find("checkpoint.atlas") != std::string::npos)
        << turn << ": " << answer;
    EXPECT_TRUE(Exists("checkpoint.atlas")) << turn << ": nobody could overwrite it any more";
    EXPECT_TRUE(Ask("begin next").starts_with("error: ")) << turn;
  }
  broken_name = nullptr;
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
  EXPECT_FALSE(Exists("checkpoint.atlas"));
}

// A checkpoint that was replaced, or a file that a crash left: the same patient's, or an unknown one's.
TEST_F(DaemonDevice, LeftoverThatCannotBeOverwrittenKeepsTheNextProcedureOut) {
  RecordProperty("req", "DATA-001,DATA-003");
  const char* leftover = "checkpoint.atlas.partial-1-2";
  std::ofstream(folder_ + "/" + leftover) << "maps";
  broken_name = leftover;
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(StatusValue("interrupted"), "yes");
  EXPECT_TRUE(Ask("begin next").starts_with("error: "));
  const std::string answer = Ask("end wipe");
  EXPECT_TRUE(answer.starts_with("error: ") && answer.find(leftover) != std::string::npos) << answer;
  EXPECT_TRUE(Exists(leftover));
  broken_name = nullptr;
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
  EXPECT_FALSE(Exists(leftover));
  EXPECT_EQ(Begin("next"), 1u);
}

TEST_F(DaemonDevice, CheckpointOfAnotherProcedureIsOfNoUse) {
  RecordProperty("req", "DATA-002");
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  fs::copy(folder_ + "/checkpoint.atlas", folder_ + "/other");
  // The next worker sees nothing: a map is the other's.
  script_->is_dark = true;
  ASSERT_EQ(Ask("end wipe"), "wiped\n");
  ASSERT_EQ(Begin("case-2"), 2u);
  fs::copy(folder_ + "/other", folder_ + "/checkpoint.atlas");
  script_->is_lost = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 3; }));
  EXPECT_FALSE(Until([&] { return HasMaps(); }, seconds(3))) << Ask("status");
  // Nor is it kept under a name that is not its own.
  script_->is_stuck = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  const std::string answer = Ask("end keep");
  EXPECT_NE(answer.find("there is no checkpoint to keep"), std::string::npos) << answer;
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
}

TEST_F(DaemonDevice, EndKeepsTheCheckpointWhenTheWorkerHangs) {
  RecordProperty("req", "DMN-005,DMN-010");
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_stuck = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  const std::string answer = Ask("end keep");
  EXPECT_TRUE(answer.starts_with("kept as case-1 from the checkpoint of ")) << answer;
  EXPECT_TRUE(answer.ends_with(" s before\n")) << answer;
  EXPECT_TRUE(StatusValue("trouble").starts_with("only the checkpoint of ")) << Ask("status");
  EXPECT_TRUE(Exists("saved/case-1.atlas"));
  EXPECT_FALSE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, TroubleIsOfTheProcedureThatHadIt) {
  RecordProperty("req", "DMN-007");
  config_.source.path = "v4l2:scripted";
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_stuck = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  script_->open_error = static_cast<int>(StatusCode::kUnavailable);
  EXPECT_TRUE(Ask("end keep").starts_with("kept as case-1 from the checkpoint of "));
  // Both are to be known: what came of the last one, and why no other can begin.
  const std::string both = StatusValue("trouble");
  EXPECT_NE(both.find("only the checkpoint of "), std::string::npos) << both;
  EXPECT_NE(both.find("/dev/video7: does not offer 1920x1080"), std::string::npos) << both;
  const std::string refusal = Ask("begin case-2");
  EXPECT_EQ(refusal, "error: there is no camera: /dev/video7: does not offer 1920x1080; it offers 1280x720");
  script_->open_error = 0;
  EXPECT_TRUE(Until([&] { return StatusValue("state") == "idle"; })) << Ask("status");
  const std::string last = StatusValue("trouble");
  EXPECT_TRUE(last.starts_with("only the checkpoint of ") && last.ends_with(" could be kept, as case-1")) << last;
  ASSERT_EQ(Begin("case-2"), 2u);
  EXPECT_EQ(StatusValue("trouble"), "");
}

TEST_F(DaemonDevice, TroubleOfACameraEndsWithTheWorkerThatWaitedForIt) {
  RecordProperty("req", "DMN-007");
  config_.source.path = "v4l2:scripted";
  script_->open_error = static_cast<int>(StatusCode::kUnavailable);
  Start(false);
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "waiting_for_source"; }));
  // The next worker finds the camera at once, and never waits.
  script_->open_error = 0;
  KillWorker();
  ASSERT_TRUE(Until([&] { return !StatusValue("device").empty(); })) << Ask("status");
  EXPECT_EQ(StatusValue("trouble"), "");
}

TEST_F(DaemonDevice, MapsOnTheirWayToTheDiskAreKeptWhenTheirWorkerDies) {
  RecordProperty("req", "DMN-005,DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const Kept kept = EndKeepWithoutWorker([this] { KillWorker(); });
  EXPECT_EQ(kept.answer, "kept as case-1\n");
  EXPECT_EQ(kept.names, std::set<std::string>{"case-1.atlas"});
  EXPECT_FALSE(kept.is_checkpoint) << "an older file has replaced them";
  EXPECT_FALSE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, CheckpointOnItsWayToASlowDiskIsWhatTheNextWorkerGoesOnWith) {
  RecordProperty("req", "DMN-005,DMN-010");
  is_checkpoint_held = true;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin("case-1"), 1u);
  ASSERT_TRUE(Until([&] { return num_checkpoints_begun > 0; })) << Ask("status");
  ASSERT_TRUE(HasMaps()) << Ask("status");
  script_->is_dark = true;  // from here on nothing can be mapped
  const std::string first = StatusValue("worker");
  KillWorker();
  const auto has_next = [&] { return !StatusValue("device").empty() && StatusValue("worker") != first; };
  ASSERT_TRUE(Until(has_next)) << Ask("status");
  std::this_thread::sleep_for(milliseconds(300));
  is_checkpoint_held = false;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running"; })) << Ask("status");
  EXPECT_TRUE(Until([&] { return HasMaps(); }, seconds(5))) << Ask("status");
}

TEST_F(DaemonDevice, MapsOnTheirWayToASlowDiskAreKeptWhenTheTimeIsUp) {
  RecordProperty("req", "DMN-005,DMN-010");
  // A process has it to start, too, which takes seconds on a machine with other work.
  config_.watchdog.work_limit_ms = 6000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const Kept kept = EndKeepWithoutWorker([] {});
  EXPECT_EQ(kept.answer, "kept as case-1\n");
  EXPECT_EQ(kept.names, std::set<std::string>{"case-1.atlas"});
  EXPECT_FALSE(kept.is_checkpoint) << "an older file has replaced them";
}

TEST_F(DaemonDevice, ADiskThatTakesItsTimeAfterTheWorkerDiedIsNoFault) {
  RecordProperty("req", "DMN-002,DMN-005");
  config_.watchdog.work_limit_ms = 6000;  // as above
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const Kept kept = EndKeepWithoutWorker([this] {
    KillWorker();
    std::this_thread::sleep_for(milliseconds(config_.watchdog.work_limit_ms + 500));
  });
  EXPECT_EQ(kept.answer, "kept as case-1\n");
  EXPECT_TRUE(StatusValue("last_fault").starts_with("the worker ended: ")) << Ask("status");
}

TEST_F(DaemonDevice, CheckpointIsKeptWhenTheMapsOfAWorkerThatDiedDoNotComeToTheDisk) {
  RecordProperty("req", "DMN-005,DMN-010");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  const Kept kept = EndKeepWithoutWorker([this] {
    is_disk_full = true;
    KillWorker();
  });
  EXPECT_TRUE(kept.answer.starts_with("kept as case-1 from the checkpoint of ")) << kept.answer;
  EXPECT_EQ(kept.names, std::set<std::string>{"case-1.atlas"});
  EXPECT_TRUE(kept.is_checkpoint);
}

TEST_F(DaemonDevice, CheckpointThatMayNotOutlastAPowerCutIsKeptByAnotherTry) {
  RecordProperty("req", "DMN-005");
  const auto store = ProcedureStore::Open(folder_);
  ASSERT_TRUE(store.ok()) << store.status().ToString();
  std::ofstream((*store)->checkpoint_path()) << "maps";
  broken_name = "saved";
  const Result<std::string> failed = (*store)->KeepCheckpoint("case-1");
  broken_name = nullptr;
  EXPECT_EQ(failed.code(), StatusCode::kUnavailable);
  EXPECT_NE(failed.status().message().find("case-1.atlas: would not outlast a power cut"), std::string::npos)
      << failed.status().message();
  EXPECT_TRUE(Exists("checkpoint.atlas"));
  EXPECT_TRUE(NamesInSaved().empty());
  const Result<std::string> kept = (*store)->KeepCheckpoint("case-1");
  ASSERT_TRUE(kept.ok()) << kept.status().ToString();
  EXPECT_EQ(*kept, "case-1");
  EXPECT_FALSE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, EndKeepsBesideASaveOfThatNameThatIsUnderWay) {
  RecordProperty("req", "DMN-005");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  is_disk_held = true;
  std::string saved, kept;
  std::thread client([&] { saved = Ask("save case-1"); });
  EXPECT_TRUE(Until([&] { return num_syncs_begun > 0; }));
  std::thread other([&] { kept = Ask("end keep"); });
  EXPECT_TRUE(Until([&] { return StatusValue("summary").ends_with(": keeping"); })) << Ask("status");
  is_disk_held = false;
  client.join();
  other.join();
  EXPECT_EQ(saved, "saved " + folder_ + "/saved/case-1.atlas\n");
  EXPECT_EQ(kept, "kept as case-1-2\n");
  EXPECT_EQ(NamesInSaved(), (std::set<std::string>{"case-1-2.atlas", "case-1.atlas"}));
}

TEST_F(DaemonDevice, SavesThatAreAskedForAtATimeWaitForEachOther) {
  RecordProperty("req", "DMN-005");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  // A checkpoint may come between.
  for (const std::string round : {"a", "b", "c", "d", "e", "f"}) {
    std::array<std::string, 3> answers;
    std::vector<std::thread> clients;
    for (std::size_t i = 0; i < answers.size(); ++i) {
      clients.emplace_back([&, i] { answers[i] = Ask("save " + round + std::to_string(i)); });
    }
    for (std::thread& client : clients) client.join();
    for (std::size_t i = 0; i < answers.size(); ++i) {
      EXPECT_EQ(answers[i], "saved " + folder_ + "/saved/" + round + std::to_string(i) + ".atlas\n");
    }
  }
}

// What is in a save that somebody asked for does not help after a crash.
TEST_F(DaemonDevice, SaveInBetweenCostsNoCheckpoint) {
  RecordProperty("req", "DMN-005");
  config_.checkpoint.interval_s = 0;
  config_source_.assignments = {"checkpoint.interval_s=1", "log.level=error"};
  for (const std::string key : {"tracking", "capture", "worker", "stop", "work"}) {
    config_source_.assignments.push_back("watchdog." + key + "_limit_ms=60000");
  }
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin("case-1"), 1u);
  ASSERT_TRUE(Until([&] { return HasMaps(); })) << Ask("status");
  // From here on nothing can be seen, and the maps stay as they are.
  ASSERT_TRUE(Until([&] { return StatusValue("tracking") == "lost"; })) << Ask("status");
  std::this_thread::sleep_for(seconds(1));
  EXPECT_TRUE(Ask("save between").starts_with("saved "));
  is_disk_full = true;
  EXPECT_TRUE(Ask("save failed").starts_with("error: "));
  is_disk_full = false;
  // The worker has said how things stand since.
  std::this_thread::sleep_for(seconds(1));
  ::kill(::getpid(), SIGHUP);
  ASSERT_TRUE(Until([&] { return Exists("checkpoint.atlas"); }, seconds(20))) << Ask("status");
  // Nor is what a checkpoint has written again.
  EXPECT_TRUE(Until([&] { return StatusValue("checkpoints") != "0"; }));
  std::this_thread::sleep_for(seconds(3));
  EXPECT_EQ(StatusValue("checkpoints"), "1");
}

TEST_F(DaemonDevice, StopComesThroughWhileADriverHangs) {
  RecordProperty("req", "DMN-010");
  config_.watchdog.stop_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_stuck = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  ::kill(::getpid(), SIGTERM);
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_TRUE(Exists("checkpoint.atlas"));
}

// While it is ready, while it begins, while it runs, while it ends; while a checkpoint is written, sooner or later.
TEST_F(DaemonDevice, WorkerThatIsKilledAtAnyMomentCostsAWorker) {
  RecordProperty("req", "DMN-005,DMN-010");
  ASSERT_NO_FATAL_FAILURE(Start());
  const auto kill_worker = [this] {
    const std::string pid = StatusValue("worker");
    if (!pid.empty()) ::kill(std::stoi(pid), SIGKILL);
  };
  kill_worker();
  ASSERT_TRUE(Until([&] { return script_->num_devices == 2 && StatusValue("state") == "idle"; }));
  for (int i = 0; i < 24; ++i) {
    const std::string label = "case-" + std::to_string(i);
    std::thread client([&] { EXPECT_TRUE(Ask("begin " + label).starts_with("procedure ")) << label; });
    if (i % 3 == 0) {
      // Two that die while nothing is asked of them end the service.
      Until([&] { return StatusValue("state") != "idle"; });
      std::this_thread::sleep_for(milliseconds(i));
      kill_worker();
    }
    client.join();
    if (i % 3 == 1) {
      std::this_thread::sleep_for(milliseconds(37 * i));
      kill_worker();
    }
    ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && StatusValue("busy").empty(); }))
        << Ask("status");
    EXPECT_EQ(StatusValue("label"), label);
    ASSERT_TRUE(Until([&] { return HasMaps(); })) << Ask("status");
    std::thread end([&] {
      const std::string answer = Ask(i % 2 == 0 ? "end wipe" : "end keep");
      EXPECT_TRUE(answer == "wiped\n" || answer == "kept as " + label + "\n" ||
                  answer.starts_with("kept as " + label + " from ") || answer.starts_with("error: data not kept"))
          << answer;
      if (answer.starts_with("error")) {
        EXPECT_EQ(Ask("end wipe"), "wiped\n");
      }
    });
    if (i % 3 == 2) {
      std::this_thread::sleep_for(milliseconds(3 * i));
      kill_worker();
    }
    end.join();
    ASSERT_TRUE(Until([&] { return StatusValue("state") == "idle"; })) << Ask("status");
    EXPECT_FALSE(Exists("checkpoint.atlas"));
    EXPECT_FALSE(Exists("procedure"));
    for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
      EXPECT_EQ(entry.path().string().find(".partial-"), std::string::npos) << entry.path();
    }
  }
  Terminate();
  EXPECT_EQ(exit_code_, kExitOk);
}

TEST_F(DaemonDevice, WorkerThatIsStoppedCostsAWorker) {
  RecordProperty("req", "DMN-002,DMN-010");
  config_.watchdog.worker_limit_ms = 3000;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  ::kill(std::stoi(StatusValue("worker")), SIGSTOP);
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 2; }));
  EXPECT_EQ(StatusValue("last_fault"), "the worker gives no sign of life");
}

TEST_F(DaemonDevice, WorkerThatTalksNonsenseIsNotListenedTo) {
  RecordProperty("req", "DMN-010");
  script_->talks_nonsense = true;
  ASSERT_NO_FATAL_FAILURE(Start(false));
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(exit_code_, kExitUnavailable);
}

TEST_F(DaemonDevice, WorkerThatDiesWhileItStartsEndsTheService) {
  RecordProperty("req", "DMN-010");
  script_->cannot_start = true;
  ASSERT_NO_FATAL_FAILURE(Start(false));
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(script_->num_devices, 2) << "tried once more";
  EXPECT_EQ(exit_code_, kExitUnavailable);
}

int NumLines(const std::string& log, const std::string& what) {
  int num_lines = 0;
  for (std::size_t at = log.find(what); at != std::string::npos; at = log.find(what, at + 1)) ++num_lines;
  return num_lines;
}

TEST_F(DaemonDevice, CameraWithoutItsModeIsWaitedForAndTheLogSaysSoOnce) {
  RecordProperty("req", "DMN-007");
  config_.source.path = "v4l2:scripted";
  config_.log.level = "warning";
  script_->open_error = static_cast<int>(StatusCode::kUnavailable);
  testing::internal::CaptureStderr();
  Start(false);
  EXPECT_TRUE(Until([&] { return script_->num_opens >= 3 && StatusValue("state") == "waiting_for_source"; }));
  const std::string offer = "/dev/video7: does not offer 1920x1080; it offers 1280x720";
  EXPECT_EQ(StatusValue("trouble"), offer);
  script_->open_error = 0;
  EXPECT_TRUE(Until([&] { return StatusValue("state") == "idle"; })) << Ask("status");
  EXPECT_EQ(StatusValue("trouble"), "");
  Terminate();
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_EQ(NumLines(log, "waiting_for_source source=v4l2:scripted what=\"" + offer + "\"\n"), 1) << log;
  EXPECT_EQ(exit_code_, kExitOk);
}

// No camera brings a calibration that is not there, or another size of a mask.
TEST_F(DaemonDevice, WhatNoCameraCanMendEndsTheService) {
  RecordProperty("req", "DMN-001");
  config_.source.path = "v4l2:scripted";
  for (const auto& [error, code] :
       {std::pair{StatusCode::kNotFound, kExitNoInput}, std::pair{StatusCode::kInvalidArgument, kExitBadData}}) {
    script_->open_error = static_cast<int>(error);
    ASSERT_NO_FATAL_FAILURE(Start(false));
    EXPECT_TRUE(HasEnded()) << Ask("status");
    Terminate();
    EXPECT_EQ(exit_code_, code);
  }
}

TEST_F(DaemonDevice, WhyThereIsNoSignalIsInTheStatusAndOnceInTheLog) {
  RecordProperty("req", "DMN-007");
  script_->is_live = true;
  config_.log.level = "info";
  testing::internal::CaptureStderr();
  Start();
  EXPECT_EQ(Begin(""), 1u);
  EXPECT_TRUE(Until([&] { return StatusValue("service") == "running"; })) << Ask("status");
  script_->is_unplugged = true;
  EXPECT_TRUE(Until([&] { return StatusValue("service") == "no_signal"; })) << Ask("status");
  EXPECT_EQ(StatusValue("trouble"), "/dev/video7: the tower sends 1280x720");
  std::this_thread::sleep_for(seconds(2));
  script_->is_unplugged = false;
  EXPECT_TRUE(Until([&] { return StatusValue("service") == "running"; })) << Ask("status");
  EXPECT_EQ(StatusValue("trouble"), "");
  Terminate();
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_EQ(NumLines(log, "no_signal source=scripted what=\"/dev/video7: the tower sends 1280x720\"\n"), 1) << log;
  EXPECT_EQ(NumLines(log, "signal_is_back"), 1) << log;
}

TEST_F(DaemonDevice, TimesThatJumpAreInTheLogAndDoNotFillIt) {
  RecordProperty("req", "DMN-007");
  script_->is_live = script_->do_stamps_jump = true;
  config_.log.level = "warning";
  testing::internal::CaptureStderr();
  Start();
  EXPECT_EQ(Begin(""), 1u);
  EXPECT_TRUE(Until([&] { return script_->num_extractions > 30; })) << Ask("status");
  Terminate();
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_EQ(NumLines(log, "frame_time_jumps "), 1) << log;
  EXPECT_EQ(NumLines(log, " is taken\""), 1) << log;
}

TEST_F(DaemonDevice, DamagedFramesDoNotFillTheLog) {
  RecordProperty("req", "DMN-007");
  script_->is_live = script_->are_all_torn = true;
  config_.log.level = "warning";
  testing::internal::CaptureStderr();
  Start();
  EXPECT_EQ(Begin(""), 1u);
  const auto num_damaged = [&] { return std::stoi("0" + StatusValue("frames_damaged")); };
  EXPECT_TRUE(Until([&] { return num_damaged() > 100; })) << Ask("status");
  const int num_all = num_damaged();
  Terminate();
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_GE(NumLines(log, "frame_damaged "), 1) << log;
  EXPECT_LT(NumLines(log, "frame_damaged "), num_all / 2) << log;
}

// Four seconds until the camera is back.
TEST_F(DaemonDevice, CameraThatIsSlowToComeBackCostsNoWorker) {
  RecordProperty("req", "DMN-002,DMN-007");
  script_->is_live = true;
  config_.watchdog.capture_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin(""), 1u);
  ASSERT_TRUE(Until([&] { return StatusValue("service") == "running"; })) << Ask("status");
  script_->num_slow_calls = 4;
  EXPECT_TRUE(Until([&] { return script_->num_slow_calls == 0; }));
  const int num_before = script_->num_extractions;
  EXPECT_TRUE(Until([&] { return script_->num_extractions > num_before; }));
  EXPECT_EQ(StatusValue("worker_faults"), "");
}

// Memory is taken and locked before.
TEST_F(DaemonDevice, CaptureHasTheTimeOfAJobForItsFirstSignOfLife) {
  RecordProperty("req", "DMN-002");
  script_->is_live = true;
  script_->first_frame_ms = 5000;
  config_.watchdog.capture_limit_ms = 2000;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin(""), 1u);
  EXPECT_TRUE(Until([&] { return StatusValue("service") == "running"; })) << Ask("status");
  EXPECT_EQ(StatusValue("worker_faults"), "") << Ask("status");
}

TEST_F(DaemonDevice, LimitOfWorkThatWasReloadedIsThatOfTheWorkerThatRuns) {
  RecordProperty("req", "DMN-003");
  script_->is_live = true;
  config_.watchdog.capture_limit_ms = 2000;
  config_.watchdog.work_limit_ms = 600000;
  config_source_.assignments = {"watchdog.capture_limit_ms=2000", "watchdog.work_limit_ms=3000", "log.level=error"};
  for (const std::string key : {"tracking", "worker", "stop"}) {
    config_source_.assignments.push_back("watchdog." + key + "_limit_ms=60000");
  }
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin(""), 1u);
  ASSERT_TRUE(Until([&] { return StatusValue("service") == "running"; })) << Ask("status");
  ::kill(::getpid(), SIGHUP);
  script_->has_stuck_call = true;
  EXPECT_TRUE(Until([&] { return StatusValue("worker_faults") == "1"; }, seconds(30))) << Ask("status");
  script_->has_stuck_call = false;
}

// Its journal may be started anew while it runs.
TEST_F(DaemonDevice, LogThatNobodyReadsEndsNeitherServiceNorWorker) {
  RecordProperty("req", "DMN-010");
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  ::close(ends[0]);
  const int log = ::dup(STDERR_FILENO);
  ::dup2(ends[1], STDERR_FILENO);
  ::close(ends[1]);
  config_.log.level = "debug";
  BeginAndMap();
  const std::string faults = StatusValue("worker_faults");
  Terminate();
  ::dup2(log, STDERR_FILENO);
  ::close(log);
  EXPECT_EQ(faults, "");
  EXPECT_EQ(exit_code_, kExitOk);
}

TEST_F(DaemonDevice, DriverThatNeverReturnsCostsAWorker) {
  RecordProperty("req", "DMN-002,DMN-010");
  script_->is_live = true;
  config_.watchdog.capture_limit_ms = 2000;
  config_.watchdog.work_limit_ms = 6000;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin(""), 1u);
  ASSERT_TRUE(Until([&] { return StatusValue("service") == "running"; })) << Ask("status");
  script_->has_stuck_call = true;
  EXPECT_TRUE(Until([&] { return StatusValue("worker_faults") == "1"; })) << Ask("status");
  script_->has_stuck_call = false;
  EXPECT_TRUE(StatusValue("last_fault").starts_with("capture thread hangs for ")) << Ask("status");
  EXPECT_TRUE(Until([&] { return CountIn(StatusValue("procedure")) == 2 && StatusValue("service") == "running"; }));
}

// The maps do not need the camera: all of them are kept, not only those of the last checkpoint.
TEST_F(DaemonDevice, EndKeepsTheMapsWhileADriverCallOfTheCameraIsStuck) {
  RecordProperty("req", "DMN-010");
  script_->is_live = true;
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->has_stuck_call = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  EXPECT_EQ(Ask("end keep"), "kept as case-1\n");
  EXPECT_TRUE(Exists("saved/case-1.atlas"));
  EXPECT_FALSE(Exists("checkpoint.atlas"));
  EXPECT_EQ(StatusValue("worker_faults"), "");
  EXPECT_EQ(StatusValue("state"), "idle");
}

TEST_F(DaemonDevice, StopSavesTheMapsWhileADriverCallOfTheCameraIsStuck) {
  RecordProperty("req", "DMN-004");
  script_->is_live = true;
  config_.checkpoint.interval_s = 0;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin(""), 1u);
  ASSERT_TRUE(Until([&] { return HasMaps(); })) << Ask("status");
  script_->has_stuck_call = true;
  ASSERT_TRUE(Until([&] { return script_->num_stuck > 0; }));
  Terminate();
  EXPECT_EQ(exit_code_, kExitOk);
  EXPECT_TRUE(Exists("checkpoint.atlas"));
}

TEST_F(DaemonDevice, WorkerThatHangsAfterItsCameraCameEndsTheService) {
  RecordProperty("req", "DMN-010");
  config_.source.path = "v4l2:scripted";
  // A process has it to start, too, which takes seconds on a machine with other work.
  config_.watchdog.work_limit_ms = 6000;
  script_->num_waits = 8;  // longer than the limit, which is for each look
  script_->is_making_held = true;
  ASSERT_NO_FATAL_FAILURE(Start(false));
  ASSERT_TRUE(HasEnded());
  EXPECT_EQ(script_->num_waits, 0);
  EXPECT_EQ(script_->num_devices, 2) << "tried once more";
  EXPECT_EQ(exit_code_, kExitUnavailable);
}

TEST_F(DaemonDevice, WorkerEndsWithTheService) {
  RecordProperty("req", "DMN-006");
  ASSERT_NO_FATAL_FAILURE(Start());
  const pid_t worker = std::stoi(StatusValue("worker"));
  EXPECT_EQ(::kill(worker, 0), 0);
  Terminate();
  EXPECT_NE(::kill(worker, 0), 0);
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
  ASSERT_EQ(Begin("case-2"), 2u);
  const std::string next = Ask("metrics");
  EXPECT_GE(Metric(next, checkpoints), Metric(after, checkpoints));
  EXPECT_GE(Metric(next, frames), Metric(after, frames));
}

TEST_F(DaemonDevice, WorkThatTakesLongDoesNotStopItsHeart) {
  RecordProperty("req", "DMN-002");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  haustra_ring ring;
  ASSERT_EQ(haustra_ring_open(&ring, (folder_ + "/poses").c_str()), HAUSTRA_OK);
  script_->is_making_held = true;
  std::thread client([&] { EXPECT_EQ(Ask("end wipe"), "wiped\n"); });
  const bool is_held = Until([&] { return script_->num_devices == 2; });
  const std::int64_t begin = haustra_now_ns();
  const bool beats =
      Until([&] { return __atomic_load_n(&ring.file->header.alive_ns, __ATOMIC_ACQUIRE) > begin; }, seconds(5));
  script_->is_making_held = false;
  client.join();
  haustra_ring_close(&ring);
  EXPECT_TRUE(is_held);
  EXPECT_TRUE(beats);
}

// Who only looks is answered while a procedure ends.
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
  script_->is_making_held = true;
  std::thread client([&] { EXPECT_EQ(Ask("end wipe"), "wiped\n"); });
  const bool is_held = Until([&] { return script_->num_devices == 2; });
  const std::string status = look("status");
  const std::string metrics = look("metrics");
  script_->is_making_held = false;
  client.join();
  EXPECT_TRUE(is_held);
  EXPECT_NE(status.find("busy yes"), std::string::npos) << status;
  EXPECT_NE(metrics.find("haustra_"), std::string::npos) << metrics;
  EXPECT_EQ(look("status").find("busy yes"), std::string::npos);
}

TEST_F(DaemonDevice, RequestOfAClientThatHasGoneIsNotCarriedOut) {
  RecordProperty("req", "CTL-003");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_making_held = true;
  std::thread client([&] { EXPECT_EQ(Ask("end wipe"), "wiped\n"); });
  EXPECT_TRUE(Until([&] { return script_->num_devices == 2; }));
  // More than may be connected at one time.
  for (int i = 0; i < 40; ++i) {
    Result<ControlClient> hasty = ControlClient::Connect(folder_ + "/control");
    EXPECT_TRUE(hasty.ok()) << hasty.status().ToString();
    if (hasty.ok()) {
      EXPECT_FALSE(hasty->Ask("begin case-2", milliseconds(i == 0 ? 300 : 20)).ok()) << i;
    }
  }
  script_->is_making_held = false;
  client.join();
  EXPECT_EQ(StatusValue("state"), "idle");
  EXPECT_EQ(StatusValue("label"), "");
  EXPECT_FALSE(Exists("procedure"));
  EXPECT_EQ(Begin("case-3"), 2u);
}

// Frames are numbered anew in each, so an order that comes late would be done to another patient.
TEST_F(DaemonDevice, OrdersOfMarksAreForTheProcedureThatTheyMean) {
  RecordProperty("req", "DATA-002");
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin("case-1"), 1u);
  const std::string first = StatusValue("procedure");
  EXPECT_EQ(Ask("unmark polyp " + first), "error: there is no mark 'polyp'");
  script_->is_making_held = true;
  std::thread end([&] { EXPECT_EQ(Ask("end wipe"), "wiped\n"); });
  EXPECT_TRUE(Until([&] { return script_->num_devices == 2; }));
  // They wait for the end, and the next procedure begins before the last one's turn comes.
  std::string late;
  std::thread begin([&] { EXPECT_EQ(Begin("case-2"), 2u); });
  std::this_thread::sleep_for(milliseconds(200));
  std::thread unmark([&] { late = Ask("unmark polyp"); });
  std::this_thread::sleep_for(milliseconds(200));
  script_->is_making_held = false;
  for (std::thread* client : {&end, &begin, &unmark}) client->join();
  const std::string second = StatusValue("procedure");
  EXPECT_EQ(late, RefusalOf(first, second));
  EXPECT_EQ(Ask("mark 100 100 polyp 0 " + first), RefusalOf(first, second));
  EXPECT_EQ(Ask("unmark polyp " + first), RefusalOf(first, second));
  EXPECT_EQ(Ask("unmark polyp " + second), "error: there is no mark 'polyp'");
}

// Whoever waits may connect again by himself, as `haustra view` does.
TEST_F(DaemonDevice, OrderOfMarksThatOutlivesARestartIsRefused) {
  RecordProperty("req", "DATA-002");
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin("case-1"), 1u);
  const std::string first = StatusValue("procedure");
  EXPECT_EQ(Ask("end wipe"), "wiped\n");
  Terminate();
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin("case-2"), 1u);
  const std::string second = StatusValue("procedure");
  EXPECT_EQ(Ask("mark 100 100 polyp 0 " + first), RefusalOf(first, second));
  EXPECT_EQ(Ask("unmark polyp " + first), RefusalOf(first, second));
}

TEST_F(DaemonDevice, IsWarmBeforeTheFirstProcedureBegins) {
  RecordProperty("req", "DMN-004");
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(script_->num_extractions, 2);
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

TEST_F(DaemonDevice, InterruptedProcedureDoesNotGoOnAfterAStopInOrder) {
  RecordProperty("req", "DATA-003");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  script_->is_lost = true;
  ASSERT_TRUE(Until([&] { return StatusValue("state") == "running" && CountIn(StatusValue("procedure")) == 2; }));
  script_->is_lost = true;
  ASSERT_TRUE(HasEnded());
  thread_.join();
  // It does not go on by itself, as when its camera is away; and then the service is stopped.
  config_.procedure.resume_limit_s = 0;
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(StatusValue("interrupted"), "yes");
  Terminate();
  EXPECT_EQ(exit_code_, kExitOk);
  config_.procedure.resume_limit_s = 600;
  ASSERT_NO_FATAL_FAILURE(Start());
  EXPECT_EQ(StatusValue("interrupted"), "yes");
}

TEST_F(DaemonDevice, ResumedProcedureShowsItsMapBeforeThatChanges) {
  RecordProperty("req", "DATA-003");
  ASSERT_NO_FATAL_FAILURE(BeginAndMap());
  Terminate();
  script_->is_dark = true;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_TRUE(Ask("resume").starts_with("procedure "));
  EXPECT_TRUE(Until([&] { return HasMaps(); }, seconds(20))) << Ask("status");
}

TEST_F(DaemonDevice, PoseBearsTheStampOfItsFrame) {
  RecordProperty("req", "TRK-002");
  script_->is_live = true;
  ASSERT_NO_FATAL_FAILURE(Start());
  ASSERT_EQ(Begin(""), 1u);
  haustra_ring ring;
  ASSERT_EQ(haustra_ring_open(&ring, (folder_ + "/poses").c_str()), HAUSTRA_OK);
  haustra_pose pose{};
  ASSERT_TRUE(Until([&] { return haustra_ring_latest_pose(&ring, &pose) == HAUSTRA_OK && pose.frame_index >= 5; }));
  haustra_ring_close(&ring);
  EXPECT_EQ(static_cast<std::int64_t>(pose.captured_ns), script_->stamps_ns.at(pose.frame_index));
}

}  // namespace
}  // namespace haustra
