// Which view of a point with a full list of observations is given up for another one. reentrant, allocates nothing.
#pragma once

#include <Eigen/Core>
#include <span>

#include "engine/atlas/handles.h"

namespace haustra {

struct PointView {
  KeyframeId keyframe = kNoId;                       // each at most once
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // of the camera, map frame
  double scale_px = 0.0;                             // of the keypoint
};

// So many of the youngest views are never given up: they connect the newest keyframes with each other and with the
// tracker, and they show the point as it looks now.
inline constexpr int kRecentViews = 10;
inline constexpr int kMaxViewsChosenFrom = 64;

// Index of the view that is worth least. The two views that differ least in direction say the same about where the
// point is, so one of them goes: the one that is not recent; of two old ones the one that resolves less of the wall
// (scale times distance), of equals the older. That way the widest baselines stay. The last view is the one that is
// offered. An old one that is offered is turned down when it is one of these two: one that was given up does not come
// back, and offering old views again and again comes to rest. kRecentViews < views.size() <= kMaxViewsChosenFrom.
int LeastWorthyView(std::span<const PointView> views, const Eigen::Vector3d& position);

}  // namespace haustra
