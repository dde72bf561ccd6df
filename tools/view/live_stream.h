// What a running haustrad tells one viewer, from its shared memory (platform/publish/haustra_pose_ring.h), as an event
// stream. The memory is mapped read-only: the engine does not know of viewers, and cannot wait for them.
//
//   fresh    what was shown is of another procedure, or of a service that has gone: forget it
//   service  what the service does: state (word), text (for people), has_engine
//   poses    array, in order: frame, t_s, published_ms after the frame, state, reason, is_predicted, map, epoch,
//            position and orientation (map_from_cam, absent without a pose), features, inliers, and where its map has
//            marks: marks (live_marks.h)
//   events   array, in order: frame, t_s, event, map, other_map, keyframes, points
//   map      the active map, at most once a second: map, procedure, epoch, num_points, num_keyframes, num_maps, and as
//            columns (column.h) points and keyframes (float32 x y z, the oldest keyframe first); marks of all maps
//            (live_marks.h)
//   picture  where haustrad publishes it (publish.view): frame, procedure, width, height, step (it holds every step-th
//            pixel of the frame), jpeg (base64), num_matched, points (x, y in pixels of the picture, one after the
//            other), marks that may be drawn (live_marks.h); as soon as its frame was answered
//   wall     where it publishes depth (publish.depth): what live_surface.h says; an empty object: nothing (any more).
//            Its mesh is the resource wall.ply
// Times count from any moment, lengths are map units.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "platform/publish/haustra_pose_ring.h"
#include "platform/publish/haustra_view_ring.h"
#include "tools/view/live_wall.h"
#include "tools/view/view_server.h"

namespace haustra::view {

class LiveStream final : public ViewStream {
 public:
  // folder: where haustrad keeps its files, with the file "poses". wall: of the same folder; may be null.
  explicit LiveStream(const std::string& folder, std::shared_ptr<const LiveWall> wall = nullptr);
  ~LiveStream() override;
  LiveStream(const LiveStream&) = delete;
  LiveStream& operator=(const LiveStream&) = delete;

  // The first call says whether there is an engine, and what of the last seconds is still there.
  std::string Next() override;

 private:
  void Reopen(std::string* news);
  void TellService(std::string* news);
  bool IsShown(std::uint64_t procedure) const;
  void TellPoses(std::string* news);
  void TellEvents(std::string* news);
  void TellMap(std::string* news);
  void TellPicture(std::string* news);
  void TellWall(std::string* news);
  void Forget(std::string* news);

  std::string path_, view_path_;
  std::shared_ptr<const LiveWall> wall_;
  std::uint64_t told_wall_ = 0;
  haustra_ring ring_{};
  std::string open_error_;
  std::string told_service_;
  bool was_busy_ = false;  // with a procedure
  std::uint64_t procedure_ = 0;
  std::uint64_t pose_cursor_ = 0, event_cursor_ = 0, told_snapshot_ = 0;
  std::int64_t next_map_ns_ = 0;
  std::unique_ptr<haustra_snapshot> snapshot_;
  haustra_view view_{};
  bool has_picture_ = false;  // that was not told: its frame was not answered
  std::uint64_t told_picture_ = 0;
  std::unique_ptr<haustra_picture> picture_;
  std::unique_ptr<haustra_matches> matches_;
};

}  // namespace haustra::view
