#include "kernels/cpu/cpu_vision_device.h"
#include "tests/kernels/vision_device_contract.h"

namespace haustra::testing {
namespace {

DeviceUnderTest Cpu(const std::string& name, int num_threads) {
  return {name, [num_threads](const VisionPlan& plan, const ExtractOptions& options) {
            return CreateCpuVisionDevice(plan, options, num_threads);
          }};
}

DeviceUnderTest PortableCpu() {
  return {"Portable", [](const VisionPlan& plan, const ExtractOptions& options) {
            return CreateCpuVisionDevice(plan, options, 1, kernels::SimdLevel::kPortable);
          }};
}

INSTANTIATE_TEST_SUITE_P(Cpu, VisionDeviceContract,
                         ::testing::Values(Cpu("OneThread", 1), Cpu("ThreeThreads", 3), PortableCpu()), NameOfDevice);

}  // namespace
}  // namespace haustra::testing
