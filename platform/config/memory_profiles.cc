#include "platform/config/memory_profiles.h"

namespace haustra {
namespace {

struct Profile {
  std::string_view name;
  std::string_view text;
};

constexpr Profile kProfiles[] = {
    {"small", R"(# A board of 4 GB that it shares with the tower's own software; one examination of a part of the colon.
memory:
  max_keyframes: 600        # the paper's whole procedure needs 1 196; what does not fit makes room (engine/mapping/evictor.h)
  max_map_points: 72000     # 120 a keyframe, as in medium
  max_maps: 128
  max_keyframe_ids: 20000   # 2 hours at the 2.5 keyframes a second that are made at 25 Hz
  max_local_points: 6000
  max_proposals: 3
  spare_feature_sets: 32
  max_map_events: 512
  max_late_poses: 512
  max_marks: 32             # of a doctor; a place each
  small_map_keyframes: 6
  max_host_mb: 1100         # 1030 at 1920x1080 on the CPU device
  max_device_mb: 600        # 534 at 1920x1080: the workspaces of extraction do not shrink with the map
)"},
    {"medium", R"(# A Jetson of 8 GB and more: a full procedure of 22 minutes with room to spare.
memory:
  max_keyframes: 1500       # the paper's whole procedure: 1 196
  max_map_points: 180000    # the paper's whole procedure: 129 538
  max_maps: 256             # one begun every 5 seconds of a full procedure; entries of maps that have gone are used again
  max_keyframe_ids: 40000   # 4 hours at 2.5 keyframes a second
  max_local_points: 8000    # 64 keyframes of a window see no more
  max_proposals: 3          # more would be stale work
  spare_feature_sets: 32
  max_map_events: 1024      # the session reads them every 10 ms
  max_late_poses: 1024
  max_marks: 32             # of a doctor; a place each
  small_map_keyframes: 8    # such a map has rarely 200 frames
  max_host_mb: 1800         # 1570 at 1920x1080 on the CPU device
  max_device_mb: 1000
)"},
    {"large", R"(# A workstation: hours of video, several procedures in one atlas.
memory:
  max_keyframes: 6000
  max_map_points: 720000    # 120 a keyframe, as in medium
  max_maps: 1024
  max_keyframe_ids: 400000  # 44 hours at 2.5 keyframes a second
  max_local_points: 12000
  max_proposals: 3
  spare_feature_sets: 64
  max_map_events: 4096
  max_late_poses: 4096
  max_marks: 32             # of a doctor; a place each
  small_map_keyframes: 8
  max_host_mb: 6000
  max_device_mb: 4000
)"},
};

}  // namespace

std::vector<std::string> MemoryProfileNames() {
  std::vector<std::string> names;
  for (const Profile& profile : kProfiles) names.emplace_back(profile.name);
  return names;
}

std::string_view MemoryProfileText(std::string_view name) {
  for (const Profile& profile : kProfiles) {
    if (profile.name == name) return profile.text;
  }
  return {};
}

}  // namespace haustra
