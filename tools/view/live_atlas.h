// What a running engine knows of the wall, copied out of its shared memory (haustra_depth_table.h): the camera, the
// keyframes of all maps with their depths, and where the scope looked from between them. The shared memory says only
// where the newest frames stood; here they stay, tied to keyframes, so that they move with bundles and joins.
// thread-bound(its owner). Allocates.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/geometry/se3.h"
#include "platform/publish/haustra_depth_table.h"
#include "platform/publish/haustra_pose_ring.h"

namespace haustra::view {

struct LiveKeyframe {
  haustra_depth_keyframe record{};
  SE3 map_from_cam;
  std::shared_ptr<const haustra_depth> depth;  // null: it has none yet
};

// A frame that was no keyframe, beside one.
struct LiveFrame {
  std::int64_t source_ns = 0;
  std::uint32_t keyframe_id = 0;
  SE3 keyframe_from_cam;
  double scale = 1.0;  // haustra_depth_keyframe.scale of the keyframe, in whose unit the translation is
};

// At one moment. Depths are shared, so that a copy is small.
struct LiveMaps {
  // Nothing: there is no engine that publishes depth, or no procedure.
  std::optional<haustra_depth_camera> camera;
  std::map<std::uint32_t, LiveKeyframe> keyframes;  // by id
  // Twice a second one, as long as its map lasts; in order of time.
  std::vector<LiveFrame> frames;
  // Of the newest frame that had a pose; HAUSTRA_NO_MAP: none had.
  std::uint32_t map_id = HAUSTRA_NO_MAP;
  std::uint64_t map_epoch = 0;
  std::int64_t captured_ns = 0;
  SE3 map_from_cam;

  // Where one of `frames` stands now; nothing without its keyframe.
  std::optional<SE3> MapFromCam(const LiveFrame& frame) const;
};

class LiveAtlas {
 public:
  // folder: where haustrad keeps its files, with the files "poses" and "depth".
  explicit LiveAtlas(const std::string& folder);
  ~LiveAtlas();
  LiveAtlas(const LiveAtlas&) = delete;
  LiveAtlas& operator=(const LiveAtlas&) = delete;

  // Takes what has come. False: nothing has changed but the scope's place. To be called several times a second, so that
  // no pose is missed.
  bool Update();

  const LiveMaps& maps() const { return maps_; }

 private:
  bool Open();
  void Forget();
  bool ReadTable();
  std::shared_ptr<const haustra_depth> DepthOf(std::uint32_t slot, const haustra_depth_keyframe& keyframe) const;
  void KeepFramesOf(const std::map<std::uint32_t, LiveKeyframe>& next);
  bool ReadPoses();
  const LiveKeyframe* Anchor(std::uint32_t map_id, std::int64_t source_ns) const;

  std::string poses_path_, depth_path_;
  haustra_ring ring_{};
  haustra_depth_table table_{};
  std::uint64_t pose_cursor_ = 0;
  std::uint64_t changes_ = 0;  // of the table, as read
  LiveMaps maps_;
};

}  // namespace haustra::view
