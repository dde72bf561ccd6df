// haustrad as its tower and its service manager meet it: a process, a socket, shared memory, signals.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "capture/codec/image_codec.h"
#include "platform/publish/haustra_pose_ring.h"
#include "tests/end_to_end/memory_search.h"
#include "tests/end_to_end/result_files.h"
#include "tests/end_to_end/service_process.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;

class Daemon : public testing::Test {
 protected:
  Daemon() : folder_(ScratchFolder()), service_(folder_) {}

  std::vector<std::string> Arguments(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"--source", SequenceFolder("standard"), "--set",
                                          std::string("source.rate=") + HAUSTRA_END_TO_END_RATE};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  void StartReady(const std::vector<std::string>& more = {}, const std::vector<std::string>& prefix = {}) {
    service_.Start(Arguments(more), prefix);
    ASSERT_TRUE(service_.WaitForMessage("READY=1")) << service_.Wait().ToString();
  }
  // A procedure that has a map.
  void BeginAndMap(const std::string& label) {
    ASSERT_TRUE(service_.Ask("begin " + label).starts_with("procedure ")) << label;
    ASSERT_TRUE(service_.WaitForStatus("tracking tracking"));
    ASSERT_TRUE(service_.WaitForStatus("maps 1"));
  }
  int StopAndWait() {
    service_.command().Signal(SIGTERM);
    const CommandResult result = service_.Wait();
    EXPECT_EQ(result.signal, 0) << result.ToString();
    return result.exit_code;
  }
  // In the supervisor and in the worker that stands ready.
  std::vector<PartFound> FindInService(const std::set<std::string>& parts) {
    std::vector<PartFound> found = FindInMemory(service_.pid(), parts);
    const std::vector<PartFound> in_worker = FindInMemory(service_.worker_pid(), parts);
    found.insert(found.end(), in_worker.begin(), in_worker.end());
    return found;
  }
  std::string StatePath(const std::string& name) const { return service_.state_folder() + "/" + name; }

  std::string folder_;
  ServiceProcess service_;
};

TEST_F(Daemon, StartsReadyTracksWhenToldAndStopsWithItsMapsSaved) {
  RecordProperty("req", "DMN-001,DMN-004");
  ASSERT_NO_FATAL_FAILURE(StartReady());
  EXPECT_TRUE(service_.HasSaid("STATUS=idle: no procedure"));
  EXPECT_EQ(service_.StatusValue("state"), "idle");
  EXPECT_TRUE(service_.Ask("end").starts_with("error: no procedure"));
  EXPECT_TRUE(service_.Ask("resume").starts_with("error: no procedure was interrupted"));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  EXPECT_TRUE(service_.Ask("begin").starts_with("error: a procedure is open"));
  EXPECT_EQ(service_.Ask("save one"), "saved " + StatePath("saved/one.atlas") + "\n");
  EXPECT_TRUE(service_.Ask("save one").starts_with("error: there is a save of that name"));
  EXPECT_TRUE(service_.WaitForMessage("WATCHDOG=1"));

  // The C client sees what the daemon sees.
  const CommandResult client =
      Command({HAUSTRA_POSE_CLIENT, service_.runtime_folder() + "/poses", "20"}).Wait(kHangLimit);
  EXPECT_EQ(client.exit_code, 0) << client.ToString();
  EXPECT_NE(client.out.find("event map_created map 0"), std::string::npos) << client.out;
  EXPECT_NE(client.out.find("pose 20 frame"), std::string::npos) << client.out;
  const CommandResult watch = Haustra({"watch", "--once", "--folder", service_.runtime_folder()});
  EXPECT_EQ(watch.exit_code, 0) << watch.ToString();
  EXPECT_NE(watch.out.find("label case-1"), std::string::npos) << watch.out;
  const CommandResult control = Haustra({"control", "metrics", "--folder", service_.runtime_folder()});
  EXPECT_EQ(control.exit_code, 0) << control.ToString();
  EXPECT_NE(control.out.find("haustra_procedure_open 1"), std::string::npos) << control.out;
  EXPECT_EQ(Haustra({"control", "begin", "x", "--folder", service_.runtime_folder()}).exit_code, 1);
  EXPECT_EQ(Haustra({"control", "dance", "--folder", service_.runtime_folder()}).exit_code, 64);

  EXPECT_EQ(StopAndWait(), 0);
  EXPECT_TRUE(service_.WaitForMessage("STOPPING=1"));
  EXPECT_TRUE(Exists(StatePath("checkpoint.atlas")));
  EXPECT_FALSE(Exists(service_.runtime_folder() + "/poses"));
  EXPECT_FALSE(Exists(service_.runtime_folder() + "/control"));
  EXPECT_FALSE(Exists(service_.runtime_folder() + "/status"));
  EXPECT_EQ(Haustra({"control", "status", "--folder", service_.runtime_folder()}).exit_code, 69);
  const CommandResult info = Haustra({"atlas", "info", StatePath("checkpoint.atlas")});
  EXPECT_EQ(info.exit_code, 0) << info.ToString();
}

