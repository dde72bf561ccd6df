// What is asked of a guided search: where in a view a map point should be seen, how far around and at which size. One
// place for what tracking, mapping, place recognition and merging search by. Plain computation, reentrant, rt-safe.
#pragma once

#include <cmath>

#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/constants.h"
#include "engine/geometry/se3.h"
#include "engine/noise_model.h"
#include "hal/vision_device.h"

namespace haustra {

class ViewQueries {
 public:
  // The view whose pose is known or guessed; all of them outlive this.
  ViewQueries(const MatchingConfig& matching, const CameraModel& camera, const NoiseModel& noise,
              const SE3& cam_from_map)
      : camera_(camera),
        noise_(noise),
        cam_from_map_(cam_from_map),
        centre_(cam_from_map.InverseTranslation()),
        min_cos_(std::cos(matching.max_view_angle_deg * kDegree)),
        tolerance_(matching.scale_tolerance) {}

  // A point with `position`, `normal`, `scale_times_distance` and `descriptor`, all in the view's map: searched as far
  // as its noise reaches, at the size that its distance gives it. False: the view should not show it, for it lies
  // outside the picture or is seen too obliquely. `scale_px`: the expected size.
  template <typename Point>
  bool OfPoint(const Point& point, GuidedQuery* query, double* scale_px) const {
    const Eigen::Vector3d to_camera = centre_ - point.position;
    const double distance = to_camera.norm();
    if (distance <= 0.0 || point.normal.dot(to_camera) < min_cos_ * distance) return false;
    Eigen::Vector2d pixel;
    if (!IsInPicture(point.position, &pixel)) return false;
    const double scale = point.scale_times_distance / distance;
    *query = {point.descriptor,
              static_cast<float>(pixel.x()),
              static_cast<float>(pixel.y()),
              static_cast<float>(std::sqrt(kChi2TwoDof) * noise_.SigmaPx(scale)),
              static_cast<float>(scale / tolerance_),
              static_cast<float>(scale * tolerance_)};
    *scale_px = scale;
    return true;
  }
  template <typename Point>
  bool OfPoint(const Point& point, GuidedQuery* query) const {
    double scale_px;
    return OfPoint(point, query, &scale_px);
  }

  // What a feature of a view from nearby shows: it looks the same and has the same size. False: outside the picture.
  bool OfFeature(const Eigen::Vector3d& position_in_map, DescriptorRef descriptor, float scale_px, double radius_px,
                 GuidedQuery* query) const {
    Eigen::Vector2d pixel;
    if (!IsInPicture(position_in_map, &pixel)) return false;
    const auto tolerance = static_cast<float>(tolerance_);
    *query = {descriptor,
              static_cast<float>(pixel.x()),
              static_cast<float>(pixel.y()),
              static_cast<float>(radius_px),
              scale_px / tolerance,
              scale_px * tolerance};
    return true;
  }

 private:
  bool IsInPicture(const Eigen::Vector3d& position, Eigen::Vector2d* pixel) const {
    return camera_.Project(cam_from_map_ * position, pixel) && camera_.IsInImage(*pixel);
  }

  const CameraModel& camera_;
  const NoiseModel& noise_;
  const SE3 cam_from_map_;
  const Eigen::Vector3d centre_;
  const double min_cos_;
  const double tolerance_;
};

// How its answers are judged: by similarity, and by how much better than the next one.
inline MatchOptions GuidedOptions(const MatchingConfig& matching) {
  return {static_cast<float>(matching.min_similarity), static_cast<float>(matching.guided_ratio), false};
}

}  // namespace haustra
