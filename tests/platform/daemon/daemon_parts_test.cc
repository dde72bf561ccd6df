#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "capture/files/file_sink.h"
#include "capture/files/wipe_file.h"
#include "hal/fakes/frame_tag.h"
#include "hal/fakes/manual_clock.h"
#include "hal/fakes/scripted_frame_source.h"
#include "platform/clock/system_clock.h"
#include "platform/config/engine_config_table.h"
#include "platform/daemon/daemon_config.h"
#include "platform/daemon/file_worker.h"
#include "platform/daemon/health.h"
#include "platform/daemon/log.h"
#include "platform/daemon/procedure_store.h"
#include "platform/daemon/status_text.h"
#include "platform/daemon/supervised_source.h"
#include "platform/exit_codes.h"
#include "tests/capture/plain_file_system.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;

class StateFolder {
 public:
  StateFolder() {
    std::string pattern = testing::TempDir() + "daemon_parts_XXXXXX";
    path_ = mkdtemp(pattern.data());
  }
  ~StateFolder() { fs::remove_all(path_); }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

void Write(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }
std::string Read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// --- Configuration.

// Wrong arguments, configuration, calibration or source stay wrong. A device, a disk or another service may come round.
TEST(ServiceUnit, IsStartedAgainWhereThatMayMendIt) {
  RecordProperty("req", "DMN-001");
  const std::string unit = "\n" + Read(HAUSTRA_CONFIG_FOLDER "/service/haustrad.service");
  const std::string key = "\nRestartPreventExitStatus=";
  const std::size_t at = unit.find(key);
  ASSERT_NE(at, std::string::npos);
  std::istringstream codes(unit.substr(at + key.size(), unit.find('\n', at + 1) - at - key.size()));
  EXPECT_EQ(std::set<int>(std::istream_iterator<int>(codes), {}),
            (std::set<int>{kExitUsage, kExitBadData, kExitNoInput, kExitConfig}));
  EXPECT_NE(unit.find("\nRestart=on-failure\n"), std::string::npos);
}

TEST(DaemonConfig, OneFileHoldsEngineAndService) {
  const StateFolder folder;
  Write(folder / "a.yaml", "noise:\n  k: 2\nsource:\n  path: /dev/video0\ncheckpoint:\n  interval_s: 7\n");
  const auto loaded = LoadDaemonConfig(folder / "a.yaml", {"procedure.keep_data=true"});
  ASSERT_TRUE(loaded.ok()) << loaded.status().ToString();
  EXPECT_EQ(loaded->config().engine.noise.k, 2.0);
  EXPECT_EQ(loaded->config().source.path, "/dev/video0");
  EXPECT_EQ(loaded->config().checkpoint.interval_s, 7);
  EXPECT_TRUE(loaded->config().procedure.keep_data);
  // What is printed is a configuration, and the same one.
  Write(folder / "b.yaml", loaded->Print());
  const auto again = LoadDaemonConfig(folder / "b.yaml", {});
  ASSERT_TRUE(again.ok()) << again.status().ToString();
  EXPECT_EQ(again->config().source.path, "/dev/video0");
  EXPECT_EQ(again->config().engine.noise.k, 2.0);
}

TEST(DaemonConfig, MemoryProfileComesBeforeSingleKeys) {
  const StateFolder folder;
  Write(folder / "a.yaml", "memory:\n  max_maps: 77\n  profile: small\n");
  const auto loaded = LoadDaemonConfig(folder / "a.yaml", {});
  ASSERT_TRUE(loaded.ok()) << loaded.status().ToString();
  const auto engine = LoadEngineConfig("", {"memory.profile=small"});
  EXPECT_EQ(loaded->config().engine.memory.max_keyframes, engine->config().memory.max_keyframes);
  EXPECT_EQ(loaded->config().engine.memory.max_maps, 77);
}

TEST(DaemonConfig, TypingErrorsAreRefusedWithTheirPlace) {
  RecordProperty("req", "DMN-001");
  const StateFolder folder;
  Write(folder / "a.yaml", "checkpoint:\n  intervall_s: 7\n");
  const auto loaded = LoadDaemonConfig(folder / "a.yaml", {});
  ASSERT_FALSE(loaded.ok());
  EXPECT_NE(loaded.status().message().find("a.yaml:2:"), std::string::npos) << loaded.status().message();
  EXPECT_NE(loaded.status().message().find("did you mean checkpoint.interval_s"), std::string::npos);
}

TEST(DaemonConfig, AsManyThreadsAsTheDeviceTakesAreInRange) {
  EXPECT_TRUE(LoadDaemonConfig("", {"vision.threads=64"}).ok());
  const auto refused = LoadDaemonConfig("", {"vision.threads=100"});
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.status().message().find("64"), std::string::npos) << refused.status().message();
}

