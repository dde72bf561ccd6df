#include "engine/depth/depth_keeper.h"

#include <algorithm>
#include <array>
#include <string>

#include "hal/core/pixels.h"

namespace haustra {
namespace {

// Of the newest keyframe ids, among which that of a picture is looked for: those that were made since it came.
constexpr KeyframeId kNewestIds = 64;

}  // namespace

DepthKeeper::DepthKeeper(const EngineConfig& config, const CameraModel& camera, const Atlas& atlas,
                         PictureRing& pictures, DepthMailbox& mailbox, std::pmr::memory_resource* memory)
    : config_(config.depth),
      width_px_(camera.width_px()),
      height_px_(camera.height_px()),
      atlas_(atlas),
      handed_(pictures),
      mailbox_(mailbox),
      pictures_(memory),
      depths_(memory) {
  const int width = width_px_ / config_.step_px, height = height_px_ / config_.step_px;
  pictures_.reserve(static_cast<std::size_t>(config_.kept_pictures));
  for (int i = 0; i < config_.kept_pictures; ++i) {
    pictures_.emplace_back(width_px_, height_px_, width * height, memory);
  }
  depths_.reserve(static_cast<std::size_t>(config.memory.max_keyframes));
  for (int i = 0; i < config.memory.max_keyframes; ++i) depths_.emplace_back(width, height, memory);
}

MemoryPlan DepthKeeper::PlanMemory(const EngineConfig& config, int width_px, int height_px) {
  const DepthConfig& depth = config.depth;
  const int num_cells = (width_px / depth.step_px) * (height_px / depth.step_px);
  const auto num_pictures = static_cast<std::size_t>(depth.kept_pictures);
  const auto num_keyframes = static_cast<std::size_t>(config.memory.max_keyframes);
  const std::size_t num_pixels = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  using Bytes = std::uint8_t;
  MemoryPlan plan;
  plan.Add(MemoryPlace::kHostArena, "pictures of keyframes", num_pictures,
           PictureRing::BytesFor(kHandedPictures) +
               PictureRing::NumSlots(kHandedPictures) *
                   MemoryArena::BytesFor<Bytes>(HandedPicture::MaxBytes(width_px, height_px)) +
               MemoryArena::BytesFor<Picture>(num_pictures) +
               num_pictures * (MemoryArena::BytesFor<Bytes>(num_pixels) +
                               MemoryArena::BytesFor<Bytes>(std::size_t(3) * num_cells)),
           "depth.kept_pictures x image size");
  plan.Add(MemoryPlace::kHostArena, "depth of keyframes", num_keyframes,
           DepthTask::BytesFor(num_cells, config.features.max) + MemoryArena::BytesFor<KeptDepth>(num_keyframes) +
               num_keyframes * KeptDepth::BytesFor(num_cells),
           "memory.max_keyframes x image size / depth.step_px^2");
  return plan;
}

bool DepthKeeper::TakeIn() {
  if (mailbox_.Answered() != nullptr) {
    TakeAnswer();
    return true;
  }
  if (const HandedPicture* handed = handed_.Front(); handed != nullptr && Keep(*handed)) {
    handed_.Pop();
    return true;
  }
  return false;
}

void DepthKeeper::SetFinishing(bool is_finishing) {
  is_finishing_ = is_finishing;
  if (!is_finishing) return;
  for (Picture& picture : pictures_) {
    if (!picture.knew_too_little || atlas_.GetKeyframe(picture.keyframe) == nullptr) continue;
    picture.was_asked = picture.knew_too_little = false;
    --counters_.num_too_little;
  }
}

const KeptDepth* DepthKeeper::DepthOf(KeyframeHandle keyframe) const {
  const Keyframe* there = atlas_.GetKeyframe(keyframe);
  if (there == nullptr) return nullptr;
  const KeptDepth& kept = depths_[keyframe.index];
  return kept.keyframe == keyframe && kept.turned_at == there->turned_at ? &kept : nullptr;
}

std::uint32_t DepthKeeper::num_keyframes() const {
  std::uint32_t num = 0;
  atlas_.keyframes().ForEach([&](KeyframeHandle keyframe, const Keyframe&) { num += DepthOf(keyframe) != nullptr; });
  return num;
}

void DepthKeeper::TakeAnswer() {
  const DepthTask& task = *mailbox_.Answered();
  counters_.search_time += task.duration;
  const Keyframe* keyframe = atlas_.GetKeyframe(task.keyframe);
  const bool is_turned = keyframe != nullptr && keyframe->turned_at != task.turned_at;
  if (task.status.code() == StatusCode::kCancelled || is_turned) {
    --counters_.num_searches;
    asked_->was_asked = false;
  } else if (task.status.ok() && keyframe != nullptr) {
    KeptDepth& kept = depths_[task.keyframe.index];
    kept.keyframe = task.keyframe;
    kept.scale = task.scale;
    kept.turned_at = task.turned_at;
    kept.depth = task.depth;
    std::copy(asked_->bgr.begin(), asked_->bgr.end(), kept.bgr.begin());
    ++counters_.num_depths;
  } else {
    ++counters_.num_in_vain;
  }
  for (Picture& picture : pictures_) picture.is_lent = false;
  asked_ = nullptr;
  mailbox_.Take();
}

// False: all that are kept are lent.
bool DepthKeeper::Keep(const HandedPicture& handed) {
  Picture* oldest = nullptr;
  for (Picture& picture : pictures_) {
    if (!picture.is_lent && (oldest == nullptr || picture.arrival < oldest->arrival)) oldest = &picture;
  }
  if (oldest == nullptr) return false;
  if (handed.image.width != width_px_ || handed.image.height != height_px_) return true;
  if (oldest->arrival != 0) {
    if (!oldest->keyframe.is_valid()) FindKeyframe(oldest);
    counters_.num_late += IsToAsk(*oldest);
  }
  oldest->arrival = ++counters_.num_pictures;
  oldest->frame_index = handed.frame_index;
  oldest->timestamp = handed.timestamp;
  oldest->keyframe = KeyframeHandle{};
  oldest->was_asked = oldest->knew_too_little = false;
  for (int y = 0; y < height_px_; ++y) {
    GreyOfRow(handed.image, y, oldest->grey.data() + static_cast<std::size_t>(y) * width_px_);
  }
  const int step_px = config_.step_px;
  auto bgr = oldest->bgr.begin();
  for (int y = 0; y < height_px_ / step_px; ++y) {
    for (int x = 0; x < width_px_ / step_px; ++x) {
      const std::array<std::uint8_t, 3> pixel =
          BgrAt(handed.image, x * step_px + step_px / 2, y * step_px + step_px / 2);
      bgr = std::copy(pixel.begin(), pixel.end(), bgr);
    }
  }
  return true;
}

void DepthKeeper::FindKeyframe(Picture* picture) const {
  const KeyframeId end = atlas_.num_keyframe_ids();
  for (KeyframeId id = end; id-- > 0 && end - id <= kNewestIds;) {
    if (!atlas_.IsOfThisSession(id) || atlas_.FrameOfKeyframe(id) != picture->frame_index) continue;
    const KeyframeHandle handle = atlas_.TraceOfKeyframe(id).keyframe;
    const Keyframe* keyframe = atlas_.GetKeyframe(handle);
    if (keyframe == nullptr || keyframe->id != id || keyframe->timestamp != picture->timestamp) continue;
    picture->keyframe = handle;
    return;
  }
}

bool DepthKeeper::IsToAsk(const Picture& picture) const {
  const Keyframe* keyframe = atlas_.GetKeyframe(picture.keyframe);
  return keyframe != nullptr && (!picture.was_asked || picture.turned_at != keyframe->turned_at);
}

DepthKeeper::Picture* DepthKeeper::OldestDue() {
  const auto num_newer = static_cast<std::uint64_t>(std::min(config_.newer_keyframes, config_.kept_pictures / 2));
  Picture* oldest = nullptr;
  for (Picture& picture : pictures_) {
    if (picture.arrival == 0) continue;
    if (!picture.keyframe.is_valid()) FindKeyframe(&picture);
    if (!IsToAsk(picture)) continue;
    if (!is_finishing_ && counters_.num_pictures - picture.arrival < num_newer) continue;
    if (oldest == nullptr || picture.arrival < oldest->arrival) oldest = &picture;
  }
  return oldest;
}

bool DepthKeeper::Ask() {
  DepthTask* task = mailbox_.Free();
  if (task == nullptr) return false;
  Picture* due = OldestDue();
  if (due == nullptr) return false;
  due->was_asked = true;
  due->turned_at = atlas_.keyframe(due->keyframe).turned_at;
  if (due->knew_too_little) --counters_.num_too_little;
  due->knew_too_little = false;
  if (!Fill(*due, task)) {
    for (Picture& picture : pictures_) picture.is_lent = false;
    due->knew_too_little = true;
    ++counters_.num_too_little;
    return true;
  }
  asked_ = due;
  ++counters_.num_searches;
  mailbox_.Ask();
  return true;
}

DepthView DepthKeeper::ViewOf(const Picture& picture) const {
  return {{picture.grey.data(), width_px_, height_px_, width_px_, PixelFormat::kGrey8},
          atlas_.keyframe(picture.keyframe).cam_from_map};
}

void DepthKeeper::Look(const Keyframe& keyframe, SeeingView* view) const {
  view->centre_in_map = keyframe.cam_from_map.InverseTranslation();
  view->points.clear();
  for (int i = 0; i < keyframe.features.num; ++i) {
    const MapPointHandle handle = keyframe.points[i];
    const MapPoint* point = atlas_.GetPoint(handle);
    if (point != nullptr) view->points.push_back({handle.index, point->position});
  }
  std::sort(view->points.begin(), view->points.end(),
            [](const SeenPoint& a, const SeenPoint& b) { return a.point_id < b.point_id; });
}

// False: nothing can be said of its depth.
bool DepthKeeper::Fill(const Picture& reference, DepthTask* task) {
  const Keyframe& keyframe = atlas_.keyframe(reference.keyframe);
  seen_by_.clear();
  int reference_idx = 0;
  for (Picture& picture : pictures_) {
    const Keyframe* other = picture.arrival == 0 ? nullptr : atlas_.GetKeyframe(picture.keyframe);
    if (other == nullptr) continue;
    if (&picture == &reference) reference_idx = static_cast<int>(seen_by_.size());
    if (views_.size() <= seen_by_.size()) views_.emplace_back();
    Look(*other, &views_[seen_by_.size()]);
    seen_by_.push_back(&picture);
  }
  task->sources.Clear();
  for (const int source : SelectSources(std::span<const SeeingView>(views_).first(seen_by_.size()), reference_idx,
                                        config_.max_sources, kMinSourceScore)) {
    if (!task->sources.PushBack(ViewOf(*seen_by_[source]))) break;
    seen_by_[source]->is_lent = true;
  }
  seen_by_[reference_idx]->is_lent = true;
  task->seeds.clear();
  for (int i = 0; i < keyframe.features.num; ++i) {
    const MapPoint* point = atlas_.GetPoint(keyframe.points[i]);
    DepthSeed seed;
    if (point != nullptr &&
        MakeSeed(keyframe.features.pixel(i), config_.step_px, keyframe.cam_from_map * point->position, &seed)) {
      task->seeds.push_back(seed);
    }
  }
  task->keyframe = reference.keyframe;
  task->scale = atlas_.KeyframeScale(reference.keyframe);
  task->turned_at = keyframe.turned_at;
  task->reference = ViewOf(reference);
  return !task->sources.empty() && task->seeds.size() >= DepthMatcher::kMinSeeds;
}

}  // namespace haustra