// Marks by the control socket: set in a frame that was published, seen with the poses, saved with the maps, and gone
// with the procedure.
TEST_F(Daemon, MarksAreSetListedPublishedAndWiped) {
  ASSERT_NO_FATAL_FAILURE(StartReady());
  EXPECT_TRUE(service_.Ask("marks").starts_with("error: no procedure"));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  EXPECT_EQ(service_.Ask("marks"), "no marks\n");
  // Some place of the picture shows enough of the map.
  std::string answer;
  for (int attempt = 0; attempt < 200 && !answer.starts_with("marked"); ++attempt) {
    answer = service_.Ask("mark " + std::to_string(60 + 25 * (attempt % 10)) + " " +
                          std::to_string(60 + 35 * (attempt / 10 % 5)) + " polyp");
  }
  EXPECT_EQ(answer, "marked polyp\n");
  EXPECT_TRUE(service_.Ask("mark 200 200 polyp").starts_with("error: there is a mark 'polyp' already"));
  EXPECT_TRUE(service_.Ask("mark -5 200 other").starts_with("error: the pixel lies outside"));
  EXPECT_TRUE(service_.Ask("marks").starts_with("polyp session 0 frame "));

  haustra_ring ring;
  ASSERT_EQ(haustra_ring_open(&ring, (service_.runtime_folder() + "/poses").c_str()), HAUSTRA_OK);
  haustra_pose pose{};
  bool is_published = false;
  for (int attempt = 0; attempt < 500 && !is_published; ++attempt) {
    is_published = haustra_ring_latest_pose(&ring, &pose) == HAUSTRA_OK && pose.num_marks == 1;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(is_published);
  EXPECT_GT(pose.marks[0].distance_in_depths, 0.0f);
  EXPECT_EQ(service_.Ask("save one"), "saved " + StatePath("saved/one.atlas") + "\n");
  EXPECT_NE(ReadBytes(StatePath("saved/one.atlas")).find("polyp"), std::string::npos);
  EXPECT_EQ(service_.Ask("unmark polyp"), "removed polyp\n");
  EXPECT_TRUE(service_.Ask("unmark polyp").starts_with("error: there is no mark 'polyp'"));
  EXPECT_TRUE(service_.Ask("end wipe").starts_with("wiped"));
  EXPECT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_NOT_YET);
  haustra_ring_close(&ring);
  EXPECT_EQ(StopAndWait(), 0);
}

// The tracking thread alone is held, by a debugger's means: nothing in the product takes part.
TEST_F(Daemon, WorkerWhoseTrackingHangsIsReplacedAndTheServiceLives) {
  RecordProperty("req", "DMN-002,DMN-010");
  ASSERT_NO_FATAL_FAILURE(StartReady());
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  const pid_t worker = service_.worker_pid();
  const std::string procedure = service_.StatusValue("procedure");
  pid_t tracking = 0;
  for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(worker) + "/task")) {
    if (ReadBytes(entry.path().string() + "/comm") == "tracking\n") tracking = std::stoi(entry.path().filename());
  }
  ASSERT_NE(tracking, 0);
  if (ptrace(PTRACE_SEIZE, tracking, nullptr, nullptr) != 0) GTEST_SKIP() << "this machine lets nobody trace";
  ASSERT_EQ(ptrace(PTRACE_INTERRUPT, tracking, nullptr, nullptr), 0);
  EXPECT_EQ(waitpid(tracking, nullptr, __WALL), tracking);
  ASSERT_TRUE(service_.WaitForStatus("last_fault tracking thread hangs"));
  // A thread that is traced stays until its tracer has heard of its end.
  EXPECT_EQ(waitpid(tracking, nullptr, __WALL), tracking);
  service_.ForgetMessages();
  EXPECT_TRUE(service_.WaitForMessage("WATCHDOG=1"));
  // The next of this run of the service.
  ASSERT_TRUE(service_.WaitForStatus("procedure " + std::to_string(std::stoull(procedure) + 1)));
  ASSERT_TRUE(service_.WaitForStatus("tracking tracking"));
  EXPECT_EQ(service_.StatusValue("label"), "case-1");
  EXPECT_NE(service_.worker_pid(), worker);
  EXPECT_EQ(StopAndWait(), 0);
}