TEST(DaemonConfig, DeviceMayBeChosenByTheMachine) {
  const auto chosen = LoadDaemonConfig("", {"vision.device=auto"});
  ASSERT_TRUE(chosen.ok()) << chosen.status().ToString();
  EXPECT_EQ(chosen->config().vision.device, "auto") << "by the worker: the supervisor has no device";
  EXPECT_EQ(LoadDaemonConfig("", {})->config().vision.device, "cpu");
  EXPECT_NE(LoadDaemonConfig("", {"vision.device=gpu"}).status().message().find("auto"), std::string::npos);
}

TEST(DaemonConfig, DepthIsPublishedOnlyWhereItIsSearched) {
  const auto refused = LoadDaemonConfig("", {"publish.depth=true"});
  ASSERT_EQ(refused.code(), StatusCode::kInvalidArgument);
  EXPECT_NE(refused.status().message().find("depth.enabled"), std::string::npos) << refused.status().message();
  EXPECT_TRUE(LoadDaemonConfig("", {"publish.depth=true", "depth.enabled=true"}).ok());
}

TEST(DaemonConfig, ReloadTakesLiveKeysAndNamesTheOthers) {
  RecordProperty("req", "DMN-003");
  DaemonConfig running;
  DaemonConfig loaded = running;
  loaded.checkpoint.interval_s = 5;
  loaded.source.path = "other";
  loaded.engine.noise.k = 3.0;
  const ConfigChange change = ApplyLive(running, loaded);
  EXPECT_EQ(change.config.checkpoint.interval_s, 5);
  EXPECT_EQ(change.config.source.path, "");
  EXPECT_EQ(change.config.engine.noise.k, running.engine.noise.k);
  EXPECT_EQ(change.applied, std::vector<std::string>({"checkpoint.interval_s"}));
  EXPECT_EQ(change.needs_restart, std::vector<std::string>({"noise.k", "source.path"}));
}

// --- Watchdog.

TEST(Health, ThreadThatIsSilentForTooLongHangs) {
  RecordProperty("req", "DMN-002");
  const WatchdogConfig limits;
  const TimePoint now{seconds(100)};
  SignsOfLife signs{now, now, now, now};
  EXPECT_EQ(FindHang(signs, now, limits), "");
  EXPECT_EQ(FindHang(signs, now + milliseconds(limits.tracking_limit_ms), limits), "");
  signs.capture = signs.mapping = signs.merging = now + seconds(2);
  EXPECT_EQ(FindHang(signs, now + seconds(2), limits), "tracking thread hangs for 2.0 s");
  signs = {now, now - seconds(4), now, now};
  EXPECT_EQ(FindHang(signs, now, limits), "capture thread hangs for 4.0 s");
  // A step of the mapper may take its time.
  signs = {now, now, now - seconds(20), now - seconds(20)};
  EXPECT_EQ(FindHang(signs, now, limits), "");
  signs.mapping = now - seconds(31);
  EXPECT_EQ(FindHang(signs, now, limits), "mapping thread hangs for 31.0 s");
  signs = {now, now, now, now - seconds(31)};
  EXPECT_EQ(FindHang(signs, now, limits), "merging thread hangs for 31.0 s");
}

// Between the start and its first beat memory is taken and locked.
TEST(Health, ThreadIsAtWorkUntilItHasBegun) {
  RecordProperty("req", "DMN-002");
  const WatchdogConfig limits;
  const TimePoint begin{seconds(100)};
  Heartbeat beat;
  beat.Beat(begin);
  const auto hang_at = [&](TimePoint now) {
    const TimePoint tracking = SignOfThread(beat, now, milliseconds(limits.work_limit_ms));
    return FindHang({tracking, now, now, now}, now, limits);
  };
  EXPECT_EQ(hang_at(begin + seconds(5)), "");
  EXPECT_NE(hang_at(begin + milliseconds(limits.work_limit_ms) + seconds(1)), "");
  beat.Beat(begin + seconds(6));
  EXPECT_EQ(hang_at(begin + seconds(6)), "");
  EXPECT_EQ(hang_at(begin + seconds(8)), "tracking thread hangs for 2.0 s");
}

