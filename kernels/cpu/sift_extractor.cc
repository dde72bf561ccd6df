#include "kernels/cpu/sift_extractor.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "hal/core/pixels.h"
#include "kernels/common/request_checks.h"

namespace haustra::kernels {
namespace {

constexpr int kInput = -1;  // stands for a level: the input, at twice its size or as it is
constexpr int kRowsPerTask = 32;
constexpr int kPointsPerTask = 32;
constexpr int kFollowedPerTask = 8;
// Room for extrema, in pixels for each; white noise has about one in 60.
constexpr int kPixelsPerExtremum = 16;

int NumTasks(int count, int per_task) { return (count + per_task - 1) / per_task; }

MaskOptions MaskOptionsOf(const ExtractOptions& options) {
  return {options.reflection_threshold, options.border_threshold, options.mask_dilation_px};
}

int MaxStride(const VisionPlan& plan, int octave) {
  // One vector more than the image is wide: neighbours of the last column may be read.
  return AlignUp(OctaveSize(plan.max_width_px, octave), kStrideAlignment) + kStrideAlignment;
}

int MaxPointsPerChunk(const VisionPlan& plan, int octave) {
  return kRowsPerTask * MaxStride(plan, octave) / kPixelsPerExtremum;
}

int MaxPoints(const VisionPlan& plan) {
  int sum = 0;
  for (int i = 0; i < CountOctaves(plan.max_width_px, plan.max_height_px); ++i) {
    const int octave = kFirstOctave + i;
    sum += NumTasks(OctaveSize(plan.max_height_px, octave), kRowsPerTask) * MaxPointsPerChunk(plan, octave);
  }
  return sum;
}

}  // namespace

SiftExtractor::SiftExtractor(const VisionPlan& plan, const ExtractOptions& options, SimdLevel level, LanePool& pool)
    : options_(options),
      kernels_(SiftKernelsFor(level)),
      pool_(pool),
      scratch_(pool.num_threads()),
      mask_(plan.max_width_px, plan.max_height_px, MaskOptionsOf(options)),
      grey_(static_cast<std::size_t>(plan.max_width_px) * plan.max_height_px),
      points_(MaxPoints(plan) + plan.max_features),
      selection_(plan.max_width_px, plan.max_height_px, MaxPoints(plan)),
      angles_(static_cast<std::size_t>(options.num_features) * kMaxOrientations),
      num_angles_(options.num_features),
      features_(plan.max_features),
      follower_(plan, kernels_),
      followed_(MaxFollowed(plan)) {
  refinement_.contrast_threshold =
      options.contrast_threshold > 0.0f ? options.contrast_threshold : kDefaultContrastThreshold;
  refinement_.edge_threshold = options.edge_threshold;

  for (int i = 0; i < kNumLevels; ++i) kernels_of_levels_[i] = KernelOfLevel(i);
  kernel_from_input_ = KernelFromInput();

  octaves_.resize(CountOctaves(plan.max_width_px, plan.max_height_px));
  for (std::size_t i = 0; i < octaves_.size(); ++i) {
    Octave& octave = octaves_[i];
    octave.index = kFirstOctave + static_cast<int>(i);
    const int stride = MaxStride(plan, octave.index);
    const int height = OctaveSize(plan.max_height_px, octave.index);
    octave.memory =
        AlignedBuffer<float>(static_cast<std::size_t>(stride) * height * kNumLevels + 2 * kPlanePadding * kNumLevels);
    octave.max_points_per_chunk = MaxPointsPerChunk(plan, octave.index);
    octave.num_extrema.resize(NumTasks(height, kRowsPerTask));
    octave.num_points.resize(octave.num_extrema.size());
    octave.extrema = AlignedBuffer<Extremum>(octave.num_extrema.size() * octave.max_points_per_chunk);
    octave.points = AlignedBuffer<ScaleSpacePoint>(octave.num_extrema.size() * octave.max_points_per_chunk);
  }
  const int max_stride = MaxStride(plan, kFirstOctave);
  for (WorkerScratch& scratch : scratch_) {
    scratch.line = AlignedBuffer<float>(max_stride + 4 * kPlanePadding);
    scratch.extrema_rows = AlignedBuffer<float>(kExtremaScratchFloats);
  }
}

std::size_t SiftExtractor::BytesFor(const VisionPlan& plan, const ExtractOptions& options, int num_threads) {
  const int num_octaves = CountOctaves(plan.max_width_px, plan.max_height_px);
  const int max_points = MaxPoints(plan);
  std::size_t bytes = static_cast<std::size_t>(num_octaves) * sizeof(Octave);
  for (int i = 0; i < num_octaves; ++i) {
    const int octave = kFirstOctave + i;
    const std::size_t height = OctaveSize(plan.max_height_px, octave);
    const std::size_t num_chunks = NumTasks(static_cast<int>(height), kRowsPerTask);
    const std::size_t num_points = num_chunks * MaxPointsPerChunk(plan, octave);
    bytes +=
        AlignedBuffer<float>::BytesFor(MaxStride(plan, octave) * height * kNumLevels + 2 * kPlanePadding * kNumLevels) +
        AlignedBuffer<Extremum>::BytesFor(num_points) + AlignedBuffer<ScaleSpacePoint>::BytesFor(num_points) +
        2 * num_chunks * sizeof(int);
  }
  bytes += num_threads * (sizeof(WorkerScratch) + AlignedBuffer<float>::BytesFor(kExtremaScratchFloats) +
                          AlignedBuffer<float>::BytesFor(MaxStride(plan, kFirstOctave) + 4 * kPlanePadding));
  return bytes + ExclusionMask::BytesFor(plan.max_width_px, plan.max_height_px, MaskOptionsOf(options)) +
         AlignedBuffer<std::uint8_t>::BytesFor(static_cast<std::size_t>(plan.max_width_px) * plan.max_height_px) +
         AlignedBuffer<ScaleSpacePoint>::BytesFor(max_points + plan.max_features) +
         FeatureSelection::BytesFor(plan.max_width_px, plan.max_height_px, max_points) +
         AlignedBuffer<float>::BytesFor(static_cast<std::size_t>(options.num_features) * kMaxOrientations) +
         AlignedBuffer<std::int32_t>::BytesFor(options.num_features) +
         AlignedBuffer<Feature>::BytesFor(plan.max_features) + FeatureFollower::BytesFor(plan) +
         AlignedBuffer<FollowedPoint>::BytesFor(MaxFollowed(plan));
}

void SiftExtractor::Prefault() {
  for (Octave& octave : octaves_) {
    octave.memory.SetZero();
    octave.extrema.SetZero();
    octave.points.SetZero();
  }
  for (WorkerScratch& scratch : scratch_) {
    scratch.line.SetZero();
    scratch.extrema_rows.SetZero();
  }
  mask_.Prefault();
  grey_.SetZero();
  points_.SetZero();
  selection_.Prefault();
  angles_.SetZero();
  num_angles_.SetZero();
  for (std::size_t i = 0; i < features_.size(); ++i) features_[i] = Feature{};
  follower_.Prefault();
  for (std::size_t i = 0; i < followed_.size(); ++i) followed_[i] = FollowedPoint{};
}

void SiftExtractor::SetSize(int width_px, int height_px) {
  if (width_px == width_px_ && height_px == height_px_) return;
  width_px_ = width_px;
  height_px_ = height_px;
  num_octaves_ = CountOctaves(width_px, height_px);
  for (int i = 0; i < num_octaves_; ++i) {
    Octave& octave = octaves_[i];
    octave.width = OctaveSize(width_px, octave.index);
    octave.height = OctaveSize(height_px, octave.index);
    octave.stride = AlignUp(octave.width, kStrideAlignment) + kStrideAlignment;
    const std::size_t plane_size = static_cast<std::size_t>(octave.stride) * octave.height + 2 * kPlanePadding;
    // Rows hold whole vectors: what lies between the width and the stride is computed along, and never used as a
    // result.
    octave.memory.SetZero();
    for (int level = 0; level < kNumLevels; ++level) {
      octave.levels[level] = {octave.memory.data() + level * plane_size + kPlanePadding, octave.width, octave.height,
                              octave.stride};
    }
  }
}

void SiftExtractor::Begin(const ExtractRequest& request, const ImageView& static_mask, FeatureSet& set) {
  image_ = request.image;
  static_mask_ = static_mask;
  limit_ = request.max_features > 0 ? std::min(request.max_features, options_.num_features) : options_.num_features;
  set_ = &set;
  // Before the levels of the last picture are overwritten.
  const bool is_same_size = image_.width == width_px_ && image_.height == height_px_;
  follow_ = has_levels_ && is_same_size ? request.follow : std::span<const Keypoint>{};
  num_only_followed_ = request.num_only_followed;
  if (!follow_.empty()) follower_.Keep(Levels());
  has_levels_ = false;
  SetSize(image_.width, image_.height);
  first_octave_ = request.min_scale_px >= kFinestOctaveMaxScalePx && num_octaves_ > 1 ? 1 : 0;
  step_ = Step::kGrey;
}

bool SiftExtractor::Continue(TimePoint deadline) {
  while (pool_.Finish(deadline)) {
    if (step_ == Step::kDone) return true;
    if (IsOver(deadline)) return false;
    Advance();
  }
  return false;
}

void SiftExtractor::Advance() {
  switch (step_) {
    case Step::kGrey:
      ToGrey();
      step_ = Step::kMask;
      break;
    case Step::kMask:
      mask_.Build(grey_rows_, width_px_, height_px_, grey_pitch_bytes_, static_mask_);
      BeginOctave(first_octave_);
      break;
    case Step::kBuild:
      if (pool_.num_threads() > 1 ? BuildNextLevel() : BuildNextRows()) step_ = Step::kRefine;
      break;
    case Step::kRefine:
      pool_.Begin(NumTasks(octaves_[octave_idx_].height, kRowsPerTask),
                  [this, octave = &octaves_[octave_idx_]](int chunk, int) { RefineChunk(*octave, chunk); });
      if (octave_idx_ + 1 < num_octaves_) {
        BeginOctave(octave_idx_ + 1);
      } else {
        step_ = Step::kSelect;
      }
      break;
    case Step::kSelect:
      num_points_ = CollectPoints();
      has_levels_ = true;
      selected_ =
          selection_.Select({points_.data(), static_cast<std::size_t>(num_points_)}, width_px_, height_px_, limit_);
      BeginOrientations();
      step_ = Step::kChoose;
      break;
    case Step::kChoose:
      num_detected_ = ChooseFeatures();
      BeginToFollow();
      step_ = Step::kDescribe;
      break;
    case Step::kDescribe:
      num_features_ = AddFollowed(num_detected_);
      BeginDescriptors();
      step_ = Step::kDone;
      break;
    case Step::kDone: break;
  }
}

void SiftExtractor::ToGrey() {
  if (image_.format == PixelFormat::kGrey8 || image_.format == PixelFormat::kNv12) {
    grey_pitch_bytes_ = static_cast<int>(image_.pitch_bytes);
    grey_rows_ = image_.data;
    return;
  }
  for (int y = 0; y < image_.height; ++y) {
    GreyOfRow(image_, y, grey_.data() + static_cast<std::size_t>(y) * image_.width);
  }
  grey_pitch_bytes_ = image_.width;
  grey_rows_ = grey_.data();
}

void SiftExtractor::BeginOctave(int octave_idx) {
  octave_idx_ = octave_idx;
  level_ = octave_idx == first_octave_ ? kInput : 0;
  chunk_ = 0;
  std::fill(std::begin(rows_done_), std::end(rows_done_), 0);
  step_ = Step::kBuild;
}

void SiftExtractor::ComputeRows(int octave_idx, int level, int y_begin, int y_end, WorkerScratch& scratch) {
  Octave& octave = octaves_[octave_idx];
  // The last level is free until it is computed: it holds the input.
  const Plane& input = octave.levels[kNumLevels - 1];
  if (level == kInput) {
    if (octave.index < 0) {
      kernels_.UpsampleRows(grey_rows_, width_px_, height_px_, grey_pitch_bytes_, input, y_begin, y_end,
                            scratch.line.data());
    } else {
      kernels_.ConvertRows(grey_rows_, width_px_, grey_pitch_bytes_, input, y_begin, y_end);
    }
  } else if (level == 0 && octave_idx > first_octave_) {
    kernels_.DecimateRows(octaves_[octave_idx - 1].levels[kScalesPerOctave], octave.levels[0], y_begin, y_end);
  } else {
    kernels_.BlurRows(level == 0 ? input : octave.levels[level - 1], octave.levels[level], KernelOf(octave_idx, level),
                      y_begin, y_end, scratch.line.data());
  }
}

bool SiftExtractor::BuildNextLevel() {
  const int height = octaves_[octave_idx_].height;
  const int num_tasks = NumTasks(height, kRowsPerTask);
  if (level_ == kNumLevels) {
    pool_.Begin(num_tasks, [this, octave = &octaves_[octave_idx_]](int chunk, int worker) {
      FindChunk(*octave, chunk, scratch_[worker]);
    });
    return true;
  }
  pool_.Begin(num_tasks, [this, octave_idx = octave_idx_, level = level_, height](int task, int worker) {
    const int y_begin = task * kRowsPerTask;
    ComputeRows(octave_idx, level, y_begin, std::min(y_begin + kRowsPerTask, height), scratch_[worker]);
  });
  ++level_;
  return false;
}

bool SiftExtractor::BuildNextRows() {
  Octave& octave = octaves_[octave_idx_];
  const int first_level = octave_idx_ == first_octave_ ? kInput : 0;
  const int num_chunks = NumTasks(octave.height, kRowsPerTask);
  for (int level = first_level; level < kNumLevels; ++level) {
    int& done = rows_done_[level - kInput];
    int possible = std::min(done + kRowsPerTask, octave.height);
    if (level > first_level) {
      const int before = rows_done_[level - 1 - kInput];
      possible = before == octave.height ? before : before - KernelOf(octave_idx_, level).radius;
    }
    if (possible <= done) continue;
    ComputeRows(octave_idx_, level, done, possible, scratch_[0]);
    done = possible;
  }
  // Extrema look one row ahead.
  const int rows_ready = rows_done_[kNumLevels];
  while (chunk_ < num_chunks && (rows_ready == octave.height || (chunk_ + 1) * kRowsPerTask < rows_ready)) {
    FindChunk(octave, chunk_++, scratch_[0]);
  }
  return chunk_ == num_chunks;
}

void SiftExtractor::FindChunk(Octave& octave, int chunk, WorkerScratch& scratch) {
  // The grid point may have less contrast than the refined one.
  const float threshold = 0.8f * refinement_.contrast_threshold;
  const int y_begin = chunk * kRowsPerTask;
  const int y_end = std::min(y_begin + kRowsPerTask, octave.height);
  Extremum* out = octave.extrema.data() + static_cast<std::size_t>(chunk) * octave.max_points_per_chunk;
  octave.num_extrema[chunk] = kernels_.FindExtrema(octave.levels, threshold, y_begin, y_end, out,
                                                   octave.max_points_per_chunk, scratch.extrema_rows.data());
}

void SiftExtractor::RefineChunk(Octave& octave, int chunk) {
  const std::size_t first = static_cast<std::size_t>(chunk) * octave.max_points_per_chunk;
  ScaleSpacePoint* out = octave.points.data() + first;
  int count = 0;
  for (int i = 0; i < octave.num_extrema[chunk]; ++i) {
    const Extremum& extremum = octave.extrema[first + i];
    if (mask_.IsExcluded(octave.index, extremum.x, extremum.y)) continue;
    ScaleSpacePoint& point = out[count];
    if (!RefineExtremum(octave.levels, extremum, refinement_, &point)) continue;
    if (mask_.IsExcluded(octave.index, point.x, point.y)) continue;
    point.octave = static_cast<std::int16_t>(octave.index);
    ++count;
  }
  octave.num_points[chunk] = count;
}

int SiftExtractor::CollectPoints() {
  int num_points = 0;
  for (int i = first_octave_; i < num_octaves_; ++i) {
    const Octave& octave = octaves_[i];
    for (int chunk = 0; chunk < NumTasks(octave.height, kRowsPerTask); ++chunk) {
      const ScaleSpacePoint* points =
          octave.points.data() + static_cast<std::size_t>(chunk) * octave.max_points_per_chunk;
      std::copy_n(points, octave.num_points[chunk], points_.data() + num_points);
      num_points += octave.num_points[chunk];
    }
  }
  return num_points;
}

void SiftExtractor::BeginOrientations() {
  const int num_selected = static_cast<int>(selected_.size());
  pool_.Begin(NumTasks(num_selected, kPointsPerTask), [this, num_selected](int task, int) {
    const int last = std::min((task + 1) * kPointsPerTask, num_selected);
    for (int i = task * kPointsPerTask; i < last; ++i) {
      const ScaleSpacePoint& point = points_[selected_[i]];
      float* angles = angles_.data() + static_cast<std::size_t>(i) * kMaxOrientations;
      if (options_.upright_dark && point.is_dark) {
        angles[0] = 0.0f;
        num_angles_[i] = 1;
        continue;
      }
      const Plane& level = octaves_[point.octave - kFirstOctave].levels[point.level];
      num_angles_[i] = kernels_.FindOrientations(level, {point.x, point.y, point.scale, 0.0f}, angles);
    }
  });
}

int SiftExtractor::ChooseFeatures() {
  const int num_selected = static_cast<int>(selected_.size());
  int num_features = 0;
  for (int i = 0; i < num_selected && num_features < limit_; ++i) {
    const ScaleSpacePoint& point = points_[selected_[i]];
    for (int k = 0; k < num_angles_[i] && num_features < limit_; ++k) {
      const float to_input = std::ldexp(1.0f, point.octave);
      Feature& feature = features_[num_features++];
      feature.keypoint = {point.x * to_input,     point.y * to_input,
                          point.scale * to_input, angles_[static_cast<std::size_t>(i) * kMaxOrientations + k],
                          point.response,         point.octave};
      feature.point_idx = selected_[i];
    }
  }
  const auto key = [](const Feature& f) {
    return std::tie(f.keypoint.octave, f.keypoint.y_px, f.keypoint.x_px, f.keypoint.angle_rad, f.keypoint.scale_px,
                    f.point_idx);
  };
  Feature* end = features_.data() + num_features;
  std::sort(features_.data(), end, [&](const Feature& a, const Feature& b) { return key(a) < key(b); });
  // Two extrema may settle at one point.
  end = std::unique(features_.data(), end, [](const Feature& a, const Feature& b) {
    return a.keypoint.octave == b.keypoint.octave && a.keypoint.y_px == b.keypoint.y_px &&
           a.keypoint.x_px == b.keypoint.x_px && a.keypoint.angle_rad == b.keypoint.angle_rad &&
           a.keypoint.scale_px == b.keypoint.scale_px;
  });
  return static_cast<int>(end - features_.data());
}

std::span<const Plane> SiftExtractor::Levels() {
  int num = 0;
  for (int i = 0; i < num_octaves_ && num < kFlowLevels; ++i) {
    if (octaves_[i].index >= 0) levels_[num++] = octaves_[i].levels[0];
  }
  return std::span<const Plane>(levels_).first(num);
}

void SiftExtractor::BeginToFollow() {
  const std::span<const Plane> levels = Levels();
  pool_.Begin(NumTasks(static_cast<int>(follow_.size()), kFollowedPerTask), [this, levels](int task, int) {
    const int last = std::min((task + 1) * kFollowedPerTask, static_cast<int>(follow_.size()));
    for (int i = task * kFollowedPerTask; i < last; ++i) {
      FollowedPoint& followed = followed_[i];
      const FeatureFollower::Answer answer =
          follower_.Follow(levels, follow_[i].x_px, follow_[i].y_px, &followed.x_px, &followed.y_px);
      followed.is_found = answer != FeatureFollower::Answer::kLost;
      followed.is_sure = answer == FeatureFollower::Answer::kSure;
    }
  });
}

bool SiftExtractor::IsFound(const Keypoint& keypoint) const {
  const float distance = std::max(kFlowSameMinPx, kFlowSameDistance * keypoint.scale_px);
  for (int i = 0; i < num_detected_; ++i) {
    const Keypoint& found = features_[i].keypoint;
    const float dx = found.x_px - keypoint.x_px, dy = found.y_px - keypoint.y_px;
    if (dx * dx + dy * dy < distance * distance && found.scale_px < kFlowSameScaleFactor * keypoint.scale_px &&
        keypoint.scale_px < kFlowSameScaleFactor * found.scale_px) {
      return true;
    }
  }
  return false;
}

int SiftExtractor::AddFollowed(int num_features) {
  const int max_features = static_cast<int>(features_.size());
  for (std::size_t i = num_only_followed_; i < follow_.size() && num_features < max_features; ++i) {
    if (!followed_[i].is_sure || follow_[i].octave < first_octave_ + kFirstOctave) continue;
    Keypoint keypoint = follow_[i];
    keypoint.x_px = followed_[i].x_px;
    keypoint.y_px = followed_[i].y_px;
    const float to_octave = std::ldexp(1.0f, -keypoint.octave);
    const Octave& octave = octaves_[keypoint.octave - kFirstOctave];
    ScaleSpacePoint& point = points_[num_points_];
    point = {keypoint.x_px * to_octave, keypoint.y_px * to_octave, keypoint.scale_px * to_octave, keypoint.response};
    point.octave = static_cast<std::int16_t>(keypoint.octave);
    point.level = static_cast<std::int16_t>(LevelOfScale(point.scale));
    if (point.x < kEdgeMarginPx || point.y < kEdgeMarginPx || point.x >= octave.width - kEdgeMarginPx ||
        point.y >= octave.height - kEdgeMarginPx || mask_.IsExcluded(octave.index, point.x, point.y) ||
        IsFound(keypoint)) {
      continue;
    }
    features_[num_features++] = {keypoint, num_points_++};
  }
  return num_features;
}

void SiftExtractor::BeginDescriptors() {
  pool_.Begin(NumTasks(num_features_, kPointsPerTask), [this](int task, int) {
    const int last = std::min((task + 1) * kPointsPerTask, num_features_);
    for (int i = task * kPointsPerTask; i < last; ++i) {
      const Feature& feature = features_[i];
      const ScaleSpacePoint& point = points_[feature.point_idx];
      const Plane& level = octaves_[point.octave - kFirstOctave].levels[point.level + kDescriptorLevelOffset];
      set_->keypoints[i] = feature.keypoint;
      kernels_.Describe(level, {point.x, point.y, point.scale, feature.keypoint.angle_rad}, options_.root_sift,
                        set_->descriptor(i));
    }
  });
}

}  // namespace haustra::kernels
