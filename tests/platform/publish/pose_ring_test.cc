#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/published_records.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

class PoseRing : public testing::Test {
 protected:
  PoseRing() {
    std::string pattern = testing::TempDir() + "pose_ring_XXXXXX";
    folder_ = mkdtemp(pattern.data());
    path_ = folder_ + "/poses";
  }
  ~PoseRing() override { fs::remove_all(folder_); }

  std::unique_ptr<PoseRingWriter> MakeWriter() {
    auto writer = PoseRingWriter::Create(path_, 0640, static_cast<gid_t>(-1));
    EXPECT_TRUE(writer.ok()) << writer.status().ToString();
    return std::move(*writer);
  }
  haustra_ring OpenRing() {
    haustra_ring ring;
    EXPECT_EQ(haustra_ring_open(&ring, path_.c_str()), HAUSTRA_OK);
    return ring;
  }

  std::string folder_, path_;
};

// Every field says the same number, so that a record made of two shows.
haustra_pose UniformPose(std::uint64_t number) {
  haustra_pose pose{};
  pose.captured_ns = pose.published_ns = pose.source_ns = static_cast<std::int64_t>(number);
  pose.frame_index = pose.procedure = pose.map_epoch = number;
  pose.map_id = pose.num_features = pose.num_inliers = static_cast<std::uint32_t>(number);
  for (double& value : pose.position_mu) value = static_cast<double>(number);
  for (double& value : pose.orientation_xyzw) value = static_cast<double>(number);
  pose.num_marks = 1 + static_cast<std::uint32_t>(number % HAUSTRA_MAX_MARKS);
  for (haustra_mark_sighting& mark : pose.marks) mark.id = mark.state = pose.map_id;
  return pose;
}

bool IsUniform(const haustra_pose& pose) {
  const std::uint64_t number = pose.sequence;
  const auto value = static_cast<double>(number);
  bool is_uniform = pose.captured_ns == static_cast<std::int64_t>(number) && pose.source_ns == pose.captured_ns &&
                    pose.published_ns == pose.captured_ns && pose.frame_index == number && pose.procedure == number &&
                    pose.map_epoch == number && pose.map_id == static_cast<std::uint32_t>(number) &&
                    pose.num_features == pose.map_id && pose.num_inliers == pose.map_id;
  for (const double v : pose.position_mu) is_uniform = is_uniform && v == value;
  for (const double v : pose.orientation_xyzw) is_uniform = is_uniform && v == value;
  is_uniform = is_uniform && pose.num_marks == 1 + number % HAUSTRA_MAX_MARKS;
  for (std::uint32_t i = 0; i < pose.num_marks && is_uniform; ++i) {
    is_uniform = pose.marks[i].id == pose.map_id && pose.marks[i].state == pose.map_id;
  }
  return is_uniform;
}

// Reads poses in order until the file is closed. Every one is whole, and none is lost without being counted.
struct ReaderOutcome {
  std::uint64_t num_read = 0;
  std::uint64_t num_missed = 0;
  std::uint64_t num_torn = 0;
  std::uint64_t num_out_of_order = 0;
};
ReaderOutcome ReadUntilClosed(const haustra_ring& ring) {
  ReaderOutcome outcome;
  std::uint64_t cursor = 0;
  bool is_closed = false;
  while (true) {
    const std::uint64_t before = cursor;
    haustra_pose pose;
    std::uint64_t num_missed = 0;
    const int result = haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed);
    outcome.num_missed += num_missed;
    if (result == HAUSTRA_OK) {
      ++outcome.num_read;
      if (!IsUniform(pose)) ++outcome.num_torn;
      if (pose.sequence != cursor || cursor != before + num_missed + 1) ++outcome.num_out_of_order;
      continue;
    }
    if (is_closed) return outcome;
    is_closed = haustra_ring_service(&ring) == HAUSTRA_SERVICE_CLOSED;
    std::this_thread::yield();
  }
}