// A camera that was unplugged is opened with many calls, and some drivers take seconds for one.
TEST(Health, CaptureIsAtWorkWhileADeviceIsBroughtBackButNotForEver) {
  RecordProperty("req", "DMN-002");
  const WatchdogConfig limits;
  const TimePoint answer{seconds(100)};
  const auto hang_at = [&](TimePoint now, std::optional<TimePoint> recovering_since) {
    const Duration work_limit = milliseconds(limits.work_limit_ms);
    return FindHang({now, SignOfCapture(answer, recovering_since, now, work_limit), now, now}, now, limits);
  };
  EXPECT_EQ(hang_at(answer + seconds(4), std::nullopt), "capture thread hangs for 4.0 s");
  EXPECT_EQ(hang_at(answer + seconds(4), answer), "");
  EXPECT_EQ(hang_at(answer + seconds(90), answer + seconds(80)), "");
  EXPECT_EQ(hang_at(answer + seconds(111), answer + seconds(80)), "capture thread hangs for 31.0 s");
}

// --- Log.

TEST(Log, RecordIsOneLineWhateverItHolds) {
  EXPECT_EQ(LogLine("ready", {{"state", "idle"}}), "ready state=idle");
  EXPECT_EQ(LogLine("x", {{"a", ""}, {"b", "two words"}, {"c", "say \"no\"\nand\x1b[2J"}}),
            "x a=\"\" b=\"two words\" c=\"say \\\"no\\\"\\nand?[2J\"");
}

// --- Files.

TEST(ProcedureRecord, IsReadAsItWasWrittenAndNothingElseIs) {
  const ProcedureRecord record{"case-1", "a-b-c", Duration(123456789), RecordedState::kStopped};
  const std::string text = ToText(record);
  const Result<ProcedureRecord> read = ParseProcedureRecord(text);
  ASSERT_TRUE(read.ok()) << read.status().ToString();
  EXPECT_EQ(read->label, "case-1");
  EXPECT_EQ(read->boot_id, "a-b-c");
  EXPECT_EQ(read->written_at, record.written_at);
  EXPECT_EQ(read->state, record.state);
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_FALSE(ParseProcedureRecord(text.substr(0, size)).ok()) << size;
  }
  EXPECT_FALSE(ParseProcedureRecord(text + "more").ok());
  EXPECT_FALSE(ParseProcedureRecord("haustra procedure 2\nlabel ../x\nboot b\nwritten_at_ns 1\n").ok());
  EXPECT_FALSE(ParseProcedureRecord("haustra procedure 2\nlabel x\nboot b\nwritten_at_ns -1\n").ok());
  EXPECT_FALSE(ParseProcedureRecord("haustra procedure 2\nlabel x\nboot b\nwritten_at_ns 1e9\n").ok());
}

std::unique_ptr<ProcedureStore> OpenStore(const StateFolder& folder) {
  auto store = ProcedureStore::Open(folder.path());
  EXPECT_TRUE(store.ok()) << store.status().ToString();
  return store.ok() ? std::move(*store) : nullptr;
}

TEST(ProcedureStore, OpenProcedureIsFoundByTheNextDaemonAndAnEndedOneIsNot) {
  RecordProperty("req", "DMN-005");
  const StateFolder folder;
  {
    const auto store = OpenStore(folder);
    EXPECT_FALSE(store->interrupted());
    EXPECT_TRUE(store->WriteOpen("case-1", RecordedState::kRunning).ok());
    Write(store->checkpoint_path(), "maps");
  }
  {
    const auto store = OpenStore(folder);
    ASSERT_TRUE(store->interrupted());
    EXPECT_EQ(store->interrupted()->label, "case-1");
    EXPECT_TRUE(store->has_checkpoint());
    EXPECT_TRUE(store->MayResume(seconds(600)));
    EXPECT_TRUE(store->Close().ok());
    EXPECT_FALSE(store->has_checkpoint());
  }
  EXPECT_FALSE(OpenStore(folder)->interrupted());
}

