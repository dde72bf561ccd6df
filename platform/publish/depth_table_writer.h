// The writing end of haustra_depth_table.h: keyframes of all maps with their depths. Wait-free, whatever its readers
// do.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "hal/core/status.h"
#include "platform/publish/haustra_depth_table.h"

namespace haustra {

// One writer at a time, the mapping thread of a worker. It may be of another process than the one that made the file,
// as with PoseRingWriter.
class DepthTableWriter {
 public:
  // Takes and touches all its memory, haustra_depth_file_bytes(num_slots), and replaces the file in one step. Of a file
  // that a dead daemon left the contents are wiped. `group`: -1 leaves the caller's. kNotFound: no such folder;
  // kUnavailable: cannot be made.
  static Result<std::unique_ptr<DepthTableWriter>> Create(const std::string& path, mode_t mode, gid_t group,
                                                          std::uint32_t num_slots);
  // Wipes and removes what a dead daemon left, where no file is to be. kUnavailable: it cannot be.
  static Status RemoveFormer(const std::string& path);
  // The same file in another process. `descriptor` stays the caller's. kDataLoss: not such a file; kUnavailable: cannot
  // be mapped.
  static Result<std::unique_ptr<DepthTableWriter>> Attach(int descriptor);

  // Who made the file wipes it and removes the name.
  ~DepthTableWriter();
  DepthTableWriter(const DepthTableWriter&) = delete;
  DepthTableWriter& operator=(const DepthTableWriter&) = delete;

  std::uint32_t num_slots() const { return num_slots_; }

  // Sequences are filled in here. slot < num_slots().
  void PublishCamera(const haustra_depth_camera& camera);
  void PublishKeyframe(std::uint32_t slot, const haustra_depth_keyframe& keyframe);
  // Only the cells that it has are written. Returns its sequence, for the keyframe's record.
  std::uint64_t PublishDepth(std::uint32_t slot, const haustra_depth& depth);
  // The keyframe has gone.
  void Clear(std::uint32_t slot);

  // Forgets all. Only while nobody publishes.
  void Wipe();

  // For Attach; -1: this one is attached.
  int descriptor() const { return descriptor_; }

 private:
  DepthTableWriter(std::string path, int descriptor, void* memory, std::uint32_t num_slots);

  std::uint64_t NextSequence() const { return header_->num_changes + 1; }
  void SetChanged(std::uint64_t sequence);

  std::string path_;  // empty: attached
  int descriptor_;
  std::uint32_t num_slots_;
  haustra_depth_header* header_;
  haustra_depth_camera_slot* camera_;
  haustra_depth_keyframe_slot* keyframes_;
  haustra_depth_slot* depths_;
};

}  // namespace haustra
