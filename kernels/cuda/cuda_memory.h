// Blocks of memory that are taken once: on the device, and pinned on the host where the device sees them too.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstring>

#include "hal/core/status.h"
#include "kernels/cuda/cuda_status.h"

namespace haustra::kernels::cuda {

class DeviceBlock {
 public:
  DeviceBlock() = default;
  ~DeviceBlock() { (void)cudaFree(data_); }
  DeviceBlock(const DeviceBlock&) = delete;
  DeviceBlock& operator=(const DeviceBlock&) = delete;

  // Zeroed. Once. kCapacityExceeded: not enough memory.
  Status Allocate(std::size_t num_bytes) {
    HAUSTRA_TRY(ToStatus(cudaMalloc(reinterpret_cast<void**>(&data_), num_bytes), "device memory"));
    return ToStatus(cudaMemset(data_, 0, num_bytes), "clearing device memory");
  }
  std::byte* data() const { return data_; }

 private:
  std::byte* data_ = nullptr;
};

class PinnedBlock {
 public:
  PinnedBlock() = default;
  ~PinnedBlock() { (void)cudaFreeHost(data_); }
  PinnedBlock(const PinnedBlock&) = delete;
  PinnedBlock& operator=(const PinnedBlock&) = delete;

  // Zeroed. Once. kCapacityExceeded: not enough memory.
  Status Allocate(std::size_t num_bytes) {
    HAUSTRA_TRY(ToStatus(
        cudaHostAlloc(reinterpret_cast<void**>(&data_), num_bytes, cudaHostAllocMapped | cudaHostAllocPortable),
        "pinned memory"));
    std::memset(data_, 0, num_bytes);
    return ToStatus(cudaHostGetDevicePointer(reinterpret_cast<void**>(&device_data_), data_, 0), "mapped memory");
  }
  std::byte* data() const { return data_; }
  std::byte* device_data() const { return device_data_; }  // the same memory as the device sees it

 private:
  std::byte* data_ = nullptr;
  std::byte* device_data_ = nullptr;
};

}  // namespace haustra::kernels::cuda