TEST(ProcedureStore, OnlyAYoungProcedureOfThisBootMayGoOnByItself) {
  RecordProperty("req", "DATA-003");
  const StateFolder folder;
  ASSERT_TRUE(OpenStore(folder)->WriteOpen("case-1", RecordedState::kRunning).ok());
  EXPECT_FALSE(OpenStore(folder)->MayResume(Duration(0)));
  ProcedureRecord record = *OpenStore(folder)->interrupted();
  // This machine may have been started a minute ago: there is no time before that.
  record.written_at -= seconds(20);
  Write(folder / "procedure", ToText(record));
  EXPECT_FALSE(OpenStore(folder)->MayResume(seconds(15)));
  EXPECT_TRUE(OpenStore(folder)->MayResume(seconds(800)));
  record.state = RecordedState::kStopped;
  Write(folder / "procedure", ToText(record));
  EXPECT_FALSE(OpenStore(folder)->MayResume(seconds(800)));
  record.state = RecordedState::kRunning;
  record.boot_id = "another";
  Write(folder / "procedure", ToText(record));
  EXPECT_FALSE(OpenStore(folder)->MayResume(seconds(800)));
  // What cannot be read is an open procedure that nobody goes on with unasked.
  Write(folder / "procedure", "rubbish");
  ASSERT_TRUE(OpenStore(folder)->interrupted());
  EXPECT_FALSE(OpenStore(folder)->MayResume(seconds(800)));
}

TEST(ProcedureStore, StopIsRecordedInPlace) {
  RecordProperty("req", "DATA-003");
  const StateFolder folder;
  const auto store = OpenStore(folder);
  ASSERT_TRUE(store->WriteOpen("case-1", RecordedState::kRunning).ok());
  const Result<ProcedureRecord> before = ParseProcedureRecord(Read(folder / "procedure"));
  ASSERT_TRUE(before.ok());
  // The same file, with the same bytes but for the word: a full disk has room for that.
  fs::create_hard_link(folder / "procedure", folder / "link");
  ASSERT_TRUE(store->MarkStopped("case-1").ok());
  ProcedureRecord wanted = *before;
  wanted.state = RecordedState::kStopped;
  EXPECT_EQ(Read(folder / "link"), ToText(wanted));
  EXPECT_EQ(Read(folder / "procedure"), ToText(wanted));
  ASSERT_TRUE(store->MarkStopped("case-1").ok()) << "again";
  EXPECT_EQ(Read(folder / "link"), ToText(wanted));
  // There is none, or none that can be read: then it needs room.
  for (const std::string text : {"", "rubbish"}) {
    fs::remove(folder / "procedure");
    if (!text.empty()) Write(folder / "procedure", text);
    ASSERT_TRUE(store->MarkStopped("case-2").ok());
    const Result<ProcedureRecord> record = ParseProcedureRecord(Read(folder / "procedure"));
    ASSERT_TRUE(record.ok()) << text;
    EXPECT_EQ(record->label, "case-2");
    EXPECT_EQ(record->state, RecordedState::kStopped);
  }
}

// What a crash leaves while `path` is written; its name.
std::string LeaveHalfWritten(const std::string& path) {
  std::string left;
  {
    Result<FileSink> sink = FileSink::Create(path);
    EXPECT_TRUE(sink.ok()) << sink.status().ToString();
    for (const auto& entry : fs::directory_iterator(fs::path(path).parent_path())) {
      if (entry.path().string().starts_with(path + ".partial-")) left = entry.path().string();
    }
  }
  EXPECT_FALSE(left.empty()) << path;
  Write(left, "half");
  return left;
}

TEST(ProcedureStore, LeftoversOfACrashAreRemoved) {
  RecordProperty("req", "DMN-006");
  const StateFolder folder;
  OpenStore(folder);
  const std::vector<std::string> leftovers = {LeaveHalfWritten(folder / "checkpoint.atlas"),
                                              LeaveHalfWritten(folder / "procedure"),
                                              LeaveHalfWritten(folder / "saved/a.atlas")};
  Write(folder / "saved/b.atlas", "whole");
  // Labels may look like such a name.
  const std::vector<std::string> lookalikes = {"x.partial-1", "x.partial-1-2", "x.atlas.partial-1-2"};
  for (const std::string& name : lookalikes) {
    Write(folder / ("saved/" + name + ".atlas"), "whole");
  }
  Write(folder / "checkpoint.atlas", "of nobody");
  const auto store = OpenStore(folder);
  for (const std::string& path : leftovers) EXPECT_FALSE(fs::exists(path)) << path;
  for (const std::string& name : lookalikes) {
    EXPECT_TRUE(store->has_saved(name)) << name;
  }
  EXPECT_FALSE(store->has_checkpoint());
  EXPECT_TRUE(store->has_saved("b"));
}