// A camera at 25 Hz in a time of its own, a tracker that takes 5 to 13 ms and once in a while longer, frames that are
// dropped; and a reader that sleeps as it is told.
TEST_F(PoseRing, AnotherProcessWritesRecordsIntoTheSameFile) {
  RecordProperty("req", "PUB-001,PUB-004");
  const auto owner = MakeWriter();
  const haustra_ring ring = OpenRing();
  owner->SetService(HAUSTRA_SERVICE_RUNNING);
  const pid_t child = fork();
  if (child == 0) {
    const auto attached = PoseRingWriter::Attach(owner->descriptor());
    if (!attached.ok()) _exit(1);
    for (std::uint64_t i = 1; i <= 3; ++i) (*attached)->PublishPose(UniformPose(i));
    raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  haustra_pose pose;
  ASSERT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_OK);
  EXPECT_EQ(pose.sequence, 3u);
  EXPECT_TRUE(IsUniform(pose));
  EXPECT_EQ(haustra_ring_service(&ring), HAUSTRA_SERVICE_RUNNING) << "its death closes nothing";
  // The next one goes on where it was.
  {
    const auto attached = PoseRingWriter::Attach(owner->descriptor());
    ASSERT_TRUE(attached.ok()) << attached.status().ToString();
    (*attached)->PublishPose(UniformPose(4));
  }
  ASSERT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_OK);
  EXPECT_EQ(pose.sequence, 4u);
  EXPECT_EQ(haustra_ring_service(&ring), HAUSTRA_SERVICE_RUNNING);
}

TEST_F(PoseRing, OnlyAPoseRingIsAttachedTo) {
  const int file = memfd_create("something", MFD_CLOEXEC);
  EXPECT_EQ(PoseRingWriter::Attach(file).code(), StatusCode::kDataLoss);
  ASSERT_EQ(ftruncate(file, sizeof(haustra_ring_file)), 0);
  EXPECT_EQ(PoseRingWriter::Attach(file).code(), StatusCode::kDataLoss);
  close(file);
  EXPECT_EQ(PoseRingWriter::Attach(-1).code(), StatusCode::kDataLoss);
}

TEST_F(PoseRing, ReaderThatPausesSeesEveryPoseSoonAndLooksSeldom) {
  constexpr std::int64_t kMs = 1'000'000;
  constexpr std::int64_t kPeriod = 40 * kMs;
  constexpr int kNumFrames = 500;
  const auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  EXPECT_EQ(haustra_ring_pause_ns(&ring, 0), 20 * kMs) << "before the first pose";

  std::int64_t now = 0;
  std::int64_t longest_delay = 0;
  std::int64_t all_delays = 0;
  int num_looks = 0;
  int num_seen = 0;
  for (int i = 0; i < kNumFrames; ++i) {
    if (i % 50 == 20) continue;  // dropped
    haustra_pose pose{};
    pose.frame_index = static_cast<std::uint64_t>(i);
    pose.captured_ns = i * kPeriod;
    pose.published_ns = pose.captured_ns + (i % 40 == 30 ? 35 : 5 + i * 7 % 9) * kMs;
    while (now < pose.published_ns) {
      const std::int64_t pause = haustra_ring_pause_ns(&ring, now);
      ASSERT_GE(pause, 2 * kMs);
      now += pause;
      ++num_looks;
    }
    writer->PublishPose(pose);
    ++num_seen;
    all_delays += now - pose.published_ns;
    if (num_seen > 2) longest_delay = std::max(longest_delay, now - pose.published_ns);
  }
  EXPECT_LE(num_looks, 6 * num_seen);
  EXPECT_LE(longest_delay, 5 * kMs);
  EXPECT_LE(all_delays, 2 * kMs * num_seen);

  EXPECT_EQ(haustra_ring_pause_ns(&ring, now + 1000 * kMs), 20 * kMs) << "when none come any more";
  writer->Wipe();
  EXPECT_EQ(haustra_ring_pause_ns(&ring, now), 20 * kMs);
  haustra_ring_close(&ring);
}

