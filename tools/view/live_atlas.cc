#include "tools/view/live_atlas.h"

#include <cstdlib>
#include <utility>

namespace haustra::view {
namespace {

// Between two frames that are kept: the scope moves on by a fraction of what it sees.
constexpr std::int64_t kFrameInterval_ns = 500'000'000;
// Of more, an hour of them, every other one is given up.
constexpr std::size_t kMaxFrames = 8192;

SE3 PoseOf(const double (&orientation_xyzw)[4], const double (&position_mu)[3]) {
  return SE3(Eigen::Quaterniond(Eigen::Map<const Eigen::Vector4d>(orientation_xyzw)),
             Eigen::Map<const Eigen::Vector3d>(position_mu));
}

// Beside a keyframe that the frame is not tied to yet.
LiveFrame Tie(std::int64_t source_ns, const SE3& map_from_cam, const LiveKeyframe& keyframe) {
  return {source_ns, keyframe.record.keyframe_id, keyframe.map_from_cam.Inverse() * map_from_cam,
          keyframe.record.scale};
}

std::optional<SE3> PoseIn(const std::map<std::uint32_t, LiveKeyframe>& keyframes, const LiveFrame& frame) {
  const auto keyframe = keyframes.find(frame.keyframe_id);
  if (keyframe == keyframes.end()) return std::nullopt;
  SE3 keyframe_from_cam = frame.keyframe_from_cam;
  keyframe_from_cam.translation *= keyframe->second.record.scale / frame.scale;
  return keyframe->second.map_from_cam * keyframe_from_cam;
}

}  // namespace

LiveAtlas::LiveAtlas(const std::string& folder) : poses_path_(folder + "/poses"), depth_path_(folder + "/depth") {}

LiveAtlas::~LiveAtlas() {
  haustra_ring_close(&ring_);
  haustra_depth_close(&table_);
}

std::optional<SE3> LiveMaps::MapFromCam(const LiveFrame& frame) const { return PoseIn(keyframes, frame); }

bool LiveAtlas::Update() {
  if (!Open()) {
    const bool has_forgotten = maps_.camera.has_value();
    if (has_forgotten) Forget();
    return has_forgotten;
  }
  const bool is_new = ReadTable();
  return ReadPoses() || is_new;
}

void LiveAtlas::Forget() {
  maps_ = LiveMaps{};
  changes_ = 0;
}

bool LiveAtlas::Open() {
  if (table_.header != nullptr && haustra_depth_is_replaced(&table_, depth_path_.c_str()) != 0) {
    haustra_depth_close(&table_);
  }
  if (ring_.file != nullptr && haustra_ring_is_replaced(&ring_, poses_path_.c_str()) != 0) haustra_ring_close(&ring_);
  if (table_.header == nullptr && haustra_depth_open(&table_, depth_path_.c_str()) == HAUSTRA_OK) Forget();
  if (ring_.file == nullptr && haustra_ring_open(&ring_, poses_path_.c_str()) == HAUSTRA_OK) pose_cursor_ = 0;
  return table_.header != nullptr && ring_.file != nullptr;
}

bool LiveAtlas::ReadTable() {
  const std::uint64_t changes = haustra_depth_num_changes(&table_);
  if (changes == changes_) return false;
  haustra_depth_camera camera;
  const int result = haustra_depth_read_camera(&table_, &camera);
  if (result == HAUSTRA_BUSY) return false;
  if (result != HAUSTRA_OK || (maps_.camera && maps_.camera->procedure != camera.procedure)) Forget();
  changes_ = changes;
  if (result != HAUSTRA_OK) return true;
  maps_.camera = camera;
  std::map<std::uint32_t, LiveKeyframe> next;
  for (std::uint32_t slot = 0; slot < table_.num_slots; ++slot) {
    LiveKeyframe keyframe;
    if (haustra_depth_read_keyframe(&table_, slot, &keyframe.record) != HAUSTRA_OK) continue;
    if (keyframe.record.procedure != camera.procedure) continue;
    keyframe.map_from_cam = PoseOf(keyframe.record.orientation_xyzw, keyframe.record.position_mu);
    keyframe.depth = DepthOf(slot, keyframe.record);
    next.emplace(keyframe.record.keyframe_id, std::move(keyframe));
  }
  KeepFramesOf(next);
  maps_.keyframes = std::move(next);
  return true;
}

// It is read once. Null: there is none, or another one by now, which the next look finds.
std::shared_ptr<const haustra_depth> LiveAtlas::DepthOf(std::uint32_t slot,
                                                        const haustra_depth_keyframe& keyframe) const {
  if (keyframe.depth == 0) return nullptr;
  const auto known = maps_.keyframes.find(keyframe.keyframe_id);
  if (known != maps_.keyframes.end() && known->second.record.depth == keyframe.depth && known->second.depth) {
    return known->second.depth;
  }
  auto depth = std::make_shared<haustra_depth>();
  return haustra_depth_read(&table_, slot, keyframe.depth, depth.get()) == HAUSTRA_OK ? depth : nullptr;
}

// Frames of keyframes that have gone are tied to their neighbours, where these stood beside them last.
void LiveAtlas::KeepFramesOf(const std::map<std::uint32_t, LiveKeyframe>& next) {
  std::vector<LiveFrame> kept;
  for (const LiveFrame& frame : maps_.frames) {
    if (next.contains(frame.keyframe_id)) {
      kept.push_back(frame);
      continue;
    }
    const std::optional<SE3> map_from_cam = PoseIn(maps_.keyframes, frame);
    if (!map_from_cam) continue;
    const std::uint32_t map_id = maps_.keyframes.at(frame.keyframe_id).record.map_id;
    const LiveKeyframe* nearest = nullptr;
    for (const auto& [id, keyframe] : maps_.keyframes) {
      if (keyframe.record.map_id != map_id || !next.contains(id)) continue;
      const auto age = [&](const LiveKeyframe& k) { return std::abs(k.record.source_ns - frame.source_ns); };
      if (nearest == nullptr || age(keyframe) < age(*nearest)) nearest = &keyframe;
    }
    if (nearest != nullptr) kept.push_back(Tie(frame.source_ns, *map_from_cam, *nearest));
  }
  maps_.frames = std::move(kept);
}

// The keyframe of the map that is nearest in time.
const LiveKeyframe* LiveAtlas::Anchor(std::uint32_t map_id, std::int64_t source_ns) const {
  const LiveKeyframe* nearest = nullptr;
  for (const auto& [id, keyframe] : maps_.keyframes) {
    if (keyframe.record.map_id != map_id || keyframe.record.is_of_this_run == 0) continue;
    const auto age = [&](const LiveKeyframe& k) { return std::abs(k.record.source_ns - source_ns); };
    if (nearest == nullptr || age(keyframe) < age(*nearest)) nearest = &keyframe;
  }
  return nearest;
}

bool LiveAtlas::ReadPoses() {
  bool has_frame = false;
  haustra_pose pose;
  std::uint64_t num_missed = 0;
  while (haustra_ring_next_pose(&ring_, &pose_cursor_, &pose, &num_missed) == HAUSTRA_OK) {
    if (!maps_.camera || pose.procedure != maps_.camera->procedure) continue;
    if ((pose.flags & HAUSTRA_POSE_VALID) == 0 || (pose.flags & HAUSTRA_POSE_PREDICTED) != 0) continue;
    maps_.map_id = pose.map_id;
    maps_.map_epoch = pose.map_epoch;
    maps_.captured_ns = pose.captured_ns;
    maps_.map_from_cam = PoseOf(pose.orientation_xyzw, pose.position_mu);
    if (!maps_.frames.empty() && pose.source_ns - maps_.frames.back().source_ns < kFrameInterval_ns) continue;
    // Of another epoch: the table comes a little later than the pose.
    const LiveKeyframe* anchor = Anchor(pose.map_id, pose.source_ns);
    if (anchor == nullptr || anchor->record.map_epoch != pose.map_epoch) continue;
    if (maps_.frames.size() >= kMaxFrames) {
      for (std::size_t i = 0; i < maps_.frames.size() / 2; ++i) maps_.frames[i] = maps_.frames[2 * i];
      maps_.frames.resize(maps_.frames.size() / 2);
    }
    maps_.frames.push_back(Tie(pose.source_ns, maps_.map_from_cam, *anchor));
    has_frame = true;
  }
  return has_frame;
}

}  // namespace haustra::view
