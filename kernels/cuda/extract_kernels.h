// The steps of extraction as launches on a stream; each returns what the launch returned.
#pragma once

#include <cuda_runtime_api.h>

#include "kernels/cuda/extract_buffers.h"

namespace haustra::kernels::cuda {

// Whether the kernels of the device at hand were compiled so that they may be launched early (kernel_launch.cuh). Made
// from the PTX of an older architecture they were not, whatever the device.
cudaError_t CanLaunchEarly(bool* can);

// A band of the frame in pinned host memory to grey. With the first one, counters become zero and the frame's
// parameters are taken over.
cudaError_t LaunchIngest(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                         const std::uint8_t* frame, const RowRange& rows, cudaStream_t stream);
// Makes an instantiated graph take the frame from elsewhere. node: one that LaunchIngest was captured as.
cudaError_t SetFrameOfIngest(cudaGraphExec_t graph, cudaGraphNode_t node, const std::uint8_t* frame);
// Bits of the exclusion masks of all octaves, and dilated.
cudaError_t LaunchMasks(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                        cudaStream_t stream);

// Must be called once before the first launch.
cudaError_t PrepareOctaves();
// Levels and extrema of octaves -1 and 0, from the grey image: the tiles that its rows up to rows.end suffice for, less
// those that rows.begin sufficed for.
cudaError_t LaunchFinestOctave(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                               const ExtractBuffers& buffers, const RowRange& rows, cudaStream_t stream);
cudaError_t LaunchOctaveZero(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, const RowRange& rows, cudaStream_t stream);
// Level 0 of the octave of a slot, and of the one after it if there is one: of kFirstCoarseSlot from the grey image, of
// those two, four, ... slots on from level 0 of the octave before. is_behind, here and below: the kernel that makes
// what is needed comes right before on the stream.
cudaError_t LaunchLevelZero(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                            const ExtractBuffers& buffers, int slot, bool is_behind, cudaStream_t stream);
// Levels and extrema of the octaves of slots [first_slot, end_slot), at least one, from their level 0.
cudaError_t LaunchCoarseOctaves(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                                const ExtractBuffers& buffers, int first_slot, int end_slot, bool is_behind,
                                cudaStream_t stream);

cudaError_t LaunchRefinement(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, cudaStream_t stream);
// Ranks inside the cells, priorities, and the list of points that may be selected.
cudaError_t LaunchPriorities(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                             const ExtractBuffers& buffers, cudaStream_t stream);
// Ranks among those, and orientations of the selected ones.
cudaError_t LaunchOrientations(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                               const ExtractBuffers& buffers, cudaStream_t stream);
// The limit, places in the output, descriptors, keypoints.
cudaError_t LaunchDescriptors(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                              const ExtractBuffers& buffers, const SetBuffers& sets, const FrameOutput& output,
                              cudaStream_t stream);

// Before the levels of the last picture, of the same layout, are overwritten: keeps them for LaunchFollow.
cudaError_t KeepLevels(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, cudaStream_t stream);
// Features of the picture that was kept, as the device sees them, and where it writes where they are now.
struct FollowList {
  const Keypoint* features;
  FollowedPoint* to;
  int num;
  int num_only_followed;  // the first so many: no features come of them
};
// Behind all the others: follows them (kernels/common/flow_parameters.h), and adds those that detection has not found
// to the set. Tells the host with `number`.
cudaError_t LaunchFollow(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                         const SetBuffers& sets, const FrameOutput& output, const FollowList& list,
                         std::uint32_t number, cudaStream_t stream);

}  // namespace haustra::kernels::cuda