TEST_F(PoseRing, RecordsComeOutAsTheyWentIn) {
  RecordProperty("req", "PUB-001");
  const auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  haustra_pose pose;
  EXPECT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_NOT_YET);
  EXPECT_EQ(haustra_ring_read_pose(&ring, 1, &pose), HAUSTRA_NOT_YET);
  writer->PublishPose(UniformPose(1));
  ASSERT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_OK);
  EXPECT_TRUE(IsUniform(pose));

  haustra_event event{};
  event.kind = HAUSTRA_EVENT_MERGED;
  event.map_id = 3;
  event.other_map_id = 7;
  event.num_inliers = 55;
  writer->PublishEvent(event);
  std::uint64_t cursor = 0, num_missed = 9;
  haustra_event read_event;
  ASSERT_EQ(haustra_ring_next_event(&ring, &cursor, &read_event, &num_missed), HAUSTRA_OK);
  EXPECT_EQ(num_missed, 0u);
  EXPECT_EQ(read_event.sequence, 1u);
  EXPECT_EQ(read_event.kind, static_cast<std::uint32_t>(HAUSTRA_EVENT_MERGED));
  EXPECT_EQ(read_event.other_map_id, 7u);
  EXPECT_EQ(read_event.num_inliers, 55u);
  EXPECT_EQ(haustra_ring_next_event(&ring, &cursor, &read_event, &num_missed), HAUSTRA_NOT_YET);

  const auto snapshot = std::make_unique<haustra_snapshot>();
  snapshot->map_id = 4;
  snapshot->num_points = snapshot->num_map_points = HAUSTRA_SNAPSHOT_POINTS;
  snapshot->points[HAUSTRA_SNAPSHOT_POINTS - 1] = {{1.0f, 2.0f, 3.0f}, 99};
  snapshot->num_keyframes = 1;
  snapshot->keyframes[0] = {{4.0f, 5.0f, 6.0f}, 42};
  writer->PublishSnapshot(*snapshot);
  const auto read = std::make_unique<haustra_snapshot>();
  ASSERT_EQ(haustra_ring_latest_snapshot(&ring, read.get()), HAUSTRA_OK);
  EXPECT_EQ(read->num_points, HAUSTRA_SNAPSHOT_POINTS);
  EXPECT_EQ(read->points[HAUSTRA_SNAPSHOT_POINTS - 1].id, 99u);
  EXPECT_EQ(read->points[HAUSTRA_SNAPSHOT_POINTS - 1].position_mu[2], 3.0f);
  EXPECT_EQ(read->keyframes[0].id, 42u);
  haustra_ring_close(&ring);
}

TEST_F(PoseRing, ReaderThatFellBehindIsToldHowManyItMissed) {
  RecordProperty("req", "PUB-003");
  const auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  for (std::uint64_t n = 1; n <= 1000; ++n) writer->PublishPose(UniformPose(n));
  haustra_pose pose;
  EXPECT_EQ(haustra_ring_read_pose(&ring, 1, &pose), HAUSTRA_OVERRUN);
  std::uint64_t cursor = 0, num_missed = 0, num_read = 0;
  ASSERT_EQ(haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed), HAUSTRA_OK);
  EXPECT_GE(num_missed, 1000 - HAUSTRA_POSE_SLOTS);
  EXPECT_EQ(pose.sequence, num_missed + 1);
  const std::uint64_t first = pose.sequence;
  do ++num_read;
  while (haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed) == HAUSTRA_OK);
  EXPECT_EQ(first + num_read - 1, 1000u);
  haustra_ring_close(&ring);
}

