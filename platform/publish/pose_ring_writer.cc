#include "platform/publish/pose_ring_writer.h"

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <system_error>
#include <utility>

#include "platform/publish/slot_writer.h"

namespace haustra {
namespace {

std::string ErrorText(int error) { return std::generic_category().message(error); }

// Readers of a daemon that died still hold its file.
void CloseFormerFile(const std::string& path) {
  haustra_ring former;
  if (haustra_ring_open(&former, path.c_str()) != HAUSTRA_OK) return;
  haustra_ring_close(&former);
  const OwnedDescriptor file{::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW)};
  haustra_ring_file* memory = file.value < 0 ? nullptr : MapShared<haustra_ring_file>(file.value);
  if (memory == nullptr) return;
  StoreWord(&memory->header.service, HAUSTRA_SERVICE_CLOSED);
  // What it showed was a patient's.
  WipeSlots(memory->poses);
  WipeSlots(memory->events);
  WipeSlots(memory->snapshots);
  ::munmap(memory, sizeof *memory);
}

}  // namespace

Result<std::unique_ptr<PoseRingWriter>> PoseRingWriter::Create(const std::string& path, mode_t mode, gid_t group) {
  const std::string temporary_path = path + ".new";
  ::unlink(temporary_path.c_str());
  OwnedDescriptor file{::open(temporary_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600)};
  if (file.value < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": its folder does not exist");
    return Unavailable(path + ": cannot be created: " + ErrorText(error));
  }
  const auto fail = [&](int error) {
    ::unlink(temporary_path.c_str());
    return Unavailable(path + ": cannot be created: " + ErrorText(error));
  };
  // Not ftruncate: memory that is not there would be missed at the first frame, with SIGBUS.
  if (const int error = ::posix_fallocate(file.value, 0, sizeof(haustra_ring_file)); error != 0) return fail(error);
  if (group != static_cast<gid_t>(-1) && ::fchown(file.value, static_cast<uid_t>(-1), group) != 0) return fail(errno);
  if (::fchmod(file.value, mode) != 0) return fail(errno);
  haustra_ring_file* memory = MapShared<haustra_ring_file>(file.value);
  if (memory == nullptr) return fail(errno);

  haustra_ring_header& header = memory->header;
  header.version = HAUSTRA_RING_VERSION;
  header.header_bytes = sizeof(haustra_ring_header);
  header.file_bytes = sizeof(haustra_ring_file);
  header.pose_slot_bytes = sizeof(haustra_pose_slot);
  header.num_pose_slots = HAUSTRA_POSE_SLOTS;
  header.event_slot_bytes = sizeof(haustra_event_slot);
  header.num_event_slots = HAUSTRA_EVENT_SLOTS;
  header.snapshot_slot_bytes = sizeof(haustra_snapshot_slot);
  header.num_snapshot_slots = HAUSTRA_SNAPSHOT_SLOTS;
  header.writer_pid = static_cast<std::uint64_t>(::getpid());
  header.service = HAUSTRA_SERVICE_STARTING;
  header.alive_ns = haustra_now_ns();
  header.magic = HAUSTRA_RING_MAGIC;

  CloseFormerFile(path);
  if (std::rename(temporary_path.c_str(), path.c_str()) != 0) {
    const int error = errno;
    ::munmap(memory, sizeof *memory);
    return fail(error);
  }
  return std::unique_ptr<PoseRingWriter>(new PoseRingWriter(path, std::exchange(file.value, -1), memory));
}

Result<std::unique_ptr<PoseRingWriter>> PoseRingWriter::Attach(int descriptor) {
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode) ||
      info.st_size != static_cast<off_t>(sizeof(haustra_ring_file))) {
    return DataLoss("the pose ring has another size");
  }
  haustra_ring_file* memory = MapShared<haustra_ring_file>(descriptor);
  if (memory == nullptr) return Unavailable("the pose ring cannot be mapped: " + ErrorText(errno));
  std::unique_ptr<PoseRingWriter> writer(new PoseRingWriter("", -1, memory));
  if (memory->header.magic != HAUSTRA_RING_MAGIC || memory->header.version != HAUSTRA_RING_VERSION) {
    return DataLoss("the pose ring has another layout");
  }
  return writer;
}

