#include <memory>

#include "kernels/cuda/cuda_vision_device.h"
#include "tests/kernels/cuda_device_present.h"
#include "tests/kernels/vision_device_contract.h"

namespace haustra::testing {
namespace {

using kernels::cuda::DotProduct;

DeviceUnderTest Cuda(const std::string& name, DotProduct dot_product) {
  return {
      name,
      [dot_product](const VisionPlan& plan, const ExtractOptions& options) -> Result<std::unique_ptr<VisionDevice>> {
        HAUSTRA_ASSIGN(std::unique_ptr<VisionDevice> device, CreateCudaVisionDevice(plan, options, {0, dot_product}));
        return device;
      }};
}

// Without a device every test of the suite is left out, by name; with one, all run.
std::vector<DeviceUnderTest> Devices() {
  if (!IsCudaDevicePresent()) return {};
  return {Cuda("TensorCores", DotProduct::kTensorCores), Cuda("Dp4a", DotProduct::kDp4a)};
}

INSTANTIATE_TEST_SUITE_P(Cuda, VisionDeviceContract, ::testing::ValuesIn(Devices()), NameOfDevice);

TEST(CudaVisionDeviceContract, RunsWhereThereIsADevice) {
  if (!IsCudaDevicePresent()) GTEST_SKIP() << NoCudaDeviceReason();
  EXPECT_EQ(Devices().size(), 2u);
}

}  // namespace
}  // namespace haustra::testing
