#include "engine/tracking/flow_chain.h"

#include <cmath>

#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// A chain loses points with every picture, and drifts. What blur takes from sight lasts a few hundred milliseconds.
constexpr double kMaxAgeMs = 1000.0;
// Of living tissue, in a blurred pan, 8 of 2000 are left after half a second.
constexpr int kMinPoints = 8;
// A picture that keeps fewer of the points than this shows another scene, or none: a red-out, water. What seems to be
// left of them is chance. In a blurred pan a picture keeps a third.
constexpr double kMinKeptShare = 0.2;
// A pose is denied when not even this share of the points agrees with it: instruments and bubbles move in ways of their
// own. Of points that the map held at the anchor most have to: instruments are not in the map.
constexpr double kMinAgreeingShare = 0.25;
constexpr double kMinAgreeingMapShare = 0.5;
// Distance from the epipolar plane, radians (Sampson's first order on the sphere). At that share trusted poses had
// 0.006 at most, over seven clips of living tissue and rendered walls, in chains of six frames. The medians of false
// ones were 0.02 to 0.08.
constexpr double kMaxResidual = 0.012;

}  // namespace

void ListFeatures(const LastFrame& frame, std::vector<std::uint8_t>* shows_point, std::vector<std::int32_t>* order) {
  order->clear();
  shows_point->assign(static_cast<std::size_t>(frame.features.num), std::uint8_t{0});
  for (const auto& match : frame.matches) {
    (*shows_point)[match.first] = 1;
    order->push_back(match.first);
  }
  for (int i = 0; i < frame.features.num; ++i) {
    if ((*shows_point)[i] == 0) order->push_back(i);
  }
}

FlowChain::FlowChain(const CameraModel& camera, int max_features) : camera_(camera) {
  const auto num = static_cast<std::size_t>(max_features);
  ReserveTouched(&points_, num);
  ReserveTouched(&anchor_bearings_, num);
  ReserveTouched(&shows_point_, num);
  ReserveTouched(&order_, num);
}

std::size_t FlowChain::BytesFor(int max_features) {
  return static_cast<std::size_t>(max_features) *
         (sizeof(Keypoint) + sizeof(Eigen::Vector3f) + 1 + sizeof(std::int32_t));
}

void FlowChain::Begin(const LastFrame& frame, MapId map_id, const SE3& cam_from_map, TimePoint now) {
  map_id_ = map_id;
  anchor_from_map_ = cam_from_map;
  begun_ = now;
  is_fresh_ = true;
  points_.clear();
  anchor_bearings_.clear();
  ListFeatures(frame, &shows_point_, &order_);
  for (const std::int32_t i : order_) {
    points_.push_back(frame.features.keypoints[i]);
    const std::array<float, 3>& bearing = frame.features.bearings[i];
    anchor_bearings_.emplace_back(bearing[0], bearing[1], bearing[2]);
  }
  num_of_map_ = frame.matches.size();
}

void FlowChain::Break() {
  points_.clear();
  anchor_bearings_.clear();
  num_of_map_ = 0;
  is_fresh_ = false;
}

void FlowChain::Hear(const Reframing& reframing) {
  if (reframing.Carry(&map_id_, &anchor_from_map_) && !reframing.keeps_shape) Break();
}

void FlowChain::Advance(std::span<const FollowedPoint> to) {
  std::size_t num = 0, num_of_map = 0;
  for (std::size_t i = 0; i < points_.size() && i < to.size(); ++i) {
    if (!to[i].is_found) continue;
    if (i < num_of_map_) ++num_of_map;
    points_[num] = points_[i];
    points_[num].x_px = to[i].x_px;
    points_[num].y_px = to[i].y_px;
    anchor_bearings_[num++] = anchor_bearings_[i];
  }
  const bool is_another_scene = static_cast<double>(num) < kMinKeptShare * static_cast<double>(points_.size());
  num_of_map_ = num_of_map;
  points_.resize(num);
  anchor_bearings_.resize(num);
  is_fresh_ = false;
  if (is_another_scene) Break();
}

bool FlowChain::CanJudge(TimePoint now) const {
  return static_cast<int>(points_.size()) >= kMinPoints && AgeMs(now) <= kMaxAgeMs;
}

FlowChain::Witness FlowChain::Judge(MapId map_id, const SE3& cam_from_map, TimePoint now) const {
  if (map_id != map_id_ || !CanJudge(now)) return {};
  const SE3 now_from_anchor = cam_from_map * anchor_from_map_.Inverse();
  const Count of_map = CountAgreeing(now_from_anchor, 0, num_of_map_);
  const Count others = CountAgreeing(now_from_anchor, num_of_map_, points_.size());
  const int num = of_map.num + others.num;
  Witness witness;
  witness.num_for = of_map.num_agreeing + others.num_agreeing;
  witness.num_against = num - witness.num_for;
  witness.denies = of_map.num >= kMinPoints ? of_map.num_agreeing < kMinAgreeingMapShare * of_map.num
                                            : num >= kMinPoints && witness.num_for < kMinAgreeingShare * num;
  return witness;
}

FlowChain::Count FlowChain::CountAgreeing(const SE3& now_from_anchor, std::size_t begin, std::size_t end) const {
  const Eigen::Matrix3d rotation = now_from_anchor.rotation.toRotationMatrix();
  const double length = now_from_anchor.translation.norm();
  // Without travel any direction says the same.
  const Eigen::Vector3d direction =
      length > 0.0 ? Eigen::Vector3d(now_from_anchor.translation / length) : Eigen::Vector3d::UnitZ();
  Count count;
  for (std::size_t i = begin; i < end; ++i) {
    Eigen::Vector3d bearing;
    if (!camera_.Unproject({points_[i].x_px, points_[i].y_px}, &bearing) || anchor_bearings_[i].isZero()) continue;
    const Eigen::Vector3d normal = direction.cross(rotation * anchor_bearings_[i].cast<double>());
    // First order. A point seen along the travel agrees with all of it.
    const double scale2 = normal.squaredNorm() + direction.cross(bearing).squaredNorm();
    ++count.num;
    if (std::abs(bearing.dot(normal)) <= kMaxResidual * std::sqrt(scale2)) ++count.num_agreeing;
  }
  return count;
}

}  // namespace haustra
