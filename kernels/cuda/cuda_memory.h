// Blocks of memory that are taken once: on the device, and pinned on the host where the device sees them too. They are
// cleared before they go: whoever is given the memory next finds nothing of a picture. Where the device is lost its
// side cannot be cleared; then the driver does it when the process ends.
#pragma once

#include <cuda_runtime_api.h>
#include <string.h>

#include <cstddef>
#include <cstring>

#include "hal/core/status.h"
#include "kernels/cuda/cuda_status.h"

namespace haustra::kernels::cuda {

class DeviceBlock {
 public:
  DeviceBlock() = default;
  ~DeviceBlock() {
    if (data_ == nullptr) return;
    // Streams that have gone may have left work behind.
    (void)cudaDeviceSynchronize();
    (void)cudaMemset(data_, 0, num_bytes_);
    (void)cudaDeviceSynchronize();
    (void)cudaFree(data_);
  }
  DeviceBlock(const DeviceBlock&) = delete;
  DeviceBlock& operator=(const DeviceBlock&) = delete;

  // Zeroed. Once. kCapacityExceeded: not enough memory.
  Status Allocate(std::size_t num_bytes) {
    HAUSTRA_TRY(ToStatus(cudaMalloc(reinterpret_cast<void**>(&data_), num_bytes), "device memory"));
    num_bytes_ = num_bytes;
    return ToStatus(cudaMemset(data_, 0, num_bytes), "clearing device memory");
  }
  std::byte* data() const { return data_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t num_bytes_ = 0;
};

class PinnedBlock {
 public:
  PinnedBlock() = default;
  ~PinnedBlock() {
    if (data_ == nullptr) return;
    (void)cudaDeviceSynchronize();
    ::explicit_bzero(data_, num_bytes_);
    (void)cudaFreeHost(data_);
  }
  PinnedBlock(const PinnedBlock&) = delete;
  PinnedBlock& operator=(const PinnedBlock&) = delete;

  // Zeroed. Once. kCapacityExceeded: not enough memory.
  Status Allocate(std::size_t num_bytes) {
    HAUSTRA_TRY(ToStatus(
        cudaHostAlloc(reinterpret_cast<void**>(&data_), num_bytes, cudaHostAllocMapped | cudaHostAllocPortable),
        "pinned memory"));
    num_bytes_ = num_bytes;
    std::memset(data_, 0, num_bytes);
    return ToStatus(cudaHostGetDevicePointer(reinterpret_cast<void**>(&device_data_), data_, 0), "mapped memory");
  }
  std::byte* data() const { return data_; }
  std::byte* device_data() const { return device_data_; }  // the same memory as the device sees it

 private:
  std::byte* data_ = nullptr;
  std::byte* device_data_ = nullptr;
  std::size_t num_bytes_ = 0;
};

}  // namespace haustra::kernels::cuda
