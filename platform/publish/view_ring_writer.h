// The writing end of haustra_view_ring.h: small pictures, and where points of the map were found in them. Wait-free,
// whatever its readers do.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "hal/core/status.h"
#include "hal/frame_source.h"
#include "platform/publish/haustra_pose_ring.h"
#include "platform/publish/haustra_view_ring.h"

namespace haustra {

// Two writers at most at a time: PublishPicture is for the capture thread, PublishMatches for the tracking thread. They
// may be of another process than the one that made the file, as with PoseRingWriter.
class ViewRingWriter {
 public:
  // Takes and touches all its memory, sizeof(haustra_view_file), and replaces the file in one step. Of a file that a
  // dead daemon left the contents are wiped. `group`: -1 leaves the caller's. kNotFound: no such folder; kUnavailable:
  // cannot be made.
  static Result<std::unique_ptr<ViewRingWriter>> Create(const std::string& path, mode_t mode, gid_t group);
  // Wipes and removes what a dead daemon left, where no file is to be. kUnavailable: it cannot be.
  static Status RemoveFormer(const std::string& path);
  // The same file in another process. `descriptor` stays the caller's. kDataLoss: not such a file; kUnavailable: cannot
  // be mapped.
  static Result<std::unique_ptr<ViewRingWriter>> Attach(int descriptor);

  // Who made the file wipes it and removes the name.
  ~ViewRingWriter();
  ViewRingWriter(const ViewRingWriter&) = delete;
  ViewRingWriter& operator=(const ViewRingWriter&) = delete;

  // Of YUV pictures the colours by BT.601, as JPEG has them. Reads and stores at most 480x480 pixels.
  void PublishPicture(const Frame& frame, std::uint64_t procedure);
  // rt-safe: at most a thousand stores. num_matched: those that `points` were chosen from.
  void PublishMatches(std::uint64_t frame_index, std::uint64_t procedure, std::span<const haustra_match> points,
                      std::uint32_t num_matched);

  // Forgets all. Only while nobody publishes.
  void Wipe();

  // For Attach; -1: this one is attached.
  int descriptor() const { return descriptor_; }

 private:
  ViewRingWriter(std::string path, int descriptor, haustra_view_file* file);

  std::string path_;  // empty: attached
  int descriptor_;
  haustra_view_file* file_;
  std::unique_ptr<haustra_picture> picture_;  // workspace of the capture thread
};

}  // namespace haustra