TEST_F(PoseRing, ManyReadersGetWholeRecordsFromAWriterAtFullSpeed) {
  RecordProperty("req", "PUB-002");
  constexpr int kNumReaders = 8;
  constexpr std::uint64_t kNumPoses = 40000;
  auto writer = MakeWriter();
  std::vector<haustra_ring> rings;
  for (int i = 0; i < kNumReaders; ++i) rings.push_back(OpenRing());
  std::vector<ReaderOutcome> outcomes(kNumReaders);
  std::vector<std::thread> readers;
  for (int i = 0; i < kNumReaders; ++i) readers.emplace_back([&, i] { outcomes[i] = ReadUntilClosed(rings[i]); });
  for (std::uint64_t n = 1; n <= kNumPoses; ++n) {
    writer->PublishPose(UniformPose(n));
    if (n % 64 == 0) std::this_thread::yield();
  }
  // Not the destructor: the readers have not finished with the last poses.
  writer->SetService(HAUSTRA_SERVICE_CLOSED);
  for (std::thread& reader : readers) reader.join();
  for (const ReaderOutcome& outcome : outcomes) {
    EXPECT_EQ(outcome.num_torn, 0u);
    EXPECT_EQ(outcome.num_out_of_order, 0u);
    EXPECT_EQ(outcome.num_read + outcome.num_missed, kNumPoses);
    EXPECT_GT(outcome.num_read, 0u);
  }
  for (haustra_ring& ring : rings) haustra_ring_close(&ring);
}

TEST_F(PoseRing, SnapshotsAreWholeWhileTheyAreReplaced) {
  const auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  std::atomic<bool> stop{false};
  std::atomic<int> num_read{0};
  std::thread reader([&] {
    const auto snapshot = std::make_unique<haustra_snapshot>();
    while (!stop) {
      if (haustra_ring_latest_snapshot(&ring, snapshot.get()) != HAUSTRA_OK) continue;
      ++num_read;
      const std::uint32_t number = snapshot->map_id;
      for (std::uint32_t i = 0; i < snapshot->num_points; ++i) ASSERT_EQ(snapshot->points[i].id, number);
      ASSERT_EQ(snapshot->num_points, 1000 + number % 1000);
    }
  });
  const auto snapshot = std::make_unique<haustra_snapshot>();
  // Until there was something to see, and enough of it.
  for (std::uint32_t n = 1; n <= 200 || num_read < 20; ++n) {
    snapshot->map_id = n;
    snapshot->num_points = 1000 + n % 1000;
    for (std::uint32_t i = 0; i < snapshot->num_points; ++i) snapshot->points[i].id = n;
    writer->PublishSnapshot(*snapshot);
    std::this_thread::yield();
  }
  stop = true;
  reader.join();
  haustra_ring_close(&ring);
}

// Child processes that read, one of them stopped and one killed: the others and the writer go on.
TEST_F(PoseRing, StoppedAndKilledReadersDisturbNobody) {
  RecordProperty("req", "PUB-002");
  auto writer = MakeWriter();
  std::vector<pid_t> children;
  for (int i = 0; i < 3; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      haustra_ring ring;
      if (haustra_ring_open(&ring, path_.c_str()) != HAUSTRA_OK) _exit(2);
      const ReaderOutcome outcome = ReadUntilClosed(ring);
      _exit(outcome.num_torn == 0 && outcome.num_out_of_order == 0 && outcome.num_read > 0 ? 0 : 1);
    }
    children.push_back(child);
  }
  std::uint64_t n = 0;
  for (; n < 5000; ++n) writer->PublishPose(UniformPose(n + 1));
  kill(children[0], SIGSTOP);
  kill(children[1], SIGKILL);
  for (; n < 20000; ++n) {
    writer->PublishPose(UniformPose(n + 1));
    if (n % 1000 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  // A reader that comes only now finds the newest, and what is kept.
  haustra_ring ring = OpenRing();
  haustra_pose pose;
  ASSERT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_OK);
  EXPECT_EQ(pose.sequence, 20000u);
  haustra_ring_close(&ring);
  writer->SetService(HAUSTRA_SERVICE_CLOSED);
  int status = 0;
  ASSERT_EQ(waitpid(children[2], &status, 0), children[2]);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  kill(children[0], SIGCONT);
  ASSERT_EQ(waitpid(children[0], &status, 0), children[0]);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  waitpid(children[1], &status, 0);
}

