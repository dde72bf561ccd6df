// SIFT extraction on the device: one CUDA graph that holds the steps of a frame from the picture in
// host memory to keypoints in host memory, descriptors on the device.
//
// Results repeat to the bit: nothing depends on the order in which blocks run.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <memory>
#include <span>

#include "hal/vision_device.h"
#include "kernels/cuda/device_memory.h"
#include "kernels/cuda/extract_buffers.h"

namespace haustra::kernels::cuda {

// thread-bound(one lane). One frame at a time. Enqueue does not allocate, unless size, format or pitch of the image
// differ from the last one's: the graph is captured again then.
class Extractor {
 public:
  // `memory` is zero; it, the sets and `stream` must outlive the extractor. branch_priority: of the branches of small
  // kernels beside the fine octaves, which would else wait until those leave them room.
  static Result<std::unique_ptr<Extractor>> Create(const VisionPlan& plan, const ExtractOptions& options,
                                                   const ExtractMemory& memory, const SetBuffers& sets,
                                                   cudaStream_t stream, int branch_priority);
  ~Extractor();
  Extractor(const Extractor&) = delete;
  Extractor& operator=(const Extractor&) = delete;

  // Empty: none. Checked by the caller.
  Status SetStaticMask(const ImageView& mask);

  // Queues the extraction into the set; the last one must be done. A picture in pinned memory is read where it lies
  // (its address and pitch must be multiples of 16 bytes, its width of 16 pixels); any other is copied first.
  // max_features: the strongest so many; 0: as planned. follow: features of the last picture; no features come of the
  // first num_only_followed of them.
  Status Enqueue(const ImageView& image, std::uint32_t set_index, int max_features, std::span<const Keypoint> follow,
                 int num_only_followed);

  // Of the last picture; before the first, the plan's.
  int width_px() const { return layout_.width; }
  int height_px() const { return layout_.height; }
  // Nothing is followed from the picture of a frame that was dropped.
  void ForgetPicture() { has_levels_ = false; }
  // What tells of the end of the last frame that was queued; the host's view of the word.
  const DoneWord* done_word() const { return memory_.done.host; }
  std::uint32_t number() const { return number_; }
  // Valid when the work is done.
  std::int32_t num_features() const { return *memory_.num_features.host; }
  std::int32_t num_followed() const { return num_features() - *memory_.num_detected.host; }  // of these, the last ones
  const Keypoint* keypoints() const { return memory_.keypoints.host; }
  // Where the features to follow are; empty: none were followed.
  std::span<const FollowedPoint> followed_to() const {
    return {memory_.followed_to.host, static_cast<std::size_t>(num_follow_)};
  }

  // Time of each step, for measurements: runs the steps of the last size one by one, `repeats` times each, and returns
  // the median in microseconds of each. The last frame's data are used.
  struct StepTime {
    const char* name;
    double median_us;
  };
  static constexpr int kNumSteps = 9;
  Status MeasureSteps(int repeats, std::span<StepTime, kNumSteps> out);

 private:
  Extractor(const ExtractOptions& options, const ExtractMemory& memory, const SetBuffers& sets, cudaStream_t stream);
  Status Prepare(int branch_priority);
  Status SetSource(int width_px, int height_px, PixelFormat format, std::int64_t pitch_bytes);
  Status Capture();
  cudaError_t LaunchAll();
  cudaError_t LaunchIngestOf(int band);
  cudaError_t LaunchCoarse(cudaStream_t stream, cudaStream_t coarsest_stream);
  RowRange BandOf(int band) const;
  const std::uint8_t* Place(const ImageView& image, std::int64_t* pitch_bytes);

  // The picture is taken in so many bands of rows, one after another.
  static constexpr int kNumBands = 2;
  // What runs beside the main line of a frame.
  enum {
    kMaskBranch,
    kCoarseBranch,
    kCoarsestBranch,
    kFirstFineBranch,
    kNumBranches = kFirstFineBranch + 2 * kNumBands
  };
  struct Branch {
    cudaStream_t stream = nullptr;
    cudaEvent_t done = nullptr;
  };

  ExtractSettings settings_;
  ExtractMemory memory_;
  ExtractBuffers buffers_;
  SetBuffers sets_;
  FrameOutput output_;
  cudaStream_t stream_;
  Branch branches_[kNumBranches];
  cudaEvent_t ingested_[kNumBands] = {};
  cudaEvent_t is_level_zero_made_ = nullptr;  // of octaves 1 and 2
  cudaGraph_t graph_source_ = nullptr;
  cudaGraphExec_t graph_ = nullptr;
  cudaGraphNode_t ingest_nodes_[kNumBands] = {};
  const std::uint8_t* frame_ = nullptr;  // where the graph reads the picture, as the device sees it
  std::uint32_t number_ = 0;
  bool has_levels_ = false;  // of a picture of the layout's size
  int num_follow_ = 0;       // features that the last frame followed
  ScaleSpaceLayout layout_;
};

}  // namespace haustra::kernels::cuda
