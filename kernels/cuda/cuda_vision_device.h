// The vision device on an NVIDIA GPU: the same interface, masks, selection and order as the CPU device's, and the same
// matches to the bit for the same descriptors. Keypoints and descriptors of an image agree with the CPU device's up to
// rounding (kernels/cuda/decisions has the figures), and repeat to the bit from run to run.
//
// All memory is taken at construction: one block on the device, one pinned on the host. Work of the tracking lane runs
// at the highest priority that the GPU has, that of the background lane at the lowest. Each lane holds kQueueLength
// requests of matching; to queue more waits for the oldest. One extraction a lane: to queue another, or to match after
// it, waits for it.
//
// Any CUDA error but lack of memory at construction makes the device useless for good: every call answers kUnavailable
// from then on, and the caller goes on with another device.
#pragma once

#include <memory>

#include "hal/core/memory_plan.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"
#include "kernels/cuda/device_limits.h"
#include "kernels/cuda/extractor.h"
#include "kernels/cuda/match_kernels.h"

namespace haustra {

struct CudaDeviceOptions {
  int device = 0;  // of those that CUDA sees
  kernels::cuda::DotProduct dot_product = kernels::cuda::DotProduct::kTensorCores;
};

// What measurements ask of the device beyond the interface.
class CudaVisionDevice : public VisionDevice {
 public:
  static constexpr int kQueueLength = 16;

  // Median time of each step of extraction on the last image of the lane.
  virtual Status MeasureExtractionSteps(
      Lane lane, int repeats,
      std::span<kernels::cuda::Extractor::StepTime, kernels::cuda::Extractor::kNumSteps> out) = 0;
  // Median and 99th percentile time on the device of one matching of the first num_query features of the sets from
  // query_set on against the first num_train features from train_set on, across sets, in microseconds; of many that
  // follow one another as one graph. The sets' memory is used as it is, whether written or not.
  virtual Status MeasureMatching(std::int64_t num_query, std::int64_t num_train, bool mutual, int repeats,
                                 double* median_us, double* p99_us) = 0;
  virtual Status MeasureLimits(kernels::cuda::DeviceLimits* limits) = 0;
};

// What the device will take; needs no GPU. The driver's own memory (context, code) is not in it. kInvalidArgument: plan
// or options out of range.
Result<MemoryPlan> PlanCudaVisionDevice(const VisionPlan& plan, const ExtractOptions& options);

// All kernels are loaded when the first device is made, not each when it is first asked for, which takes milliseconds
// in the middle of a procedure. By an environment variable of the driver, which is not touched where it is set. Before
// anything else of CUDA, and while the process has one thread.
void LoadCudaKernelsEagerly();

// Of this build and this machine.
bool HasCudaDevice();

// kUnavailable: no CUDA device, or no driver. kInvalidArgument: plan or options out of range. kCapacityExceeded: not
// enough memory.
Result<std::unique_ptr<CudaVisionDevice>> CreateCudaVisionDevice(const VisionPlan& plan, const ExtractOptions& options,
                                                                 const CudaDeviceOptions& device_options = {});

}  // namespace haustra