TEST_F(PoseRing, RestartOfTheWriterIsSeenByItsReaders) {
  RecordProperty("req", "PUB-004");
  auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  writer->Beat();
  EXPECT_TRUE(haustra_ring_is_alive(&ring, 1000000000));
  EXPECT_FALSE(haustra_ring_is_alive(&ring, -1));
  EXPECT_FALSE(haustra_ring_is_replaced(&ring, path_.c_str()));
  writer.reset();
  EXPECT_FALSE(fs::exists(path_));
  EXPECT_FALSE(haustra_ring_is_alive(&ring, 1000000000));
  EXPECT_FALSE(haustra_ring_is_replaced(&ring, path_.c_str()));
  writer = MakeWriter();
  EXPECT_TRUE(haustra_ring_is_replaced(&ring, path_.c_str()));
  haustra_ring_close(&ring);
}

TEST_F(PoseRing, FileOfAWriterThatCrashedIsClosedAndWipedByTheNext) {
  RecordProperty("req", "PUB-004");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    MakeWriter().release()->PublishPose(UniformPose(1));
    _exit(0);  // no destructor: as if killed
  }
  int status = 0;
  waitpid(child, &status, 0);
  haustra_ring ring = OpenRing();
  haustra_pose pose;
  ASSERT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_OK);
  const auto writer = MakeWriter();
  EXPECT_EQ(haustra_ring_service(&ring), HAUSTRA_SERVICE_CLOSED);
  EXPECT_TRUE(haustra_ring_is_replaced(&ring, path_.c_str()));
  EXPECT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_NOT_YET);
  haustra_ring_close(&ring);
}

TEST_F(PoseRing, WipeLeavesNothingToRead) {
  RecordProperty("req", "DATA-001");
  const auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  for (std::uint64_t n = 1; n <= 10; ++n) writer->PublishPose(UniformPose(n));
  writer->PublishEvent({});
  const auto snapshot = std::make_unique<haustra_snapshot>();
  snapshot->num_points = 10;
  snapshot->num_marks = 1;
  std::strcpy(snapshot->marks[0].label, "polyp");
  writer->PublishSnapshot(*snapshot);
  std::uint64_t cursor = 4, num_missed = 0;
  writer->Wipe();
  haustra_pose pose;
  haustra_event event;
  EXPECT_EQ(haustra_ring_latest_pose(&ring, &pose), HAUSTRA_NOT_YET);
  EXPECT_EQ(haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed), HAUSTRA_NOT_YET);
  EXPECT_EQ(num_missed, 6u);
  EXPECT_EQ(haustra_ring_read_event(&ring, 1, &event), HAUSTRA_OVERRUN);
  EXPECT_EQ(haustra_ring_latest_snapshot(&ring, snapshot.get()), HAUSTRA_NOT_YET);
  // Nothing of it is in the file either.
  const std::ifstream file(path_, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  EXPECT_EQ(bytes.str().find_first_not_of('\0', sizeof(haustra_ring_header)), std::string::npos);
  // And it goes on.
  writer->PublishPose(UniformPose(11));
  ASSERT_EQ(haustra_ring_next_pose(&ring, &cursor, &pose, &num_missed), HAUSTRA_OK);
  EXPECT_EQ(pose.sequence, 11u);
  haustra_ring_close(&ring);
}