// Value of a line of /proc/PID/status.
std::string ProcessValue(pid_t pid, const std::string& key) {
  const std::string text = "\n" + ReadBytes("/proc/" + std::to_string(pid) + "/status");
  const std::size_t at = text.find("\n" + key + ":\t");
  if (at == std::string::npos) return "";
  const std::size_t begin = at + key.size() + 3;
  return text.substr(begin, text.find('\n', begin) - begin);
}

TEST_F(Daemon, SupervisorHasFewerRightsThanItsWorker) {
  RecordProperty("req", "DMN-011");
  ASSERT_NO_FATAL_FAILURE(StartReady());
  const pid_t worker = service_.worker_pid();
  EXPECT_EQ(ProcessValue(worker, "PPid"), std::to_string(service_.pid())) << "which reaps it";
  EXPECT_EQ(ProcessValue(service_.pid(), "Seccomp"), "2");
  EXPECT_EQ(ProcessValue(worker, "Seccomp"), ProcessValue(getpid(), "Seccomp")) << "what this test has";
  service_.command().Signal(SIGTERM);
  const CommandResult result = service_.Wait();
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.err.find("own_rights system_calls=taken"), std::string::npos) << result.err;
}

TEST_F(Daemon, WorkerEndsWithAServiceThatIsKilled) {
  RecordProperty("req", "DMN-006");
  ASSERT_NO_FATAL_FAILURE(StartReady());
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  const pid_t worker = service_.worker_pid();
  ASSERT_EQ(kill(worker, 0), 0);
  service_.command().Signal(SIGKILL);
  EXPECT_EQ(service_.Wait().signal, SIGKILL);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (kill(worker, 0) == 0 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_NE(kill(worker, 0), 0);
}

TEST_F(Daemon, RecordingThatIsOverIsNoHang) {
  RecordProperty("req", "DMN-007");
  const std::string sequence = folder_ + "/short";
  CopySequence(SequenceFolder("standard"), sequence, 10);
  service_.Start({"--source", sequence, "--set", "procedure.begin_at_start=true"});
  ASSERT_TRUE(service_.WaitForStatus("service source_over"));
  service_.ForgetMessages();
  EXPECT_TRUE(service_.WaitForMessage("WATCHDOG=1"));
  EXPECT_EQ(service_.StatusValue("worker_faults"), "");
  EXPECT_EQ(StopAndWait(), 0);
}

TEST_F(Daemon, ReloadTakesWhatMayChangeAndKeepsTheRest) {
  RecordProperty("req", "DMN-003");
  const std::string config = folder_ + "/haustra.yaml";
  WriteBytes(config, "checkpoint:\n  interval_s: 600\n");
  ASSERT_NO_FATAL_FAILURE(StartReady({"--config", config}));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  EXPECT_EQ(service_.StatusValue("checkpoints"), "0");

  service_.ForgetMessages();
  WriteBytes(config, "checkpoint:\n  interval_s: nonsense\n");
  service_.command().Signal(SIGHUP);
  ASSERT_TRUE(service_.WaitForMessage("RELOADING=1"));
  ASSERT_TRUE(service_.WaitForMessage("READY=1"));
  EXPECT_EQ(service_.StatusValue("state"), "running");

  service_.ForgetMessages();
  WriteBytes(config, "checkpoint:\n  interval_s: 1\nnoise:\n  k: 3\n");
  service_.command().Signal(SIGHUP);
  ASSERT_TRUE(service_.WaitForMessage("READY=1"));
  EXPECT_EQ(service_.StatusValue("needs_restart"), "noise.k");
  EXPECT_TRUE(service_.WaitForStatus("checkpoint_age_s"));
  service_.command().Signal(SIGTERM);
  const CommandResult result = service_.Wait();
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.err.find("reload_refused"), std::string::npos);
  EXPECT_NE(result.err.find("haustra.yaml:2:"), std::string::npos) << result.err;
}

