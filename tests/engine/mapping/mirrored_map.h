// A young map that is the mirror of what is seen, and that no bundle mends: a scope far from a shallow wall that tilts
// about its middle. Near is far in it, and a tilt to one side one to the other.
#pragma once

#include <cmath>
#include <vector>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {

class MirroredMap {
 public:
  static constexpr int kNumViews = 7;

  explicit MirroredMap(std::uint64_t seed) : colon(seed) {
    for (int i = 0; i < 800; ++i) {
      const double x = colon.rng().Uniform(-kHalf, kHalf), y = colon.rng().Uniform(-kHalf, kHalf);
      const double relief = std::sin(3.0 * x / kHalf + 1.0) + std::cos((3.0 * y + 2.0 * x) / kHalf);
      colon.AddLandmark({x, y, kDistance + 0.03 * relief});
    }
  }

  // Where the scope truly is in the view of that number; the world is the frame of kStraight.
  static constexpr int kStraight = 5;
  static SE3 View(int i) { return View(i, false); }

  // One keyframe a view, and the points that they show. To be settled by a bundle.
  MapHandle Make(Atlas* atlas) {
    const MapHandle map = atlas->CreateMap();
    for (int i = 0; i < kNumViews; ++i) colon.AddKeyframe(atlas, map, View(i), Sim3());
    colon.AddPoints(atlas, 0, kNumViews, 0.0, [](int, int) { return 0; });
    for (int i = 0; i < kNumViews; ++i) atlas->keyframe(keyframe(i)).cam_from_map = View(i, true);
    std::vector<MapPointHandle> points;
    atlas->points().ForEach([&](MapPointHandle handle, const MapPoint&) { points.push_back(handle); });
    for (const MapPointHandle handle : points) {
      Eigen::Vector3d& position = atlas->point(handle).position;
      position *= (2.0 * kDistance - position.z()) / position.z();
      atlas->UpdatePoint(handle);
    }
    return map;
  }

  KeyframeHandle keyframe(int i) const { return colon.frames()[static_cast<std::size_t>(i)].keyframe; }

  static constexpr double kDistance = 1.0;
  SyntheticColon colon;

 private:
  static constexpr double kHalf = 0.3;  // of the wall

  static SE3 View(int i, bool is_mirrored) {
    const double sign = is_mirrored ? -1.0 : 1.0, around = 0.9 * i, aside = 0.01 * (kStraight - i);
    const Eigen::Vector3d tilt(sign * 0.2 * std::cos(around), sign * 0.2 * std::sin(around) * (1.0 + 0.2 * i),
                               0.02 * i);
    const Eigen::Quaterniond rotation = i == kStraight ? Eigen::Quaterniond::Identity() : ExpSO3(tilt);
    const Eigen::Vector3d middle(0.0, 0.0, kDistance);
    return SE3(rotation, middle - Eigen::Vector3d(2.0 * aside, aside, 0.0) - rotation * middle);
  }
};

}  // namespace haustra::test