TEST_F(PoseRing, ReadersCannotWrite) {
  RecordProperty("req", "PUB-002");
  const auto writer = MakeWriter();
  haustra_ring ring = OpenRing();
  void* memory = const_cast<haustra_ring_file*>(ring.file);
  EXPECT_NE(mprotect(memory, 4096, PROT_READ | PROT_WRITE), 0);
  haustra_ring_close(&ring);
  struct stat info {};
  ASSERT_EQ(stat(path_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0640u);
}

TEST_F(PoseRing, OtherFilesAreRefusedByWhatIsWrongWithThem) {
  RecordProperty("req", "PUB-001");
  haustra_ring ring;
  EXPECT_EQ(haustra_ring_open(&ring, path_.c_str()), HAUSTRA_NO_FILE);
  EXPECT_EQ(haustra_ring_open(&ring, folder_.c_str()), HAUSTRA_NOT_A_RING);
  const auto writer = MakeWriter();
  std::string bytes;
  {
    const std::ifstream file(path_, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    bytes = text.str();
  }
  const std::string other = folder_ + "/other";
  const auto open_with = [&](std::size_t offset, char value, std::size_t size) {
    std::string changed = bytes.substr(0, size);
    if (offset < changed.size()) changed[offset] = value;
    std::ofstream(other, std::ios::binary) << changed;
    const int result = haustra_ring_open(&ring, other.c_str());
    haustra_ring_close(&ring);
    return result;
  };
  EXPECT_EQ(open_with(bytes.size(), 0, bytes.size()), HAUSTRA_OK);
  EXPECT_EQ(open_with(0, 'x', bytes.size()), HAUSTRA_NOT_A_RING);
  EXPECT_EQ(open_with(offsetof(haustra_ring_header, version), HAUSTRA_RING_VERSION + 1, bytes.size()),
            HAUSTRA_OTHER_VERSION);
  EXPECT_EQ(open_with(offsetof(haustra_ring_header, num_pose_slots), 1, bytes.size()), HAUSTRA_NOT_A_RING);
  EXPECT_EQ(open_with(offsetof(haustra_ring_header, pose_slot_bytes), 1, bytes.size()), HAUSTRA_NOT_A_RING);
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, std::size_t{100}, bytes.size() - 1}) {
    EXPECT_EQ(open_with(size, 0, size), HAUSTRA_NOT_A_RING) << size;
  }
}

TEST_F(PoseRing, NoRoomAtTheStartIsAnErrorThatLeavesNothingBehind) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // As full as it gets without a file system of one's own.
    signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{4096, 4096};
    setrlimit(RLIMIT_FSIZE, &limit);
    const auto writer = PoseRingWriter::Create(path_, 0640, static_cast<gid_t>(-1));
    _exit(writer.code() == StatusCode::kUnavailable && fs::is_empty(folder_) ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_EQ(PoseRingWriter::Create(folder_ + "/none/poses", 0640, static_cast<gid_t>(-1)).code(),
            StatusCode::kNotFound);
}

TEST_F(PoseRing, NamesAreThoseOfTheEngine) {
  for (std::uint32_t i = 0; i < 32; ++i) {
    EXPECT_EQ(ToString(static_cast<TrackingState>(i)), haustra_state_name(i)) << i;
    FrameResult result;
    result.reason = static_cast<TrackingReason>(i);
    const std::string_view published = haustra_reason_name(PoseRecord(result, {}, {}, {}, 1).reason);
    EXPECT_EQ(ToString(result.reason), published) << i;
    EXPECT_EQ(ToString(static_cast<MapEventKind>(i)), haustra_event_name(i)) << i;
  }
}

