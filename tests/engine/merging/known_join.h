// Maps that are to be joined, with the plan that geometry makes of what is known about them: a loop whose frame drifts
// on the way out and back, or two maps that share a stretch of wall. Keyframes can be added while the join goes on.
#pragma once

#include <map>
#include <utility>

#include "engine/merging/merge_plan.h"
#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {

struct KnownJoin {
  KnownJoin(std::uint64_t seed, int max_keyframes) : colon(seed, max_keyframes), atlas(colon.MakeAtlas()) {}

  SyntheticColon colon;
  Atlas atlas;
  MergePlan plan;
  int frame_a = 0;  // of the plan, as indices of colon.frames()
  int frame_b = 0;

  const SyntheticColon::Frame& frame(int i) const { return colon.frames()[static_cast<std::size_t>(i)]; }

  // The similarity between two keyframes, and the landmarks that a point of each shows.
  void PlanBetween(int a, int b) {
    frame_a = a;
    frame_b = b;
    const auto anchor = [&](KeyframeHandle keyframe) {
      return KeyframeAnchor{atlas.keyframe(keyframe).cam_from_map, atlas.KeyframeScale(keyframe)};
    };
    plan.keyframe_a = frame(a).keyframe;
    plan.keyframe_b = frame(b).keyframe;
    plan.anchor_a = anchor(plan.keyframe_a);
    plan.anchor_b = anchor(plan.keyframe_b);
    plan.b_from_a = frame(b).map_from_world * frame(a).map_from_world.Inverse();
    std::map<int, MapPointHandle> points_b;
    for (std::size_t i = 0; i < frame(b).landmarks.size(); ++i) {
      points_b[frame(b).landmarks[i]] = atlas.keyframe(plan.keyframe_b).points[i];
    }
    for (std::size_t i = 0; i < frame(a).landmarks.size(); ++i) {
      const auto found = points_b.find(frame(a).landmarks[i]);
      const MapPointHandle point_a = atlas.keyframe(plan.keyframe_a).points[i];
      if (found == points_b.end() || !point_a || !found->second || point_a == found->second) continue;
      plan.points.push_back({point_a, found->second});
    }
  }

  // Where the map believes the world to be, around a keyframe as it stands now.
  Sim3 MapFromWorldAt(int i) const {
    const double unit = frame(i).map_from_world.scale * atlas.KeyframeScale(frame(i).keyframe);
    const Sim3 grown(unit, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
    return Sim3(atlas.keyframe(frame(i).keyframe).cam_from_map).Inverse() * grown * Sim3(frame(i).cam_from_world);
  }

  // A new keyframe a step further from another one, as mapping inserts it. Its index.
  int InsertBeside(int i, double step) {
    const Sim3 map_from_world = MapFromWorldAt(i);
    const SE3 view = colon.ViewFrom(frame(i).cam_from_world.InverseTranslation().z() + step);
    const int added = static_cast<int>(colon.frames().size());
    colon.AddKeyframe(&atlas, atlas.keyframe(frame(i).keyframe).map, view, map_from_world);
    colon.Link(&atlas, added, i, map_from_world);
    return added;
  }

  // How far the two keyframes are from where they truly are beside each other, over the world's unit.
  double RelativeError(int i, int j) const {
    const SE3 now =
        atlas.keyframe(frame(i).keyframe).cam_from_map * atlas.keyframe(frame(j).keyframe).cam_from_map.Inverse();
    const SE3 truth = frame(i).cam_from_world * frame(j).cam_from_world.Inverse();
    return (now.InverseTranslation() / MapFromWorldAt(j).scale - truth.InverseTranslation()).norm();
  }
};

struct LoopShape {
  int num_keyframes = 60;  // half of them out, half back
  double step = 0.18;      // between two of them; the tube has radius 1
  double landmarks_per_length = 400.0;
  Sim3 drift{1.004, ExpSO3({0.002, -0.001, 0.001}), {0.002, 0.001, -0.002}};  // from one keyframe to the next
};

// The way back makes points of its own, so the last keyframe but one stands where the second stood, and only the plan
// knows.
inline void MakeLoop(const LoopShape& shape, KnownJoin* join) {
  const int turn = shape.num_keyframes / 2;
  const double length = shape.step * turn + 4.0;
  SyntheticColon& colon = join->colon;
  colon.AddWall(0.0, length, static_cast<int>(shape.landmarks_per_length * length));
  const MapHandle map = join->atlas.CreateMap();
  Sim3 drifted_from_world;
  for (int i = 0; i < 2 * turn; ++i) {
    const SE3 view = colon.ViewFrom(i < turn ? shape.step * i : shape.step * (2 * turn - 1 - i) + 0.05);
    colon.AddKeyframe(&join->atlas, map, view, drifted_from_world);
    // Grows, turns and slips about the camera, as drift does.
    const Sim3 to_camera(1.0, Eigen::Quaterniond::Identity(), -(drifted_from_world * view.InverseTranslation()));
    drifted_from_world = to_camera.Inverse() * shape.drift * to_camera * drifted_from_world;
  }
  colon.AddPoints(&join->atlas, 0, 2 * turn, 0.003, [turn](int frame, int landmark) {
    const bool still_outbound = frame < turn || (frame < turn + 6 && landmark % 2 == 0);
    return still_outbound ? 0 : 1;
  });
  join->PlanBetween(2 * turn - 2, 1);
}

// Two maps, the second from 1 before the end of the first, whose third keyframe shows what the first one holds.
inline void MakeTwoMaps(int num_older, int num_younger, double step, const Sim3& older_from_world,
                        const Sim3& younger_from_world, KnownJoin* join) {
  const double older_end = step * num_older, younger_end = older_end - 1.0 + step * num_younger;
  join->colon.AddWall(0.0, younger_end + 4.0, static_cast<int>(350.0 * (younger_end + 4.0)));
  join->colon.AddMap(&join->atlas, 0.0, older_end, num_older, older_from_world);
  const int first =
      join->colon.AddMap(&join->atlas, older_end - 1.0, younger_end, num_younger, younger_from_world).first;
  join->PlanBetween(first + 2, num_older - 3);
}

}  // namespace haustra::test