TEST(ProcedureStore, CheckpointIsKeptUnderANameThatIsFree) {
  RecordProperty("req", "DMN-005");
  for (const bool is_plain : {false, true}) {
    const StateFolder folder;
    const auto store = OpenStore(folder);
    Write(folder / "saved/case-1.atlas", "saved before");
    fs::create_symlink("nowhere", folder / "saved/case-1-2.atlas");
    Write(store->checkpoint_path(), "maps");
    std::optional<PlainFileSystem> plain;
    if (is_plain) plain.emplace();
    const Result<std::string> name = store->KeepCheckpoint("case-1");
    ASSERT_TRUE(name.ok()) << name.status().ToString();
    EXPECT_EQ(*name, "case-1-3");
    EXPECT_EQ(Read(folder / "saved/case-1.atlas"), "saved before");
    EXPECT_TRUE(fs::is_symlink(folder / "saved/case-1-2.atlas"));
    EXPECT_EQ(Read(folder / "saved/case-1-3.atlas"), "maps");
    EXPECT_FALSE(store->has_checkpoint());
  }
}

// Before every call that gives or takes a name: the maps are in one of the two places, and half a file is in none.
TEST(ProcedureStore, CrashWhileACheckpointIsKeptLosesNoMaps) {
  RecordProperty("req", "DMN-005");
  for (int step = 1, ends = 1; ends != 0; ++step) {
    SCOPED_TRACE(step);
    const StateFolder folder;
    const auto store = OpenStore(folder);
    Write(store->checkpoint_path(), "maps");
    ends = PlainFileSystem::EndsBeforeStep(step, [&] { (void)store->KeepCheckpoint("case-1"); });
    EXPECT_NE(store->has_checkpoint(), store->has_saved("case-1"));
    EXPECT_EQ(Read(store->has_saved("case-1") ? folder / "saved/case-1.atlas" : store->checkpoint_path()), "maps");
  }
}

TEST(ProcedureStore, RecordThatCannotBeOpenedIsOneOfAnOpenProcedure) {
  RecordProperty("req", "DMN-005,DATA-003");
  for (const bool is_link : {true, false}) {
    const StateFolder folder;
    Write(folder / "checkpoint.atlas", "maps");
    if (is_link) {
      // It leads to itself: nobody can open it, not even the superuser.
      fs::create_symlink("procedure", folder / "procedure");
    } else {
      fs::create_directory(folder / "procedure");
    }
    const auto store = OpenStore(folder);
    ASSERT_NE(store, nullptr);
    ASSERT_TRUE(store->interrupted()) << is_link;
    EXPECT_EQ(store->interrupted()->label, "");
    EXPECT_FALSE(store->MayResume(seconds(800)));
    EXPECT_EQ(Read(store->checkpoint_path()), "maps");
  }
}

// A folder that is there and cannot be looked into: as one of a disk that fails, or of other rights.
TEST(ProcedureStore, WhatCannotBeLookedAtIsNotSaidToBeWiped) {
  RecordProperty("req", "DATA-001");
  const StateFolder folder;
  const auto store = OpenStore(folder);
  ASSERT_TRUE(store->WriteOpen("case-1", RecordedState::kRunning).ok());
  Write(store->checkpoint_path(), "maps");
  const std::string aside = folder.path() + "-aside";
  fs::rename(folder.path(), aside);
  fs::create_symlink(folder.path(), folder.path());
  const Status closed = store->Close();
  EXPECT_EQ(closed.code(), StatusCode::kUnavailable);
  EXPECT_NE(closed.message().find(folder.path()), std::string::npos) << closed.message();
  fs::remove(folder.path());
  fs::rename(aside, folder.path());
  EXPECT_TRUE(store->Close().ok());
  EXPECT_FALSE(fs::exists(store->checkpoint_path()));
  EXPECT_FALSE(fs::exists(folder / "procedure"));
}