TEST_F(Daemon, KillLosesNoMoreThanWhatCameAfterTheLastCheckpoint) {
  RecordProperty("req", "DMN-005");
  ASSERT_NO_FATAL_FAILURE(StartReady({"--set", "checkpoint.interval_s=1"}));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  ASSERT_TRUE(service_.WaitForStatus("checkpoint_age_s"));
  service_.command().Signal(SIGKILL);
  EXPECT_EQ(service_.Wait().signal, SIGKILL);
  EXPECT_TRUE(Exists(service_.runtime_folder() + "/control"));  // as a crash leaves it

  ASSERT_NO_FATAL_FAILURE(StartReady());
  EXPECT_EQ(service_.StatusValue("state"), "running");
  EXPECT_EQ(service_.StatusValue("label"), "case-1");
  // The scope finds itself in the map from before.
  EXPECT_TRUE(service_.WaitForStatus("tracking tracking"));
  EXPECT_NE(service_.Ask("metrics").find("haustra_map_events_total{kind=\"frame_found\"} 1"), std::string::npos);
  EXPECT_EQ(service_.Ask("end wipe"), "wiped\n");
  EXPECT_EQ(StopAndWait(), 0);
}

// At other moments each time: while frames are mapped, while a checkpoint is written, while somebody saves.
TEST_F(Daemon, KillAtAnyMomentLeavesWholeMapsAndAProcedureThatGoesOn) {
  RecordProperty("req", "DMN-005,DMN-006");
  const std::vector<std::string> settings = {
      "--set", "checkpoint.interval_s=1",     "--set", "vision.threads=1",
      "--set", "memory.max_map_points=20000", "--set", "memory.max_keyframes=100"};
  ASSERT_NO_FATAL_FAILURE(StartReady(settings));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  ASSERT_TRUE(service_.WaitForStatus("checkpoint_age_s"));
  int num_saved = 0;
  for (int i = 0; i < 8; ++i) {
    std::thread saver(
        [&, name = "save save-" + std::to_string(i)] { num_saved += service_.Ask(name).starts_with("saved "); });
    std::this_thread::sleep_for(std::chrono::milliseconds(i % 2 == 0 ? 10 * i : 150 * i));
    service_.command().Signal(SIGKILL);
    EXPECT_EQ(service_.Wait().signal, SIGKILL);
    saver.join();
    ASSERT_NO_FATAL_FAILURE(StartReady(settings));
    EXPECT_EQ(service_.StatusValue("state"), "running") << i;
    EXPECT_EQ(service_.StatusValue("label"), "case-1") << i;
    int num_files = 0;
    for (const std::string& file : FilesBelow(service_.state_folder())) {
      EXPECT_EQ(file.find(".partial-"), std::string::npos) << file;
      if (!file.ends_with(".atlas")) continue;
      const CommandResult info = Haustra({"atlas", "info", StatePath(file)});
      EXPECT_EQ(info.exit_code, 0) << info.ToString();
      num_files += file.starts_with("saved/");
    }
    EXPECT_GE(num_files, num_saved) << "what was reported saved is there";
  }
  EXPECT_EQ(service_.Ask("end wipe"), "wiped\n");
  EXPECT_EQ(StopAndWait(), 0);
}

