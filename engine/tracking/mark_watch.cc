#include "engine/tracking/mark_watch.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// Points that were found this near the mark, in widths of the image, say what is in sight there.
constexpr double kNeighbourWidths = 0.08;
// Where these are too few, so far away there are enough to say that nothing is between.
constexpr double kFarNeighbourWidths = 0.2;
constexpr std::size_t kMaxNeighbours = 8;
constexpr std::size_t kMinNeighbours = 3;
// A neighbour in front is nearer than the mark, and than the wall of the mark would be there, by this factor.
constexpr double kInFrontShare = 0.9;
// The wall curves: how far away its plane is elsewhere is believed within these factors.
constexpr double kMaxPlaneGrowth = 1.5;
// Cosine between the wall's normal and the way to the camera: less is seen from behind. A flat slant hides nothing:
// along a straight lumen the wall ahead is seen so (decisions/2026-12-01-what-shows-a-mark.md).
constexpr double kMinFacing = -0.1;
// The wall is between where at least this share of the neighbours is in front. Found points of the patch itself speak
// against it: the share with none of them, with one, and with more.
constexpr std::array kHiddenShares = {0.2, 0.35, 0.65};
// So many, of those that should have been found at least this share, show the mark whatever is around. Of a patch that
// lies across the edge of a fold a few are found while the mark itself is hidden.
constexpr std::size_t kEnoughOfPatch = 3;
constexpr double kEnoughShare = 0.1;
// Where too few neighbours were found, so many of the patch show it.
constexpr std::size_t kMinOfPatch = 2;
// Points of the patch that should have been found, of which none was.
constexpr int kMinExpected = 12;
constexpr double kMinExpectedCos = 0.5;

}  // namespace

std::string_view ToString(MarkState state) {
  switch (state) {
    case MarkState::kOutOfView: return "out_of_view";
    case MarkState::kInFront: return "in_front";
    case MarkState::kHidden: return "hidden";
    case MarkState::kUnsure: return "unsure";
  }
  return "unknown";
}

MarkWatch::MarkWatch(const CameraModel& camera, const SceneRegion& scene, int max_features)
    : camera_(camera), scene_(scene) {
  ReserveTouched(&found_, static_cast<std::size_t>(max_features));
}

void MarkWatch::Look(const LocalMap& map, const PoseEstimate& estimate) {
  sightings_.Clear();
  // Also without a mark: the first may be set before a frame that is only predicted.
  map_id_ = map.map_id;
  median_depth_ = estimate.median_depth;
  if (map.marks.empty()) return;
  found_.clear();
  for (const PointMatch& match : estimate.matches) {
    Found found;
    found.point_in_cam = estimate.cam_from_map * map.points[static_cast<std::size_t>(match.point_idx)].position;
    found.distance = found.point_in_cam.norm();
    if (camera_.Project(found.point_in_cam, &found.pixel)) found_.push_back(found);
  }
  for (const LocalMark& mark : map.marks) {
    MarkSighting sighting = Place(mark, estimate.cam_from_map);
    if (sighting.state != MarkState::kOutOfView) {
      sighting.state = Judge(map, mark, sighting, estimate.cam_from_map);
    }
    (void)sightings_.PushBack(sighting);  // there is room for all marks of a map
  }
}

void MarkWatch::LookAhead(const LocalMap& map, const SE3& cam_from_map) {
  sightings_.Clear();
  for (const LocalMark& mark : map.marks) (void)sightings_.PushBack(Place(mark, cam_from_map));
}

void MarkWatch::Hear(const Reframing& reframing) {
  if (map_id_ != reframing.old_map_id) return;
  map_id_ = reframing.new_map_id;
  median_depth_ *= reframing.new_from_old.scale;
}

MarkSighting MarkWatch::Place(const LocalMark& mark, const SE3& cam_from_map) const {
  const Eigen::Vector3d point_in_cam = cam_from_map * mark.position;
  MarkSighting sighting;
  sighting.id = mark.id;
  sighting.distance_in_depths = static_cast<float>(point_in_cam.norm() / median_depth_);
  Eigen::Vector2d pixel;
  if (!camera_.Project(point_in_cam, &pixel) || !scene_.Shows(pixel)) return sighting;
  sighting.state = MarkState::kUnsure;
  sighting.u_px = static_cast<float>(pixel.x());
  sighting.v_px = static_cast<float>(pixel.y());
  return sighting;
}

