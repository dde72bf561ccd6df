#include "engine/mapping/mark_keeper.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace haustra {
namespace {

// A keyframe that a mark was handed to may see a fold before it. A wall that lies this way may be the same one.
constexpr double kMinNormalCos = 0.7;
// A mark costs a look at all points of a keyframe.
constexpr int kRefinedPerKeyframe = 4;

PlacedMark PlaceOn(const FittedWall& patch, const Eigen::Vector3d& ray, const SE3& cam_from_map, MapHandle map) {
  const SE3 map_from_cam = cam_from_map.Inverse();
  PlacedMark place;
  place.map = map;
  place.position = map_from_cam * (patch.distance * ray);
  place.normal = (map_from_cam.rotation * patch.normal_in_cam).normalized();
  place.radius = patch.radius;
  return place;
}

}  // namespace

void MarkKeeper::BeginSession() {
  HearTracker();
  num_frames_ = 0;
  newest_number_ = state_.link.num_answered.load(std::memory_order_acquire);
  is_newest_known_ = true;
}

void MarkKeeper::HearTracker() {
  // Read before the ring: all of these are in it by now, or were left out. Newer ones may come meanwhile.
  const std::uint64_t num_answered = state_.link.num_answered.load(std::memory_order_acquire);
  for (AnsweredFrame frame; state_.link.answers.TryPop(&frame);) {
    newest_number_ = frame.number;
    frames_[num_frames_++ % kKeptAnswers] = frame;
  }
  is_newest_known_ = newest_number_ >= num_answered;
}

const AnsweredFrame* MarkKeeper::Find(std::uint32_t frame_index) const {
  for (std::uint64_t back = 1; back <= std::min<std::uint64_t>(num_frames_, kKeptAnswers); ++back) {
    const AnsweredFrame& frame = frames_[(num_frames_ - back) % kKeptAnswers];
    if (frame_index == kNewestFrame || frame.frame_index == frame_index) return &frame;
  }
  return nullptr;
}

// Of a frame that is not remembered.
std::string MarkKeeper::WhyUnknown(std::uint32_t frame_index) const {
  const std::string name = "frame " + std::to_string(frame_index);
  const AnsweredFrame* after = nullptr;
  for (std::uint64_t back = 1; back <= std::min<std::uint64_t>(num_frames_, kKeptAnswers); ++back) {
    const AnsweredFrame& frame = frames_[(num_frames_ - back) % kKeptAnswers];
    if (frame.frame_index > frame_index) {
      after = &frame;
      continue;
    }
    if (after == nullptr) break;
    if (after->number == frame.number + 1) return name + " was not tracked: it was dropped or damaged";
    return name + " is not known: mapping was busy for too long";
  }
  return name + " is not one of the last " + std::to_string(kKeptAnswers);
}

Result<FittedWall> MarkKeeper::FitAround(const SE3& cam_from_map, KeyframeHandle keyframe, const Eigen::Vector2d& pixel,
                                         int num_neighbours) {
  // What the nearest keyframe sees is in sight; what its neighbours see may lie behind a fold.
  fit_.Begin(cam_from_map);
  fit_.Add(state_.atlas.keyframe(keyframe), state_.atlas);
  Result<FittedWall> patch = fit_.At(pixel);
  if (patch.code() != StatusCode::kFailedPrecondition || num_neighbours == 0) return patch;
  state_.atlas.FindCovisible(keyframe, state_.config.mapping.min_shared_points, &covisible_);
  if (covisible_.size() > static_cast<std::size_t>(num_neighbours)) {
    covisible_.resize(static_cast<std::size_t>(num_neighbours));
  }
  for (const Covisible& neighbour : covisible_) fit_.Add(state_.atlas.keyframe(neighbour.keyframe), state_.atlas);
  return fit_.At(pixel);
}

