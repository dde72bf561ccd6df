#include "platform/publish/pose_ring_writer.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstring>

#include "platform/publish/shared_file.h"
#include "platform/publish/slot_writer.h"

namespace haustra {
namespace {

bool IsPoseRing(const std::string& path) {
  haustra_ring ring;
  const bool is_ring = haustra_ring_open(&ring, path.c_str()) == HAUSTRA_OK;
  haustra_ring_close(&ring);
  return is_ring;
}

}  // namespace

Result<std::unique_ptr<PoseRingWriter>> PoseRingWriter::Create(const std::string& path, mode_t mode, gid_t group) {
  const auto prepare = [&](void* memory) {
    haustra_ring_header& header = static_cast<haustra_ring_file*>(memory)->header;
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
  };
  // Readers of a daemon that died still hold its file.
  const auto close = [is_ring = IsPoseRing(path)](void* memory) {
    if (is_ring) StoreWord(&static_cast<haustra_ring_file*>(memory)->header.service, HAUSTRA_SERVICE_CLOSED);
  };
  HAUSTRA_ASSIGN(const SharedFile file, CreateSharedFile(path, mode, group, sizeof(haustra_ring_file), prepare, close));
  return std::unique_ptr<PoseRingWriter>(
      new PoseRingWriter(path, file.descriptor, static_cast<haustra_ring_file*>(file.memory)));
}

Result<std::unique_ptr<PoseRingWriter>> PoseRingWriter::Attach(int descriptor) {
  HAUSTRA_ASSIGN(void* const memory, AttachSharedFile(descriptor, sizeof(haustra_ring_file), "the pose ring"));
  auto* file = static_cast<haustra_ring_file*>(memory);
  std::unique_ptr<PoseRingWriter> writer(new PoseRingWriter("", -1, file));
  if (file->header.magic != HAUSTRA_RING_MAGIC || file->header.version != HAUSTRA_RING_VERSION) {
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
void PoseRingWriter::SetProcedure(std::uint64_t number) { StoreWord(&file_->header.procedure, number); }

void PoseRingWriter::Beat() { __atomic_store_n(&file_->header.alive_ns, haustra_now_ns(), __ATOMIC_RELEASE); }

void PoseRingWriter::Wipe() {
  WipeSlots(file_->poses);
  WipeSlots(file_->events);
  WipeSlots(file_->snapshots);
}

}  // namespace haustra
