#include "tools/run/final_poses.h"

#include <utility>

namespace haustra {

void FollowAdjusted(const std::map<std::size_t, SE3>& adjusted, const std::vector<bool>& starts,
                    std::vector<FinalPose>* poses) {
  const auto continues = [&](std::size_t i) {
    const FinalPose& before = (*poses)[i - 1];
    const FinalPose& now = (*poses)[i];
    return !starts[i] && before.is_localised && now.is_localised && before.pose.map_id == now.pose.map_id;
  };
  auto next = adjusted.begin();
  for (std::size_t begin = 0, end = 0; begin < poses->size(); begin = end) {
    for (end = begin + 1; end < poses->size() && continues(end);) ++end;
    // What the adjustment changed, seen from the camera: tangents of adjusted_cam_from_answered_cam.
    std::vector<std::pair<std::size_t, Vector6d>> corrections;
    for (; next != adjusted.end() && next->first < end; ++next) {
      const SE3& answered = (*poses)[next->first].pose.cam_from_map;
      corrections.emplace_back(next->first, (next->second * answered.Inverse()).Log());
    }
    if (corrections.empty()) continue;
    auto after = corrections.begin();
    for (std::size_t i = begin; i < end; ++i) {
      while (after != corrections.end() && after->first < i) ++after;
      const auto before = after == corrections.begin() ? after : after - 1;
      const auto last = after == corrections.end() ? before : after;
      const double share =
          before == last ? 0.0
                         : static_cast<double>(i - before->first) / static_cast<double>(last->first - before->first);
      const Vector6d correction = (1.0 - share) * before->second + share * last->second;
      SE3& pose = (*poses)[i].pose.cam_from_map;
      pose = SE3::Exp(correction) * pose;
    }
  }
}

std::vector<FinalPose> ResolveAll(const RunRecord& record, const Engine& engine) {
  const std::vector<FrameOutcome>& frames = record.frames();
  std::vector<FinalPose> poses(frames.size());
  std::vector<bool> starts(frames.size(), false);
  std::map<std::uint32_t, std::size_t> position;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const FrameResult& result = frames[i].result;
    position[result.frame_index] = i;
    starts[i] = result.reason == TrackingReason::kRelocalised;
    poses[i].is_localised = engine.Resolve(result, &poses[i].pose);
    if (poses[i].is_localised) poses[i].keyframe = result.reference_keyframe;
  }
  const Atlas& atlas = engine.atlas();
  std::map<std::size_t, SE3> adjusted;  // by frame
  for (KeyframeId id = 0; id < atlas.num_keyframe_ids(); ++id) {
    if (!atlas.IsOfThisSession(id)) continue;
    const auto it = position.find(atlas.FrameOfKeyframe(id));
    ResolvedPose own;
    if (it == position.end() || !atlas.Resolve(id, SE3{}, atlas.ScaleOfKeyframe(id), &own)) continue;
    FinalPose& answered = poses[it->second];
    if (!answered.is_localised) answered = {true, own, id};
    if (answered.pose.map_id == own.map_id) adjusted[it->second] = own.cam_from_map;
  }
  FollowAdjusted(adjusted, starts, &poses);
  return poses;
}

}  // namespace haustra