Result<MarkId> MarkKeeper::Set(const MarkRequest& request) {
  HearTracker();
  Atlas& atlas = state_.atlas;
  const std::string label(request.label.view());
  if (label.empty()) return InvalidArgument("a mark needs a label");
  if (atlas.FindMark(label)) return InvalidArgument("there is a mark '" + label + "' already");
  if (!state_.camera.IsInImage(request.pixel)) return InvalidArgument("the pixel lies outside the image");
  if (!state_.scene.Shows(request.pixel)) {
    return InvalidArgument("the pixel lies in the border around the scene (static mask)");
  }
  if (atlas.marks().size() == atlas.marks().capacity()) {
    return CapacityExceeded("there are " + std::to_string(atlas.marks().capacity()) +
                            " marks already (memory.max_marks); remove one first");
  }
  if (request.frame_index == kNewestFrame && !is_newest_known_) {
    return NotFound("the newest frame is not known: mapping was busy for too long; set the mark again");
  }
  const AnsweredFrame* frame = Find(request.frame_index);
  if (frame == nullptr) {
    return NotFound(request.frame_index == kNewestFrame ? "there is no frame yet" : WhyUnknown(request.frame_index));
  }
  const std::string name = "frame " + std::to_string(frame->frame_index);
  if (frame->reference_keyframe == kNoId) {
    return FailedPrecondition(name + " has no measured pose: the scope was lost, or its pose predicted");
  }
  if (frame->surround.Holds(request.pixel)) {
    return InvalidArgument(name + ": the pixel lies in the dark surround of the picture");
  }
  ResolvedPose pose;
  const KeyframeHandle keyframe = atlas.FindById(frame->reference_keyframe);
  if (!keyframe ||
      !atlas.Resolve(frame->reference_keyframe, frame->cam_from_reference, frame->reference_scale, &pose)) {
    return FailedPrecondition(name + ": its map was dropped");
  }
  if (frame->map_epoch < pose.turned_at) {
    return FailedPrecondition(name + ": its map has taken another shape since; mark a newer frame");
  }
  HAUSTRA_ASSIGN(const FittedWall patch, FitAround(pose.cam_from_map, keyframe, request.pixel, kNeighboursOfMark));
  Eigen::Vector3d ray;
  if (!state_.camera.Unproject(request.pixel, &ray)) return Internal("a pixel with a patch and without a ray");
  Mark mark;
  mark.label = request.label;
  mark.frame_index = frame->frame_index;
  mark.timestamp = frame->timestamp;
  const MarkHandle handle =
      atlas.AddMark(mark, keyframe, PlaceOn(patch, ray, pose.cam_from_map, atlas.keyframe(keyframe).map));
  HAUSTRA_CHECK(handle.is_valid());
  ++state_.counters.num_marks_set;
  return atlas.marks().At(handle).id;
}

// A young map that was built anew was the mirror of what is seen (relief_check.h): its walls were elsewhere, and marks
// that were set by then are where no wall is.
bool MarkKeeper::MayBeElsewhere(MapHandle map) const {
  const auto num_keyframes = static_cast<int>(state_.atlas.map(map).keyframes.size());
  return map == state_.turned && num_keyframes <= state_.config.mapping.relief_keyframes;
}

Status MarkKeeper::Remove(std::string_view label) {
  const MarkHandle handle = state_.atlas.FindMark(label);
  if (!handle) return NotFound("there is no mark '" + std::string(label) + "'");
  state_.atlas.RemoveMark(handle);
  ++state_.counters.num_marks_removed;
  return Status::Ok();
}

void MarkKeeper::MapWasTurned() {
  state_.turned = state_.active;
  Refine(kMaxMarks, kNeighboursOfMark);
}

void MarkKeeper::Refine() { Refine(kRefinedPerKeyframe, 0); }

void MarkKeeper::Refine(int most, int num_neighbours) {
  Atlas& atlas = state_.atlas;
  const std::uint32_t num_slots = atlas.marks().capacity();
  if (atlas.marks().size() == 0) return;
  // In turn: a handful, from where the last call ended.
  std::array<MarkHandle, kMaxMarks> handles;
  atlas.marks().ForEach([&](MarkHandle handle, const Mark&) { handles[handle.index] = handle; });
  int num_refined = 0;
  for (std::uint32_t i = 0; i < num_slots && num_refined < most; ++i) {
    const MarkHandle handle = handles[next_to_refine_ % num_slots];
    next_to_refine_ = (next_to_refine_ + 1) % num_slots;
    if (!handle) continue;
    const Mark& mark = atlas.marks().At(handle);
    const Keyframe& keyframe = atlas.keyframe(mark.keyframe);
    if (keyframe.map != state_.active) continue;
    ++num_refined;
    Eigen::Vector2d pixel;
    if (!state_.camera.Project(mark.point_in_anchor, &pixel)) continue;
    // The ray stays: it is where the doctor pointed. Only how far away the wall is along it is better known now.
    const Result<FittedWall> patch = FitAround(keyframe.cam_from_map, mark.keyframe, pixel, num_neighbours);
    if (!patch.ok()) continue;
    const PlacedMark before = atlas.PlaceOf(mark);
    PlacedMark place = PlaceOn(*patch, mark.point_in_anchor.normalized(), keyframe.cam_from_map, keyframe.map);
    const double distance = (keyframe.cam_from_map * before.position).norm();
    const bool is_same_wall = std::abs(patch->distance - distance) <= WallFit::kSameWall * distance &&
                              place.normal.dot(before.normal) >= kMinNormalCos;
    if (!is_same_wall && !MayBeElsewhere(keyframe.map)) continue;
    if (is_same_wall) place.radius = before.radius;
    atlas.PlaceMark(handle, mark.keyframe, place);
  }
}

}  // namespace haustra