// Somebody has taken the saved maps away, with their folder: there is nothing to look at.
TEST(ProcedureStore, WithoutTheFolderOfSavedMapsAProcedureEndsAllTheSame) {
  RecordProperty("req", "DATA-001");
  const StateFolder folder;
  const auto store = OpenStore(folder);
  ASSERT_TRUE(store->WriteOpen("case-1", RecordedState::kRunning).ok());
  fs::remove_all(folder / "saved");
  const Status closed = store->Close();
  EXPECT_TRUE(closed.ok()) << closed.message();
  EXPECT_FALSE(fs::exists(folder / "procedure"));
}

TEST(ProcedureStore, OneDaemonAFolder) {
  const StateFolder folder;
  const auto store = OpenStore(folder);
  EXPECT_EQ(ProcedureStore::Open(folder.path()).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(ProcedureStore::Open(folder / "none").code(), StatusCode::kNotFound);
}

TEST(WipeFile, BytesAreOverwrittenBeforeTheNameGoes) {
  RecordProperty("req", "DATA-001");
  const StateFolder folder;
  const std::string secret(100000, 's');
  Write(folder / "a", secret);
  fs::create_hard_link(folder / "a", folder / "b");
  ASSERT_TRUE(WipeFile(folder / "a").ok());
  EXPECT_FALSE(fs::exists(folder / "a"));
  EXPECT_EQ(Read(folder / "b"), std::string(secret.size(), '\0'));
  EXPECT_EQ(WipeFile(folder / "none").code(), StatusCode::kUnavailable);
}

TEST(FileWorker, JobsAreDoneInOrderAndBeforeItEnds) {
  std::vector<int> done;
  {
    FileWorker worker;
    for (int i = 0; i < 100; ++i) worker.Do([&done, i] { done.push_back(i); });
    worker.Finish();
    EXPECT_EQ(done.size(), 100u);
    for (int i = 100; i < 200; ++i) worker.Do([&done, i] { done.push_back(i); });
  }
  ASSERT_EQ(done.size(), 200u);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(done[i], i);
}

// --- The source.

CameraCalibration SmallCamera() {
  CameraCalibration camera;
  camera.width_px = 64;
  camera.height_px = 48;
  camera.rate_hz = 25;
  return camera;
}

TEST(SupervisedSource, LostCameraIsAskedAgainUntilItIsBack) {
  RecordProperty("req", "DMN-007");
  const SystemClock clock;
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->SetEndless(true);
  // A camera's own clock is the system's.
  const TimePoint later = clock.Now() + seconds(10);
  inner->AddFrame(later);
  inner->AddFailure(StatusCode::kUnavailable, "unplugged");
  inner->AddFailure(StatusCode::kUnavailable, "unplugged");
  inner->AddFailure(StatusCode::kDataLoss, "torn");
  inner->AddFrame(later + milliseconds(160));
  SupervisedSource source(std::move(inner), clock);
  EXPECT_EQ(source.signal(), SignalState::kWaiting);
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(source.signal(), SignalState::kFrames);
  EXPECT_EQ(source.Next(kNoDeadline).code(), StatusCode::kDataLoss);
  EXPECT_EQ(source.signal(), SignalState::kNone);
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(source.signal(), SignalState::kFrames);
}

TEST(SupervisedSource, PicturesThatAreAllDamagedAreNoSignal) {
  RecordProperty("req", "DMN-007");
  ManualClock clock(TimePoint(seconds(10)));
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->AddFrame(TimePoint{});
  for (int i = 0; i < 3; ++i) inner->AddFailure(StatusCode::kDataLoss, "torn");
  inner->AddFrame(TimePoint(milliseconds(160)));
  SupervisedSource source(std::move(inner), clock);
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  for (const SignalState expected : {SignalState::kFrames, SignalState::kFrames, SignalState::kNone}) {
    clock.Advance(milliseconds(200));
    EXPECT_EQ(source.Next(kNoDeadline).code(), StatusCode::kDataLoss);
    EXPECT_EQ(source.signal(), expected);
  }
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(source.signal(), SignalState::kFrames);
}

TEST(SupervisedSource, FramesFromBeforeTheProcedureAreThrownAway) {
  RecordProperty("req", "DATA-002");
  const SystemClock clock;
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->SetEndless(true);
  inner->AddFrame(clock.Now() - seconds(60));
  inner->AddFrame(clock.Now() - seconds(59));
  inner->AddFrame(clock.Now() + seconds(60));
  SupervisedSource source(std::move(inner), clock);
  source.Begin();
  const Result<Frame> frame = source.Next(kNoDeadline);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(frame->index, 2u);
}

// What a witness takes its time for must not make a frame late.
TEST(SupervisedSource, WitnessSeesAFrameWhenItHasBeenHandedOver) {
  ManualClock clock(TimePoint(seconds(10)));
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->AddFrames(2, TimePoint{}, milliseconds(40));
  SupervisedSource source(std::move(inner), clock);
  std::vector<std::uint32_t> seen;
  source.SetWitness([&](const Frame& frame) {
    EXPECT_EQ(ReadFrameTag(frame.image), frame.index) << "it is the picture of this frame";
    seen.push_back(frame.index);
    clock.Advance(milliseconds(20));
  });
  const TimePoint begin = clock.Now();
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(clock.Now(), begin);
  EXPECT_EQ(seen, std::vector<std::uint32_t>{});
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(seen, std::vector<std::uint32_t>{0});
  source.RequestStop();
  EXPECT_EQ(source.Next(kNoDeadline).code(), StatusCode::kNotFound);
  EXPECT_EQ(seen, (std::vector<std::uint32_t>{0, 1}));
}

// Until the first answer the capture thread may not have begun.
TEST(SupervisedSource, BeginIsTheFirstBeatOfItsAnswers) {
  RecordProperty("req", "DMN-002");
  ManualClock clock(TimePoint(seconds(10)));
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->AddFrame(TimePoint{});
  SupervisedSource source(std::move(inner), clock);
  clock.Advance(seconds(2));
  source.Begin();
  EXPECT_EQ(source.answers().count(), 1u);
  EXPECT_EQ(source.answers().last(), TimePoint(seconds(12)));
  clock.Advance(seconds(2));
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(source.answers().count(), 2u);
  EXPECT_EQ(source.answers().last(), TimePoint(seconds(14)));
}

TEST(SupervisedSource, RecordingThatIsOverWaitsForTheStopAndShowsThatItLives) {
  const SystemClock clock;
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->AddFrame(TimePoint(milliseconds(40)));
  SupervisedSource source(std::move(inner), clock);
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  std::atomic<int> code{-1};
  std::thread reader([&] { code = static_cast<int>(source.Next(kNoDeadline).code()); });
  while (source.signal() != SignalState::kOver) std::this_thread::sleep_for(milliseconds(1));
  const TimePoint seen = clock.Now();
  while (source.answers().last() <= seen) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_EQ(code, -1);
  source.RequestStop();
  reader.join();
  EXPECT_EQ(code, static_cast<int>(StatusCode::kNotFound));
}

TEST(SupervisedSource, TimesThatJumpAreToldOfAndCounted) {
  const SystemClock clock;
  auto inner = std::make_unique<ScriptedFrameSource>(SmallCamera());
  inner->AddFrames(2, TimePoint(seconds(1)), milliseconds(40));
  inner->AddFrame(TimePoint(milliseconds(1080)), TimePoint(seconds(3600)));
  inner->AddFrame(TimePoint(milliseconds(1120)), TimePoint(seconds(-7)));
  inner->AddFrame(TimePoint(seconds(30)));
  SupervisedSource source(std::move(inner), clock);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(source.Next(kNoDeadline).ok());
  EXPECT_EQ(source.TakeTimeJump(), std::nullopt);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(source.Next(kNoDeadline).ok());
  const std::optional<TimeJump> jump = source.TakeTimeJump();
  ASSERT_TRUE(jump);
  EXPECT_EQ(jump->before, TimePoint(milliseconds(1040)));
  EXPECT_EQ(jump->stated, TimePoint(seconds(3600)));
  EXPECT_EQ(jump->taken, TimePoint(milliseconds(1080)));
  EXPECT_EQ(jump->num_more, 1u);
  EXPECT_EQ(source.TakeTimeJump(), std::nullopt);
  // A recording that pauses.
  EXPECT_TRUE(source.Next(kNoDeadline).ok());
  const std::optional<TimeJump> pause = source.TakeTimeJump();
  ASSERT_TRUE(pause);
  EXPECT_EQ(pause->before, TimePoint(milliseconds(1120)));
  EXPECT_EQ(pause->stated, TimePoint(seconds(30)));
  EXPECT_EQ(pause->taken, TimePoint(seconds(30)));
}

// --- What the control socket answers.

TEST(MetricsText, HistogramIsCumulativeAndEverySampleHasAType) {
  RecordProperty("req", "DMN-008");
  ProcedureCounts counts;
  counts.latency_buckets = {1, 2, 3, 0, 0, 0, 0, 0, 0, 4};
  counts.frames = {5, 6, 7};
  const std::string text = ToMetricsText({}, counts);
  EXPECT_NE(text.find("haustra_tracking_latency_seconds_bucket{le=\"0.02\"} 6\n"), std::string::npos) << text;
  EXPECT_NE(text.find("haustra_tracking_latency_seconds_bucket{le=\"+Inf\"} 10\n"), std::string::npos);
  EXPECT_NE(text.find("haustra_tracking_latency_seconds_count 10\n"), std::string::npos);
  EXPECT_NE(text.find("haustra_frames_total{state=\"lost\"} 7\n"), std::string::npos);
  std::string family;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# TYPE ")) family = line.substr(7, line.find(' ', 7) - 7);
    if (!line.starts_with("#")) {
      EXPECT_TRUE(line.starts_with(family)) << line;
    }
  }
}