PoseRingWriter::~PoseRingWriter() {
  if (descriptor_ >= 0) {
    Wipe();
    SetService(HAUSTRA_SERVICE_CLOSED);
    ::unlink(path_.c_str());
    ::close(descriptor_);
  }
  ::munmap(file_, sizeof *file_);
}

void PoseRingWriter::PublishPose(const haustra_pose& pose) {
  HAUSTRA_CHECK(pose.num_marks <= HAUSTRA_MAX_MARKS);
  const std::uint64_t sequence = file_->header.newest_pose + 1;
  const SlotWriter slot(&file_->poses[sequence % HAUSTRA_POSE_SLOTS].lock, sequence);
  slot.Copy(&sequence, 0, sizeof sequence);
  slot.Copy(&pose.captured_ns, offsetof(haustra_pose, captured_ns),
            offsetof(haustra_pose, marks) - offsetof(haustra_pose, captured_ns));
  slot.Copy(pose.marks, offsetof(haustra_pose, marks), pose.num_marks * sizeof(haustra_mark_sighting));
  slot.Commit();
  StoreWord(&file_->header.newest_pose, sequence);
}

void PoseRingWriter::PublishEvent(const haustra_event& event) {
  const std::uint64_t sequence = file_->header.newest_event + 1;
  const SlotWriter slot(&file_->events[sequence % HAUSTRA_EVENT_SLOTS].lock, sequence);
  slot.Copy(&sequence, 0, sizeof sequence);
  slot.Copy(&event.published_ns, offsetof(haustra_event, published_ns),
            sizeof event - offsetof(haustra_event, published_ns));
  slot.Commit();
  StoreWord(&file_->header.newest_event, sequence);
}

void PoseRingWriter::PublishSnapshot(const haustra_snapshot& snapshot) {
  HAUSTRA_CHECK(snapshot.num_points <= HAUSTRA_SNAPSHOT_POINTS);
  HAUSTRA_CHECK(snapshot.num_keyframes <= HAUSTRA_SNAPSHOT_KEYFRAMES);
  HAUSTRA_CHECK(snapshot.num_marks <= HAUSTRA_MAX_MARKS);
  const std::uint64_t sequence = file_->header.newest_snapshot + 1;
  const SlotWriter slot(&file_->snapshots[sequence % HAUSTRA_SNAPSHOT_SLOTS].lock, sequence);
  slot.Copy(&sequence, 0, sizeof sequence);
  slot.Copy(&snapshot.published_ns, offsetof(haustra_snapshot, published_ns),
            offsetof(haustra_snapshot, marks) - offsetof(haustra_snapshot, published_ns));
  slot.Copy(snapshot.marks, offsetof(haustra_snapshot, marks), snapshot.num_marks * sizeof(haustra_mark));
  slot.Copy(snapshot.keyframes, offsetof(haustra_snapshot, keyframes), snapshot.num_keyframes * sizeof(haustra_point));
  slot.Copy(snapshot.points, offsetof(haustra_snapshot, points), snapshot.num_points * sizeof(haustra_point));
  slot.Commit();
  StoreWord(&file_->header.newest_snapshot, sequence);
}

void PoseRingWriter::SetService(haustra_service service) { StoreWord(&file_->header.service, service); }
haustra_service PoseRingWriter::service() const {
  return static_cast<haustra_service>(haustra_load_(&file_->header.service));
}
void PoseRingWriter::SetProcedure(std::uint64_t number) { StoreWord(&file_->header.procedure, number); }
std::uint64_t PoseRingWriter::procedure() const { return haustra_load_(&file_->header.procedure); }

void PoseRingWriter::Beat() { __atomic_store_n(&file_->header.alive_ns, haustra_now_ns(), __ATOMIC_RELEASE); }

void PoseRingWriter::Wipe() {
  WipeSlots(file_->poses);
  WipeSlots(file_->events);
  WipeSlots(file_->snapshots);
}

}  // namespace haustra