// What the kernel lists of a process in /proc: "fd", "task".
int NumListed(pid_t pid, const std::string& what) {
  const fs::path folder = "/proc/" + std::to_string(pid) + "/" + what;
  return static_cast<int>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

double ResidentBytesOf(pid_t pid) {
  std::ifstream statm("/proc/" + std::to_string(pid) + "/statm");
  double all_pages = 0.0, resident_pages = 0.0;
  statm >> all_pages >> resident_pages;
  EXPECT_TRUE(statm.good()) << pid;
  return resident_pages * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

TEST_F(Daemon, ManyProceduresTakeNoMoreMemoryThanAFew) {
  RecordProperty("req", "MEM-002");
  if (HAUSTRA_SANITIZED) GTEST_SKIP() << "a sanitizer keeps what is freed, on purpose";
  constexpr int kNumFirst = 4;
  // HAUSTRA_PROCEDURES=200 for a soak.
  const char* wanted = std::getenv("HAUSTRA_PROCEDURES");
  const int num_procedures = wanted != nullptr ? std::stoi(wanted) : 12;
  // Between two searches of a heap that is given back as a whole, figures differ by some pages.
  constexpr double kPages_bytes = 1e6;
  ASSERT_NO_FATAL_FAILURE(StartReady(
      {"--set", "vision.threads=1", "--set", "memory.max_map_points=20000", "--set", "memory.max_keyframes=100"}));
  // Of the supervisor: the worker is a new process each time, and takes what it has time to map.
  double most_of_first = 0.0, last = 0.0;
  int num_files = 0, num_threads = 0;
  for (int i = 0; i < num_procedures; ++i) {
    ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-" + std::to_string(i)));
    ASSERT_EQ(service_.Ask("end wipe"), "wiped\n");
    last = ResidentBytesOf(service_.pid());
    if (i < kNumFirst) {
      most_of_first = std::max(most_of_first, last);
      num_files = NumListed(service_.pid(), "fd");
      num_threads = NumListed(service_.pid(), "task");
    }
  }
  // A client that has hung up, and a file on its way to the disk, go a moment later.
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (NumListed(service_.pid(), "fd") > num_files + 1 && std::chrono::steady_clock::now() < limit) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_LE(NumListed(service_.pid(), "fd"), num_files + 1);
  EXPECT_LE(NumListed(service_.pid(), "task"), num_threads);
  EXPECT_LE(last, most_of_first + kPages_bytes);
  RecordProperty("growth_bytes", std::to_string(last - most_of_first));
  EXPECT_EQ(StopAndWait(), 0);
}

TEST_F(Daemon, ProcedureOfAnotherPatientDoesNotGoOnByItself) {
  RecordProperty("req", "DATA-003");
  ASSERT_NO_FATAL_FAILURE(StartReady({"--set", "checkpoint.interval_s=1"}));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  ASSERT_TRUE(service_.WaitForStatus("checkpoint_age_s"));
  service_.command().Signal(SIGKILL);
  EXPECT_EQ(service_.Wait().signal, SIGKILL);
  // As after a power cut: written in another run of the system, by a service that did not stop in order.
  std::string record = ReadBytes(StatePath("procedure"));
  ASSERT_NE(record.find("\nstate running\n"), std::string::npos) << record;
  const std::size_t boot = record.find("\nboot ") + 6;
  record.replace(boot, record.find('\n', boot) - boot, "of-yesterday");
  WriteBytes(StatePath("procedure"), record);
  ASSERT_NO_FATAL_FAILURE(StartReady({"--set", "procedure.begin_at_start=true"}));
  EXPECT_EQ(service_.StatusValue("state"), "idle");
  EXPECT_EQ(service_.StatusValue("interrupted"), "yes");
  EXPECT_EQ(service_.StatusValue("label"), "case-1");
  EXPECT_NE(service_.Ask("begin case-2").find("'case-1' is on the disk: resume or end it first"), std::string::npos);
  EXPECT_TRUE(service_.Ask("resume").starts_with("procedure "));
  EXPECT_EQ(service_.StatusValue("label"), "case-1");
  EXPECT_EQ(service_.Ask("end wipe"), "wiped\n");
  EXPECT_TRUE(service_.Ask("begin case-2").starts_with("procedure "));
  EXPECT_EQ(StopAndWait(), 0);
}

TEST_F(Daemon, DamagedCheckpointIsRefusedAndKeptUntilSomebodyDecides) {
  RecordProperty("req", "DMN-005");
  ASSERT_NO_FATAL_FAILURE(StartReady());
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  EXPECT_EQ(StopAndWait(), 0);
  std::string bytes = ReadBytes(StatePath("checkpoint.atlas"));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  WriteBytes(StatePath("checkpoint.atlas"), bytes);
  ASSERT_NO_FATAL_FAILURE(StartReady());
  EXPECT_EQ(service_.StatusValue("state"), "idle");
  EXPECT_NE(service_.Ask("resume").find("checkpoint.atlas"), std::string::npos);
  EXPECT_EQ(service_.StatusValue("state"), "idle");
  EXPECT_TRUE(Exists(StatePath("checkpoint.atlas")));
  EXPECT_EQ(service_.Ask("end wipe"), "wiped\n");
  EXPECT_FALSE(Exists(StatePath("checkpoint.atlas")));
  EXPECT_TRUE(service_.Ask("begin").starts_with("procedure "));
  EXPECT_EQ(StopAndWait(), 0);
}

// Parts of all pictures of a sequence.
std::set<std::string> PartsOfPictures(const std::string& sequence) {
  std::set<std::string> parts;
  for (const auto& file : fs::directory_iterator(sequence + "/frames")) {
    const Result<Image> image = ReadImage(file.path(), ChannelChoice::kAsStored);
    EXPECT_TRUE(image.ok()) << image.status().ToString();
    if (!image.ok()) break;
    const ImageView view = image->view();
    std::string pixels;
    for (int y = 0; y < view.height; ++y) {
      pixels.append(reinterpret_cast<const char*>(view.row(y)),
                    static_cast<std::size_t>(view.width) * BytesPerPixel(view.format));
    }
    parts.merge(TellingParts(pixels, 40));
  }
  return parts;
}

TEST_F(Daemon, NothingOfAProcedureOutlastsItsEnd) {
  RecordProperty("req", "DATA-001");
  // Small pools: every byte is looked at.
  const std::vector<std::string> settings = {
      "--set", "memory.max_map_points=20000", "--set", "memory.max_keyframes=100", "--set", "vision.threads=1",
      "--set", "checkpoint.interval_s=1"};
  ASSERT_NO_FATAL_FAILURE(StartReady(settings));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  ASSERT_TRUE(service_.WaitForStatus("checkpoint_age_s"));
  ASSERT_TRUE(service_.Ask("save sample").starts_with("saved "));
  const std::set<std::string> maps = TellingParts(ReadBytes(StatePath("saved/sample.atlas")), 5000);
  const std::set<std::string> pictures = PartsOfPictures(SequenceFolder("standard"));
  std::set<std::string> all = maps;
  all.insert(pictures.begin(), pictures.end());
  // Not under a sanitizer: its memory is hundreds of gigabytes, and it keeps what is freed, on purpose. The service
  // lets nobody else read its memory than the superuser.
  const bool may_look = !HAUSTRA_SANITIZED && geteuid() == 0;
  const std::vector<PartFound> before = may_look ? FindInMemory(service_.worker_pid(), all) : std::vector<PartFound>{};
  EXPECT_EQ(service_.Ask("end"), "wiped\n");
  EXPECT_EQ(FilesBelow(service_.state_folder()), std::vector<std::string>({"lock", "saved/sample.atlas"}));
  haustra_ring ring;
  ASSERT_EQ(haustra_ring_open(&ring, (service_.runtime_folder() + "/poses").c_str()), HAUSTRA_OK);
  haustra_pose pose;
  EXPECT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_NOT_YET);
  haustra_ring_close(&ring);
  EXPECT_EQ(service_.StatusValue("state"), "idle");
  if (!may_look) {
    StopAndWait();
    GTEST_SKIP() << "the process's memory is not looked at under a sanitizer, or without being root";
  }
  // Or the search proves nothing.
  EXPECT_GE(maps.size(), 2000u);
  EXPECT_GE(NumFound(maps, before), maps.size() / 2);
  EXPECT_GE(NumFound(pictures, before), 10u);
  const std::vector<PartFound> found = FindInService(all);
  // The next patient begins with nothing.
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-2"));
  EXPECT_EQ(service_.Ask("end keep"), "kept as case-2\n");
  EXPECT_TRUE(Exists(StatePath("saved/case-2.atlas")));
  EXPECT_EQ(StopAndWait(), 0);

  // A file of maps has the calibration of the camera in it. What a service that has never seen the patient has as well
  // is not the patient's.
  ASSERT_NO_FATAL_FAILURE(StartReady(settings));
  std::set<std::string> of_others;
  for (const PartFound& place : FindInService(all)) of_others.insert(place.part);
  EXPECT_LE(of_others.size(), 10u);
  std::vector<PartFound> stayed;
  for (const PartFound& place : found) {
    if (!of_others.contains(place.part)) stayed.push_back(place);
  }
  EXPECT_TRUE(stayed.empty()) << NumFound(maps, stayed) << " of " << maps.size() << " parts of the maps and "
                              << NumFound(pictures, stayed) << " of " << pictures.size()
                              << " parts of the pictures stayed:\n"
                              << PlacesText(stayed);
  EXPECT_EQ(StopAndWait(), 0);
}

TEST_F(Daemon, FullDiskCostsCheckpointsAndNothingElse) {
  RecordProperty("req", "DMN-009");
  // As full as it gets without a file system of one's own: the poses fit, the maps do not.
  ASSERT_NO_FATAL_FAILURE(StartReady({"--set", "checkpoint.interval_s=1"},
                                     {"/bin/bash", "-c", "trap '' XFSZ; ulimit -f 900; exec \"$@\"", "limited"}));
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  ASSERT_TRUE(service_.WaitForStatus("checkpoint_error"));
  EXPECT_NE(service_.StatusValue("checkpoint_error").find("checkpoint.atlas"), std::string::npos);
  EXPECT_EQ(service_.StatusValue("state"), "running");
  EXPECT_TRUE(service_.Ask("save a").starts_with("error: "));
  // Data that was to be kept and could not be is not wiped.
  EXPECT_TRUE(service_.Ask("end keep").starts_with("error: data not kept"));
  EXPECT_EQ(service_.StatusValue("state"), "stopped");
  EXPECT_EQ(service_.Ask("end wipe"), "wiped\n");
  for (const std::string& file : FilesBelow(service_.state_folder())) {
    EXPECT_EQ(file.find(".partial-"), std::string::npos) << file;
  }
  EXPECT_EQ(StopAndWait(), 0);
}

TEST_F(Daemon, EveryReasonNotToStartHasItsExitCode) {
  RecordProperty("req", "DMN-001");
  const auto run = [&](const std::vector<std::string>& arguments) {
    service_.Start(arguments);
    return service_.Wait();
  };
  const CommandResult typo = run({"--confg", "site.yaml"});
  EXPECT_EQ(typo.exit_code, 64);
  EXPECT_NE(typo.ToString().find("haustrad: --confg: no such option; did you mean --config?"), std::string::npos)
      << typo.ToString();
  EXPECT_EQ(run({"--set", "noise.kk=1"}).exit_code, 78);
  EXPECT_EQ(run({"--set", "noise.kk=1", "--check-config"}).exit_code, 78);
  EXPECT_EQ(run({"--check-config"}).exit_code, 0);
  EXPECT_EQ(run({}).exit_code, 78);  // no source
  EXPECT_EQ(run({"--source", "/nonexistent"}).exit_code, 66);
  EXPECT_EQ(run(Arguments({"--set", "publish.group=no-such-group"})).exit_code, 78);
  EXPECT_EQ(run(Arguments({"--set", "control.group=no-such-group"})).exit_code, 78);
  const CommandResult printed = run(Arguments({"--print-config"}));
  EXPECT_EQ(printed.exit_code, 0);
  WriteBytes(folder_ + "/printed.yaml", printed.out);
  EXPECT_EQ(run({"--config", folder_ + "/printed.yaml", "--check-config"}).exit_code, 0);
  EXPECT_EQ(run(Arguments({"--set", "files.state_folder=/nonexistent"})).exit_code, 74);
  const CommandResult too_large = run(Arguments({"--set", "memory.max_map_points=9000000"}));
  EXPECT_EQ(too_large.exit_code, 78);
  EXPECT_NE(too_large.err.find("sized by memory.max_map_points"), std::string::npos) << too_large.err;
  EXPECT_FALSE(service_.HasSaid("READY=1"));

  ASSERT_NO_FATAL_FAILURE(StartReady());
  std::vector<std::string> second = {HAUSTRAD_BINARY, "--set", "files.state_folder=" + service_.state_folder(), "--set",
                                     "files.runtime_folder=" + folder_};
  const std::vector<std::string> arguments = Arguments();
  second.insert(second.end(), arguments.begin(), arguments.end());
  EXPECT_EQ(Command(second).Wait(kHangLimit).exit_code, 75);
  EXPECT_EQ(service_.StatusValue("state"), "idle");
  EXPECT_EQ(StopAndWait(), 0);
}

}  // namespace
}  // namespace haustra::end_to_end
