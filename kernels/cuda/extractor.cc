#include "kernels/cuda/extractor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "kernels/cuda/cuda_status.h"
#include "kernels/cuda/extract_kernels.h"
#include "kernels/cuda/scale_space_layout.h"

namespace haustra::kernels::cuda {
namespace {

constexpr int kPixelsPerLoad = 16;

int AlignUp(int size, int alignment) { return (size + alignment - 1) / alignment * alignment; }

}  // namespace

Result<std::unique_ptr<Extractor>> Extractor::Create(const VisionPlan& plan, const ExtractOptions& options,
                                                     const ExtractMemory& memory, const SetBuffers& sets,
                                                     cudaStream_t stream, int branch_priority) {
  std::unique_ptr<Extractor> extractor(new Extractor(options, memory, sets, stream));
  HAUSTRA_TRY(extractor->Prepare(branch_priority));
  HAUSTRA_TRY(extractor->SetSource(plan.max_width_px, plan.max_height_px, PixelFormat::kGrey8,
                                   AlignUp(plan.max_width_px, kPixelsPerLoad)));
  return extractor;
}

Extractor::Extractor(const ExtractOptions& options, const ExtractMemory& memory, const SetBuffers& sets,
                     cudaStream_t stream)
    : memory_(memory),
      buffers_(memory.buffers),
      sets_(sets),
      output_{memory.keypoints.device, memory.num_features.device, memory.num_detected.device, memory.done.device},
      stream_(stream) {
  settings_.contrast_threshold =
      options.contrast_threshold > 0.0f ? options.contrast_threshold : kDefaultContrastThreshold;
  settings_.edge_threshold = options.edge_threshold;
  settings_.reflection_threshold = options.reflection_threshold;
  settings_.border_threshold = options.border_threshold;
  settings_.mask_dilation_px = options.mask_dilation_px;
  settings_.num_features = options.num_features;
  settings_.root_sift = options.root_sift ? 1 : 0;
  settings_.upright_dark = options.upright_dark ? 1 : 0;
}

Extractor::~Extractor() {
  (void)cudaStreamSynchronize(stream_);
  if (graph_ != nullptr) (void)cudaGraphExecDestroy(graph_);
  if (graph_source_ != nullptr) (void)cudaGraphDestroy(graph_source_);
  for (cudaEvent_t event : ingested_) {
    if (event != nullptr) (void)cudaEventDestroy(event);
  }
  if (is_level_zero_made_ != nullptr) (void)cudaEventDestroy(is_level_zero_made_);
  for (Branch& branch : branches_) {
    if (branch.done != nullptr) (void)cudaEventDestroy(branch.done);
    if (branch.stream != nullptr) (void)cudaStreamDestroy(branch.stream);
  }
}

Status Extractor::Prepare(int branch_priority) {
  bool can_launch_early = false;
  HAUSTRA_TRY(ToStatus(CanLaunchEarly(&can_launch_early), "attributes of a kernel"));
  settings_.can_launch_early = can_launch_early ? 1 : 0;
  int main_priority = 0;
  HAUSTRA_TRY(ToStatus(cudaStreamGetPriority(stream_, &main_priority), "priority of the stream"));
  for (int i = 0; i < kNumBranches; ++i) {
    Branch& branch = branches_[i];
    const int priority = i < kFirstFineBranch ? branch_priority : main_priority;
    HAUSTRA_TRY(ToStatus(cudaStreamCreateWithPriority(&branch.stream, cudaStreamNonBlocking, priority), "stream"));
    HAUSTRA_TRY(ToStatus(cudaEventCreateWithFlags(&branch.done, cudaEventDisableTiming), "event"));
  }
  for (cudaEvent_t& event : ingested_) {
    HAUSTRA_TRY(ToStatus(cudaEventCreateWithFlags(&event, cudaEventDisableTiming), "event"));
  }
  HAUSTRA_TRY(ToStatus(cudaEventCreateWithFlags(&is_level_zero_made_, cudaEventDisableTiming), "event"));
  std::vector<BandWeights> weights;
  for (int i = 0; i < kNumBandSources; ++i) weights.push_back(MakeBandWeights(static_cast<BandSource>(i)));
  HAUSTRA_TRY(ToStatus(
      cudaMemcpy(memory_.band_weights, weights.data(), weights.size() * sizeof(BandWeights), cudaMemcpyHostToDevice),
      "weights of the blur"));
  return ToStatus(PrepareOctaves(), "kernels of the octaves");
}

Status Extractor::SetSource(int width_px, int height_px, PixelFormat format, std::int64_t pitch_bytes) {
  const bool is_same_size = graph_ != nullptr && width_px == layout_.width && height_px == layout_.height;
  if (is_same_size && format == layout_.format && pitch_bytes == layout_.pitch_bytes) return Status::Ok();
  if (!is_same_size) {
    layout_ = MakeLayout(width_px, height_px);
    has_levels_ = false;
  }
  layout_.format = format;
  layout_.pitch_bytes = pitch_bytes;
  return Capture();
}

// Rows are shared out evenly.
RowRange Extractor::BandOf(int band) const {
  const auto begin_of = [&](int b) { return layout_.height * b / kNumBands; };
  return {begin_of(band), begin_of(band + 1)};
}

#define HAUSTRA_CUDA_TRY(expression) \
  if (const cudaError_t error = (expression); error != cudaSuccess) return error

// During capture; remembers the node.
cudaError_t Extractor::LaunchIngestOf(int band) {
  HAUSTRA_CUDA_TRY(LaunchIngest(layout_, settings_, buffers_, frame_, BandOf(band), stream_));
  cudaStreamCaptureStatus status{};
  const cudaGraphNode_t* last_nodes = nullptr;
  std::size_t num_last_nodes = 0;
#if CUDART_VERSION >= 13000
  HAUSTRA_CUDA_TRY(cudaStreamGetCaptureInfo(stream_, &status, nullptr, nullptr, &last_nodes, nullptr, &num_last_nodes));
#else
  HAUSTRA_CUDA_TRY(cudaStreamGetCaptureInfo_v2(stream_, &status, nullptr, nullptr, &last_nodes, &num_last_nodes));
#endif
  if (num_last_nodes != 1) return cudaErrorUnknown;
  ingest_nodes_[band] = last_nodes[0];
  return cudaEventRecord(ingested_[band], stream_);
}

// The tiles of octaves 1 and 2 do not wait for level 0 of the coarser ones: they have a stream of their own. The few
// blocks of the coarser ones, of which one waits for the other, are the longest way: they find room early.
cudaError_t Extractor::LaunchCoarse(cudaStream_t stream, cudaStream_t coarsest_stream) {
  if (layout_.num_octaves <= kFirstCoarseSlot) return cudaSuccess;
  constexpr int kFirstCoarsestSlot = kFirstCoarseSlot + 2;
  HAUSTRA_CUDA_TRY(LaunchLevelZero(layout_, settings_, buffers_, kFirstCoarseSlot, false, coarsest_stream));
  HAUSTRA_CUDA_TRY(cudaEventRecord(is_level_zero_made_, coarsest_stream));
  HAUSTRA_CUDA_TRY(cudaStreamWaitEvent(stream, is_level_zero_made_, 0));
  if (layout_.num_octaves > kFirstCoarsestSlot) {
    for (int slot = kFirstCoarsestSlot; slot < layout_.num_octaves; slot += 2) {
      HAUSTRA_CUDA_TRY(LaunchLevelZero(layout_, settings_, buffers_, slot, true, coarsest_stream));
    }
    HAUSTRA_CUDA_TRY(LaunchCoarseOctaves(layout_, settings_, buffers_, kFirstCoarsestSlot, layout_.num_octaves, true,
                                         coarsest_stream));
  }
  return LaunchCoarseOctaves(layout_, settings_, buffers_, kFirstCoarseSlot,
                             std::min(kFirstCoarsestSlot, layout_.num_octaves), false, stream);
}

cudaError_t Extractor::LaunchAll() {
  // Bands do not wait for one another, so their users wait for all up to theirs.
  const auto begin = [&](int branch, int band) {
    cudaError_t error = cudaSuccess;
    for (int b = 0; b <= band && error == cudaSuccess; ++b) {
      error = cudaStreamWaitEvent(branches_[branch].stream, ingested_[b], 0);
    }
    return error;
  };
  const auto end = [&](int branch) { return cudaEventRecord(branches_[branch].done, branches_[branch].stream); };

  for (int band = 0; band < kNumBands; ++band) HAUSTRA_CUDA_TRY(LaunchIngestOf(band));
  // The order of capture is the order in which the graph launches what is ready. The coarse octaves go first: their
  // branch is the longest, and their blocks would wait until fine tiles leave them room.
  HAUSTRA_CUDA_TRY(begin(kCoarseBranch, kNumBands - 1));
  HAUSTRA_CUDA_TRY(begin(kCoarsestBranch, kNumBands - 1));
  HAUSTRA_CUDA_TRY(LaunchCoarse(branches_[kCoarseBranch].stream, branches_[kCoarsestBranch].stream));
  HAUSTRA_CUDA_TRY(end(kCoarseBranch));
  HAUSTRA_CUDA_TRY(end(kCoarsestBranch));
  // Nobody waits for the fine octaves of a band but the frame; the others need the whole picture.
  for (int band = 0; band < kNumBands; ++band) {
    const int zero = kFirstFineBranch + 2 * band;
    HAUSTRA_CUDA_TRY(begin(zero, band));
    HAUSTRA_CUDA_TRY(LaunchOctaveZero(layout_, settings_, buffers_, BandOf(band), branches_[zero].stream));
    HAUSTRA_CUDA_TRY(end(zero));
    const int finest = zero + 1;
    HAUSTRA_CUDA_TRY(begin(finest, band));
    HAUSTRA_CUDA_TRY(LaunchFinestOctave(layout_, settings_, buffers_, BandOf(band), branches_[finest].stream));
    HAUSTRA_CUDA_TRY(end(finest));
  }
  HAUSTRA_CUDA_TRY(begin(kMaskBranch, kNumBands - 1));
  HAUSTRA_CUDA_TRY(LaunchMasks(layout_, settings_, buffers_, branches_[kMaskBranch].stream));
  HAUSTRA_CUDA_TRY(end(kMaskBranch));

  for (const Branch& branch : branches_) HAUSTRA_CUDA_TRY(cudaStreamWaitEvent(stream_, branch.done, 0));
  HAUSTRA_CUDA_TRY(LaunchRefinement(layout_, settings_, buffers_, stream_));
  HAUSTRA_CUDA_TRY(LaunchPriorities(layout_, settings_, buffers_, stream_));
  HAUSTRA_CUDA_TRY(LaunchOrientations(layout_, settings_, buffers_, stream_));
  HAUSTRA_CUDA_TRY(LaunchDescriptors(layout_, settings_, buffers_, sets_, output_, stream_));
  return cudaSuccess;
}
#undef HAUSTRA_CUDA_TRY

Status Extractor::Capture() {
  if (graph_ != nullptr) (void)cudaGraphExecDestroy(graph_);
  graph_ = nullptr;
  HAUSTRA_TRY(ToStatus(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "capture of the graph"));
  frame_ = memory_.picture.device;
  const cudaError_t launched = LaunchAll();
  cudaGraph_t graph = nullptr;
  const cudaError_t ended = cudaStreamEndCapture(stream_, &graph);
  HAUSTRA_TRY(ToStatus(launched, "launch of the extraction"));
  HAUSTRA_TRY(ToStatus(ended, "capture of the graph"));
  const cudaError_t instantiated =
      cudaGraphInstantiateWithFlags(&graph_, graph, cudaGraphInstantiateFlagUseNodePriority);
  if (graph_source_ != nullptr) (void)cudaGraphDestroy(graph_source_);
  graph_source_ = graph;  // nodes are named by it
  HAUSTRA_TRY(ToStatus(instantiated, "graph of the extraction"));
  return ToStatus(cudaGraphUpload(graph_, stream_), "graph of the extraction");
}

Status Extractor::SetStaticMask(const ImageView& mask) {
  const int had_mask = settings_.has_static_mask;
  settings_.has_static_mask = mask.is_empty() ? 0 : 1;
  if (!mask.is_empty()) {
    const ScaleSpaceLayout layout = MakeLayout(mask.width, mask.height);
    HAUSTRA_TRY(ToStatus(cudaMemcpy2DAsync(buffers_.static_mask, layout.grey_pitch, mask.data, mask.pitch_bytes,
                                           mask.width, mask.height, cudaMemcpyHostToDevice, stream_),
                         "static mask"));
    HAUSTRA_TRY(ToStatus(cudaStreamSynchronize(stream_), "static mask"));
  }
  return had_mask == settings_.has_static_mask ? Status::Ok() : Capture();
}

const std::uint8_t* Extractor::Place(const ImageView& image, std::int64_t* pitch_bytes) {
  const std::size_t row_bytes = static_cast<std::size_t>(image.width) * BytesPerPixel(image.format);
  const int pitch = AlignUp(image.width, kPixelsPerLoad) * BytesPerPixel(image.format);
  if (image.width % kPixelsPerLoad == 0 && image.pitch_bytes % 16 == 0 &&
      reinterpret_cast<std::uintptr_t>(image.data) % 16 == 0) {
    cudaPointerAttributes attributes{};
    const bool is_known = cudaPointerGetAttributes(&attributes, image.data) == cudaSuccess;
    if (!is_known) (void)cudaGetLastError();
    if (is_known && attributes.type == cudaMemoryTypeHost && attributes.devicePointer != nullptr) {
      *pitch_bytes = image.pitch_bytes;
      return static_cast<const std::uint8_t*>(attributes.devicePointer);
    }
  }
  *pitch_bytes = pitch;
  if (image.pitch_bytes == pitch) {
    std::memcpy(memory_.picture.host, image.data, static_cast<std::size_t>(pitch) * (image.height - 1) + row_bytes);
  } else {
    for (int y = 0; y < image.height; ++y) {
      std::memcpy(memory_.picture.host + static_cast<std::size_t>(y) * pitch, image.row(y), row_bytes);
    }
  }
  return memory_.picture.device;
}

Status Extractor::Enqueue(const ImageView& image, std::uint32_t set_index, int max_features,
                          std::span<const Keypoint> follow, int num_only_followed) {
  std::int64_t pitch_bytes = 0;
  const std::uint8_t* frame = Place(image, &pitch_bytes);
  HAUSTRA_TRY(SetSource(image.width, image.height, image.format, pitch_bytes));
  const int num_wanted = max_features > 0 ? std::min(max_features, settings_.num_features) : settings_.num_features;
  const float points_per_halving =
      kSharesPerHalving * static_cast<float>(num_wanted) / static_cast<float>(layout_.num_cells);
  *memory_.params.host = {set_index, num_wanted, 1.0f / points_per_halving, ++number_};
  if (frame != frame_) {
    for (const cudaGraphNode_t node : ingest_nodes_) {
      HAUSTRA_TRY(ToStatus(SetFrameOfIngest(graph_, node, frame), "source of the frame"));
    }
    frame_ = frame;
  }
  const bool follows = has_levels_ && !follow.empty();
  num_follow_ = follows ? static_cast<int>(follow.size()) : 0;
  if (follows) {
    std::copy(follow.begin(), follow.end(), memory_.follow.host);
    HAUSTRA_TRY(ToStatus(KeepLevels(layout_, buffers_, stream_), "levels of the last picture"));
  }
  HAUSTRA_TRY(ToStatus(cudaGraphLaunch(graph_, stream_), "launch of the extraction"));
  has_levels_ = true;
  if (!follows) return Status::Ok();
  const FollowList list = {memory_.follow.device, memory_.followed_to.device, num_follow_, num_only_followed};
  return ToStatus(LaunchFollow(layout_, settings_, buffers_, sets_, output_, list, ++number_, stream_),
                  "launch of the optical flow");
}

Status Extractor::MeasureSteps(int repeats, std::span<StepTime, kNumSteps> out) {
  const RowRange all = {0, layout_.height};
  const auto run = [&](int step) -> cudaError_t {
    switch (step) {
      case 0: return LaunchIngest(layout_, settings_, buffers_, frame_, all, stream_);
      case 1: return LaunchMasks(layout_, settings_, buffers_, stream_);
      case 2: return LaunchCoarse(stream_, stream_);
      case 3: return LaunchOctaveZero(layout_, settings_, buffers_, all, stream_);
      case 4: return LaunchFinestOctave(layout_, settings_, buffers_, all, stream_);
      case 5: return LaunchRefinement(layout_, settings_, buffers_, stream_);
      case 6: return LaunchPriorities(layout_, settings_, buffers_, stream_);
      case 7: return LaunchOrientations(layout_, settings_, buffers_, stream_);
      default: return LaunchDescriptors(layout_, settings_, buffers_, sets_, output_, stream_);
    }
  };
  static constexpr const char* kNames[kNumSteps] = {"ingest",     "masks",        "coarse octaves",
                                                    "octave 0",   "octave -1",    "refinement",
                                                    "priorities", "orientations", "descriptors"};
  cudaEvent_t events[kNumSteps + 1] = {};
  Status status;
  for (cudaEvent_t& event : events) {
    if (status.ok()) status = ToStatus(cudaEventCreate(&event), "event");
  }
  std::vector<std::vector<float>> times(kNumSteps);
  for (int i = 0; i < repeats && status.ok(); ++i) {
    // All steps of a frame in order, so that each finds what it needs.
    cudaError_t error = cudaEventRecord(events[0], stream_);
    for (int step = 0; step < kNumSteps && error == cudaSuccess; ++step) {
      error = run(step);
      if (error == cudaSuccess) error = cudaEventRecord(events[step + 1], stream_);
    }
    if (error == cudaSuccess) error = cudaStreamSynchronize(stream_);
    for (int step = 0; step < kNumSteps && error == cudaSuccess; ++step) {
      float ms = 0.0f;
      error = cudaEventElapsedTime(&ms, events[step], events[step + 1]);
      times[step].push_back(1e3f * ms);
    }
    status = ToStatus(error, "measurement of the steps");
  }
  for (cudaEvent_t event : events) {
    if (event != nullptr) (void)cudaEventDestroy(event);
  }
  HAUSTRA_TRY(status);
  for (int step = 0; step < kNumSteps; ++step) {
    std::nth_element(times[step].begin(), times[step].begin() + times[step].size() / 2, times[step].end());
    out[step] = {kNames[step], times[step][times[step].size() / 2]};
  }
  return Status::Ok();
}

}  // namespace haustra::kernels::cuda