TEST(PublishedRecords, PoseTakesPointsOfTheCameraIntoTheMap) {
  RecordProperty("req", "PUB-001");
  FrameResult result;
  result.state = TrackingState::kTracking;
  result.map_id = 5;
  result.map_epoch = 2;
  const Eigen::Vector3d centre(1.0, 2.0, 3.0);
  const Eigen::Quaterniond map_from_cam(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 2).normalized()));
  // cam_from_map by hand: R^T (x - centre).
  result.cam_from_map.rotation = map_from_cam.conjugate();
  result.cam_from_map.translation = -(map_from_cam.conjugate() * centre);
  const haustra_pose pose = PoseRecord(result, {}, TimePoint(Duration(100)), TimePoint(Duration(250)), 7);
  EXPECT_EQ(pose.flags, static_cast<std::uint32_t>(HAUSTRA_POSE_VALID));
  EXPECT_EQ(pose.captured_ns, 100);
  EXPECT_EQ(pose.published_ns, 250);
  EXPECT_EQ(pose.procedure, 7u);
  EXPECT_EQ(pose.map_id, 5u);
  EXPECT_EQ(pose.map_epoch, 2u);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(pose.position_mu[i], centre[i], 1e-12);
  const Eigen::Quaterniond read(pose.orientation_xyzw);
  EXPECT_LT(read.angularDistance(map_from_cam), 1e-12);
}

TEST(PublishedRecords, MarksComeWithThePose) {
  MarkSightings marks;
  ASSERT_TRUE(marks.PushBack({4, MarkState::kInFront, 100.5f, 20.0f, 0.75f}));
  ASSERT_TRUE(marks.PushBack({9, MarkState::kHidden, 10.0f, 30.0f, 2.5f}));
  FrameResult result;
  result.state = TrackingState::kTracking;
  const haustra_pose pose = PoseRecord(result, marks, TimePoint{}, TimePoint{}, 1);
  ASSERT_EQ(pose.num_marks, 2u);
  EXPECT_EQ(pose.marks[0].id, 4u);
  EXPECT_EQ(pose.marks[0].state, static_cast<std::uint32_t>(HAUSTRA_MARK_IN_FRONT));
  EXPECT_EQ(pose.marks[0].u_px, 100.5f);
  EXPECT_EQ(pose.marks[1].v_px, 30.0f);
  EXPECT_EQ(pose.marks[1].distance_in_depths, 2.5f);
  EXPECT_STREQ(haustra_mark_state_name(pose.marks[1].state), "hidden");
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(haustra_mark_state_name(static_cast<std::uint32_t>(i)), ToString(static_cast<MarkState>(i)));
  }
}

TEST(PublishedRecords, PoseWithoutTrackingIsNotValidAndMonocularScaleIsNeverKnown) {
  RecordProperty("req", "TRK-001,SCALE-001");
  FrameResult result;
  result.cam_from_map.translation = Eigen::Vector3d(1, 1, 1);
  for (const TrackingState state : {TrackingState::kInitialising, TrackingState::kTracking, TrackingState::kLost}) {
    result.state = state;
    const haustra_pose pose = PoseRecord(result, {}, TimePoint{}, TimePoint{}, 1);
    EXPECT_EQ((pose.flags & HAUSTRA_POSE_VALID) != 0, state == TrackingState::kTracking);
    EXPECT_EQ(pose.flags & HAUSTRA_POSE_SCALE_KNOWN, 0u);
    if (state != TrackingState::kTracking) {
      EXPECT_EQ(pose.position_mu[0], 0.0);
    }
  }
}

TEST(PublishedRecords, OldPosesAreNotCurrent) {
  RecordProperty("req", "TRK-002");
  haustra_pose pose{};
  pose.flags = HAUSTRA_POSE_VALID;
  pose.captured_ns = haustra_now_ns();
  EXPECT_TRUE(haustra_pose_is_current(&pose, 10'000'000'000));
  pose.captured_ns -= 20'000'000'000;
  EXPECT_FALSE(haustra_pose_is_current(&pose, 10'000'000'000));
  pose.captured_ns = haustra_now_ns();
  pose.flags |= HAUSTRA_POSE_PREDICTED;
  EXPECT_FALSE(haustra_pose_is_current(&pose, 10'000'000'000));
}

}  // namespace
}  // namespace haustra
