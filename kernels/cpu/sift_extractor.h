// SIFT on the CPU: scale space, extrema, refinement, masks, selection, orientations, descriptors (Lowe 2004).
// The output does not depend on the number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/vision_device.h"
#include "kernels/cpu/aligned_buffer.h"
#include "kernels/cpu/exclusion_mask.h"
#include "kernels/cpu/feature_follower.h"
#include "kernels/cpu/feature_selection.h"
#include "kernels/cpu/feature_set_pool.h"
#include "kernels/cpu/lane_pool.h"
#include "kernels/cpu/sift_kernels.h"
#include "kernels/cpu/sift_refinement.h"

namespace haustra::kernels {

// thread-bound(one lane); nothing but construction allocates.
class SiftExtractor {
 public:
  // `pool` must outlive the extractor, which uses it alone while an extraction lasts.
  SiftExtractor(const VisionPlan& plan, const ExtractOptions& options, SimdLevel level, LanePool& pool);

  static std::size_t BytesFor(const VisionPlan& plan, const ExtractOptions& options, int num_threads);

  // Touches all memory now, so that the first frame does not pay for its pages.
  void Prefault();

  // The request was checked (request_checks.h); static_mask is empty or of the image's size. What will be written are
  // keypoints and descriptors of `set`. Forgets an extraction that was not continued to its end, whose loop was
  // dropped.
  void Begin(const ExtractRequest& request, const ImageView& static_mask, FeatureSet& set);
  // True when the extraction is done. False when the deadline is over before; then it can be continued. The deadline is
  // looked at about once a millisecond.
  bool Continue(TimePoint deadline);
  // Of the last picture; 0: there was none.
  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }
  // Nothing is followed from the picture of an extraction that was dropped.
  void ForgetPicture() { has_levels_ = false; }
  // Of the extraction that is done.
  int num_features() const { return num_features_; }
  int num_followed() const { return num_features_ - num_detected_; }  // of these, the last ones
  // Where the features to follow are; empty: none were followed.
  std::span<const FollowedPoint> followed_to() const { return {followed_.data(), follow_.size()}; }

 private:
  struct Octave {
    int index = 0;  // 0: input resolution
    int width = 0;
    int height = 0;
    int stride = 0;
    Plane levels[kNumLevels];
    AlignedBuffer<float> memory;
    // Both by chunks of rows, each with room for max_points_per_chunk.
    int max_points_per_chunk = 0;
    AlignedBuffer<Extremum> extrema;
    AlignedBuffer<ScaleSpacePoint> points;
    std::vector<int> num_extrema;
    std::vector<int> num_points;
  };
  struct WorkerScratch {
    AlignedBuffer<float> line;
    AlignedBuffer<float> extrema_rows;
  };
  struct Feature {
    Keypoint keypoint;
    std::int32_t point_idx = 0;
  };

  // What comes next. Each step is a short piece of work, or begins a loop of the pool.
  enum class Step { kGrey, kMask, kBuild, kRefine, kSelect, kChoose, kDescribe, kDone };

  void Advance();
  void SetSize(int width_px, int height_px);
  void ToGrey();
  // Rows of one level (or of the input that the first octave is made from); those of the level before must be there as
  // far as its kernel reaches.
  void ComputeRows(int octave_idx, int level, int y_begin, int y_end, WorkerScratch& scratch);
  const GaussianKernel& KernelOf(int octave_idx, int level) const {
    return level == 0 && octaves_[octave_idx].index == 0 ? kernel_from_input_ : kernels_of_levels_[level];
  }
  void BeginOctave(int octave_idx);
  // The levels and the extrema of an octave, with the same result in two orders: one level after the other, its rows
  // shared out among threads; or, on one thread, all levels together from top to bottom, while the rows they need are
  // still in the cache. Each call does a part and returns whether it was the last one.
  bool BuildNextLevel();
  bool BuildNextRows();
  void FindChunk(Octave& octave, int chunk, WorkerScratch& scratch);
  void RefineChunk(Octave& octave, int chunk);
  int CollectPoints();
  void BeginOrientations();
  // In order of priority until the limit, then in the order of the output.
  int ChooseFeatures();
  // Levels of the picture for the follower.
  std::span<const Plane> Levels();
  void BeginToFollow();
  bool IsFound(const Keypoint& keypoint) const;
  // Adds those that were followed and that detection has not found. Returns how many features there are then.
  int AddFollowed(int num_features);
  void BeginDescriptors();

  ExtractOptions options_;
  RefinementOptions refinement_;
  const SiftKernels& kernels_;
  LanePool& pool_;

  // The extraction.
  Step step_ = Step::kDone;
  ImageView image_;
  std::span<const Keypoint> follow_;
  std::size_t num_only_followed_ = 0;  // of these, the first ones
  ImageView static_mask_;
  const std::uint8_t* grey_rows_ = nullptr;
  int grey_pitch_bytes_ = 0;
  int limit_ = 0;
  FeatureSet* set_ = nullptr;
  int octave_idx_ = 0;                  // that is built
  int level_ = 0;                       // of it, the next one (level by level)
  int chunk_ = 0;                       // of it, the next one (row by row)
  int rows_done_[kNumLevels + 1] = {};  // of the input, then of each level
  std::span<const std::int32_t> selected_;
  int num_points_ = 0;
  int num_features_ = 0;
  int num_detected_ = 0;
  bool has_levels_ = false;  // of the last picture, in octaves_

  int num_octaves_ = 0;   // of the current image
  int first_octave_ = 0;  // index of the first that is searched
  int width_px_ = 0;
  int height_px_ = 0;
  GaussianKernel kernels_of_levels_[kNumLevels];  // from the level before; that of level 0: from the enlarged input
  GaussianKernel kernel_from_input_;              // of level 0, without the enlarged input
  std::vector<Octave> octaves_;
  std::vector<WorkerScratch> scratch_;
  ExclusionMask mask_;
  AlignedBuffer<std::uint8_t> grey_;
  AlignedBuffer<ScaleSpacePoint> points_;
  FeatureSelection selection_;
  AlignedBuffer<float> angles_;             // kMaxOrientations for each selected point
  AlignedBuffer<std::int32_t> num_angles_;  // of each selected point
  AlignedBuffer<Feature> features_;
  FeatureFollower follower_;
  std::array<Plane, kFlowLevels> levels_;
  AlignedBuffer<FollowedPoint> followed_;  // of each feature to follow
};

}  // namespace haustra::kernels
