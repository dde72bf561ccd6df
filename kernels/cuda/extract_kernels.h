// The steps of extraction as launches on a stream; each returns what the launch returned.
#pragma once

#include <cuda_runtime_api.h>

#include "kernels/cuda/extract_buffers.h"

namespace haustra::kernels::cuda {

// From the frame on the device: grey, counters to zero, dark ends of the rows.
cudaError_t LaunchIngest(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                         cudaStream_t stream);
// Bits of the exclusion masks of all octaves, undilated.
cudaError_t LaunchMasks(const ScaleSpaceLayout& layout, const ExtractSettings& settings, const ExtractBuffers& buffers,
                        cudaStream_t stream);

// Level 0 of the enlarged input and of octave 0, both from the grey image.
cudaError_t LaunchFirstLevels(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, cudaStream_t stream);
// Level 0 of octave slot `slot` (>= 2) from that of the octave before.
cudaError_t LaunchNextOctave(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int slot,
                             cudaStream_t stream);
// `level` (>= 1) of the octave slots [first_slot, last_slot) from the level before.
cudaError_t LaunchLevel(const ScaleSpaceLayout& layout, const ExtractBuffers& buffers, int level, int first_slot,
                        int last_slot, cudaStream_t stream);

cudaError_t LaunchExtrema(const ScaleSpaceLayout& layout, const ExtractSettings& settings,
                          const ExtractBuffers& buffers, cudaStream_t stream);
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

}  // namespace haustra::kernels::cuda