TEST(MetricsText, SayWhatDepthDoes) {
  RecordProperty("req", "DMN-008");
  ProcedureCounts counts;
  counts.depths_found = 30;
  counts.depths_late = 4;
  counts.depths_too_little = 2;
  counts.depths_in_vain = 1;
  counts.keyframes_with_depth = 25;
  ServiceMetrics metrics;
  metrics.searches_depth = true;
  const std::string text = ToMetricsText(metrics, counts);
  for (const char* line :
       {"haustra_depth_enabled 1\n", "haustra_keyframes_with_depth 25\n", "haustra_depths_total{result=\"found\"} 30\n",
        "haustra_depths_total{result=\"late\"} 4\n", "haustra_depths_total{result=\"too_little_seen\"} 2\n",
        "haustra_depths_total{result=\"in_vain\"} 1\n"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line << text;
  }
  EXPECT_NE(ToMetricsText({}, {}).find("haustra_depth_enabled 0\n"), std::string::npos);
}

TEST(StatusText, SaysWhatDepthDoes) {
  RecordProperty("req", "DMN-008");
  ServiceStatus status;
  status.is_open = true;
  ProcedureCounts counts;
  EXPECT_NE(ToStatusText(status, counts).find("\ndepth off\n"), std::string::npos);
  EXPECT_EQ(ToStatusText(status, counts).find("depths_late"), std::string::npos);
  status.searches_depth = true;
  counts.keyframes_with_depth = 25;
  counts.depths_late = 4;
  const std::string text = ToStatusText(status, counts);
  EXPECT_NE(text.find("\ndepth on\nkeyframes_with_depth 25\ndepths_late 4\n"), std::string::npos) << text;
}

TEST(ProcedureCounts, DepthsOfSeveralWorkersAreAddedAndThoseOfAKeyframeAreTheLast) {
  ProcedureCounts earlier, later;
  earlier.depths_found = 5;
  earlier.depths_late = 2;
  earlier.keyframes_with_depth = 5;
  later.depths_found = 3;
  later.keyframes_with_depth = 2;
  const ProcedureCounts sum = Sum(WithoutProcedure(earlier), later);
  EXPECT_EQ(sum.depths_found, 8u);
  EXPECT_EQ(sum.depths_late, 2u);
  EXPECT_EQ(sum.keyframes_with_depth, 2u);
  EXPECT_EQ(WithoutProcedure(earlier).keyframes_with_depth, 0u);
}

TEST(StatusText, MessagesStayOnTheirLine) {
  ServiceStatus status;
  status.trouble = "first\nstate running";
  EXPECT_NE(ToStatusText(status, {}).find("trouble first;state running\n"), std::string::npos);
}

}  // namespace
}  // namespace haustra