MarkState MarkWatch::Judge(const LocalMap& map, const LocalMark& mark, const MarkSighting& sighting,
                           const SE3& cam_from_map) const {
  const Eigen::Vector3d point_in_cam = cam_from_map * mark.position;
  const Eigen::Vector3d normal_in_cam = cam_from_map.rotation * mark.normal;
  const double distance = point_in_cam.norm();
  if (-normal_in_cam.dot(point_in_cam) < kMinFacing * distance) return MarkState::kHidden;

  struct Neighbour {
    double offset2_px = 0.0;
    bool is_in_front = false;
  };
  FixedVector<Neighbour, kMaxNeighbours> nearest;  // in order
  const Eigen::Vector2d pixel(sighting.u_px, sighting.v_px);
  const double near_px = kNeighbourWidths * camera_.width_px(), reach_px = kFarNeighbourWidths * camera_.width_px();
  const double plane_offset = normal_in_cam.dot(point_in_cam);
  std::size_t num_of_patch = 0;
  for (const Found& found : found_) {
    num_of_patch += (found.point_in_cam - point_in_cam).squaredNorm() <= mark.radius * mark.radius;
    const double offset2_px = (found.pixel - pixel).squaredNorm();
    if (offset2_px > reach_px * reach_px) continue;
    if (nearest.full() && offset2_px >= nearest[kMaxNeighbours - 1].offset2_px) continue;
    // Where the plane of the patch would be on the ray of the neighbour.
    const double across = normal_in_cam.dot(found.point_in_cam) / found.distance;
    const double on_plane = across < 0.0 && plane_offset < 0.0 ? plane_offset / across : distance;
    const double wall = std::clamp(on_plane, distance / kMaxPlaneGrowth, distance * kMaxPlaneGrowth);
    const Neighbour neighbour{offset2_px, found.distance < kInFrontShare * std::min(wall, distance)};
    if (!nearest.full()) (void)nearest.PushBack(neighbour);
    std::size_t at = nearest.size() - 1;
    for (; at > 0 && nearest[at - 1].offset2_px > offset2_px; --at) nearest[at] = nearest[at - 1];
    nearest[at] = neighbour;
  }
  std::size_t num_near = 0, num_in_front = 0, num_far_in_front = 0;
  for (const Neighbour& neighbour : nearest) {
    const bool is_near = neighbour.offset2_px <= near_px * near_px;
    num_near += is_near;
    (is_near ? num_in_front : num_far_in_front) += neighbour.is_in_front;
  }
  // A mark that is drawn on the fold before it is worse than one that is left out at the fold's edge.
  const bool is_judged_near = num_near >= kMinNeighbours;
  const double hidden_share = kHiddenShares[std::min(num_of_patch, kHiddenShares.size() - 1)];
  if (is_judged_near && static_cast<double>(num_in_front) >= hidden_share * static_cast<double>(num_near)) {
    const bool is_shown = num_of_patch >= kEnoughOfPatch &&
                          static_cast<double>(num_of_patch) >= kEnoughShare * NumExpected(map, mark, cam_from_map);
    return is_shown ? MarkState::kInFront : MarkState::kHidden;
  }
  if (num_of_patch == 0 && NumExpected(map, mark, cam_from_map) >= kMinExpected) return MarkState::kHidden;
  if (is_judged_near || num_of_patch >= kMinOfPatch) return MarkState::kInFront;
  const bool is_clear = nearest.size() >= kMinNeighbours && num_in_front + num_far_in_front == 0;
  return is_clear ? MarkState::kInFront : MarkState::kUnsure;
}

// Points of the patch that a frame of this pose should show if nothing is between.
int MarkWatch::NumExpected(const LocalMap& map, const LocalMark& mark, const SE3& cam_from_map) const {
  const Eigen::Vector3d centre = cam_from_map.InverseTranslation();
  int num = 0;
  for (int i = 0; i < map.num_points; ++i) {
    const LocalPoint& point = map.points[static_cast<std::size_t>(i)];
    if ((point.position - mark.position).squaredNorm() > mark.radius * mark.radius) continue;
    const Eigen::Vector3d to_camera = centre - point.position;
    if (point.normal.dot(to_camera) < kMinExpectedCos * to_camera.norm()) continue;
    Eigen::Vector2d pixel;
    num += camera_.Project(cam_from_map * point.position, &pixel) && scene_.Shows(pixel);
  }
  return num;
}

}  // namespace haustra
