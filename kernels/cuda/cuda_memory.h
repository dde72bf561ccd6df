// Blocks of memory that are taken once: on the device, and pinned on the host where the device sees them too.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <type_traits>
#include <utility>

#include "hal/core/status.h"
#include "kernels/cuda/cuda_status.h"

namespace haustra::kernels::cuda {

template <typename T>
class DeviceBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  DeviceBuffer() = default;
  ~DeviceBuffer() { (void)cudaFree(data_); }
  DeviceBuffer(DeviceBuffer&& other) noexcept { *this = std::move(other); }
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    return *this;
  }

  // Zeroed. Once.
  Status Allocate(std::size_t size) {
    const std::size_t num_bytes = (size > 0 ? size : 1) * sizeof(T);
    HAUSTRA_TRY(ToStatus(cudaMalloc(reinterpret_cast<void**>(&data_), num_bytes), "device memory"));
    return ToStatus(cudaMemset(data_, 0, num_bytes), "clearing device memory");
  }
  T* data() const { return data_; }

 private:
  T* data_ = nullptr;
};

template <typename T>
class PinnedBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  PinnedBuffer() = default;
  ~PinnedBuffer() { (void)cudaFreeHost(data_); }
  PinnedBuffer(PinnedBuffer&& other) noexcept { *this = std::move(other); }
  PinnedBuffer& operator=(PinnedBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(device_data_, other.device_data_);
    return *this;
  }

  // Uninitialised. Once.
  Status Allocate(std::size_t size) {
    const std::size_t num_bytes = (size > 0 ? size : 1) * sizeof(T);
    HAUSTRA_TRY(ToStatus(
        cudaHostAlloc(reinterpret_cast<void**>(&data_), num_bytes, cudaHostAllocMapped | cudaHostAllocPortable),
        "pinned memory"));
    return ToStatus(cudaHostGetDevicePointer(reinterpret_cast<void**>(&device_data_), data_, 0), "mapped memory");
  }
  T* data() const { return data_; }
  T* device_data() const { return device_data_; }  // the same memory as the device sees it

 private:
  T* data_ = nullptr;
  T* device_data_ = nullptr;
};

}  // namespace haustra::kernels::cuda
