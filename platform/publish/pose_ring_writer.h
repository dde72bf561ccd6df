// The writing end of the shared-memory file (haustra_pose_ring.h): wait-free, whatever its readers do.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>

#include "hal/core/status.h"
#include "platform/publish/haustra_pose_ring.h"

namespace haustra {

// Three writers at most at a time, one a kind of record: PublishPose is for the tracking thread, PublishSnapshot for
// the mapping thread, PublishEvent and the rest for the thread that looks after the service. They may be of two
// processes: who makes the file has its header, and the records while no other process works for it. Sequence numbers
// are filled in here. A process that dies in the middle of a record leaves one that no reader takes, and the next
// writer overwrites it.
class PoseRingWriter {
 public:
  // Makes the file in one step: a reader finds the former one or the new one, whole. What a dead daemon left under the
  // name is closed first, so that its readers look again. All its memory is taken and touched here. `group`: -1 leaves
  // the caller's. kNotFound: no such folder; kUnavailable: cannot be made (rights, no room).
  static Result<std::unique_ptr<PoseRingWriter>> Create(const std::string& path, mode_t mode, gid_t group);

  // The same file in another process, for records only. `descriptor` is that of the one who made it, and stays the
  // caller's. kDataLoss: not such a file; kUnavailable: cannot be mapped.
  static Result<std::unique_ptr<PoseRingWriter>> Attach(int descriptor);

  // Who made the file closes it for its readers and removes the name.
  ~PoseRingWriter();
  PoseRingWriter(const PoseRingWriter&) = delete;
  PoseRingWriter& operator=(const PoseRingWriter&) = delete;

  // rt-safe: some twenty stores, and three a mark. `sequence` is ignored.
  void PublishPose(const haustra_pose& pose);
  void PublishEvent(const haustra_event& event);
  // Only the used parts of the lists are written, so the cost follows the map's size.
  void PublishSnapshot(const haustra_snapshot& snapshot);

  void SetService(haustra_service service);
  void SetProcedure(std::uint64_t number);
  // "Still there", every 100 ms.
  void Beat();

  // Forgets every pose, event and snapshot. Only while nobody publishes.
  void Wipe();

  const std::string& path() const { return path_; }
  // For Attach; stays this one's. -1: this one is attached.
  int descriptor() const { return descriptor_; }

 private:
  PoseRingWriter(std::string path, int descriptor, haustra_ring_file* file)
      : path_(std::move(path)), descriptor_(descriptor), file_(file) {}

  std::string path_;  // empty: attached
  int descriptor_;
  haustra_ring_file* file_;
};

}  // namespace haustra
