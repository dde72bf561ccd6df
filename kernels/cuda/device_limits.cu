#include "kernels/cuda/device_limits.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace haustra::kernels::cuda {
namespace {

constexpr int kThreads = 256;
constexpr int kRepeats = 5;
constexpr std::size_t kCopyBytes = std::size_t{512} << 20;
constexpr std::size_t kHostBytes = std::size_t{32} << 20;

__global__ void EmptyKernel() {}

__global__ void __launch_bounds__(kThreads) ReadKernel(const uint4* from, uint4* to, std::size_t count) {
  const std::size_t i = static_cast<std::size_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (i < count) to[i] = from[i];
}

// What the tensor cores multiply: halves into floats, bytes into integers.
struct HalfProduct {
  using Sum = float;
  static __device__ void Add(std::uint32_t operand, float (&sum)[4]) {
    asm volatile(
        "mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %4, %4, %4}, {%4, %4}, "
        "{%0, %1, %2, %3};"
        : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
        : "r"(operand));
  }
};

struct ByteProduct {
  using Sum = int;
  static __device__ void Add(std::uint32_t operand, int (&sum)[4]) {
    asm volatile(
        "mma.sync.aligned.m16n8k32.row.col.s32.u8.u8.s32 {%0, %1, %2, %3}, {%4, %4, %4, %4}, {%4, %4}, "
        "{%0, %1, %2, %3};"
        : "+r"(sum[0]), "+r"(sum[1]), "+r"(sum[2]), "+r"(sum[3])
        : "r"(operand));
  }
};

// Products of fragments in registers, in chains that do not depend on one another. The result is written so that they
// are not left out.
constexpr int kChains = 8;
constexpr int kProducts = 2000;  // of each chain

template <typename Product>
__global__ void __launch_bounds__(kThreads) ProductsKernel(typename Product::Sum* out, std::uint32_t operand) {
  typename Product::Sum sums[kChains][4] = {};
  for (int i = 0; i < kProducts; ++i) {
#pragma unroll
    for (auto& sum : sums) Product::Add(operand, sum);
  }
  typename Product::Sum total = 0;
  for (const auto& sum : sums) total += sum[0] + sum[1] + sum[2] + sum[3];
  out[blockIdx.x * kThreads + threadIdx.x] = total;
}

// Shortest time of what `launch` queues, in seconds, after a first time that does not count.
template <typename Launch>
cudaError_t Time(const Launch& launch, double* seconds) {
  cudaEvent_t begin = nullptr;
  cudaEvent_t end = nullptr;
  cudaError_t error = cudaEventCreate(&begin);
  if (error == cudaSuccess) error = cudaEventCreate(&end);
  *seconds = 1e9;
  for (int i = 0; i <= kRepeats && error == cudaSuccess; ++i) {
    error = cudaEventRecord(begin);
    if (error == cudaSuccess) error = launch();
    if (error == cudaSuccess) error = cudaEventRecord(end);
    if (error == cudaSuccess) error = cudaEventSynchronize(end);
    float ms = 0.0f;
    if (error == cudaSuccess) error = cudaEventElapsedTime(&ms, begin, end);
    if (i > 0) *seconds = std::min(*seconds, 1e-3 * ms);
  }
  if (begin != nullptr) (void)cudaEventDestroy(begin);
  if (end != nullptr) (void)cudaEventDestroy(end);
  return error;
}

cudaError_t TimeEmptyKernel(double* median_us) {
  std::vector<double> times;
  for (int i = 0; i < 500; ++i) {
    const auto before = std::chrono::steady_clock::now();
    EmptyKernel<<<1, 32>>>();
    if (const cudaError_t error = cudaDeviceSynchronize(); error != cudaSuccess) return error;
    times.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - before).count());
  }
  std::nth_element(times.begin(), times.begin() + times.size() / 2, times.end());
  *median_us = times[times.size() / 2];
  return cudaSuccess;
}

cudaError_t Measure(std::uint8_t* device, std::uint8_t* host, DeviceLimits* limits) {
  int index = 0;
  int num_processors = 0;
  cudaError_t error = cudaGetDevice(&index);
  if (error == cudaSuccess) error = cudaDeviceGetAttribute(&num_processors, cudaDevAttrMultiProcessorCount, index);
  if (error == cudaSuccess) error = TimeEmptyKernel(&limits->launch_and_wait_us);
  double seconds = 0.0;
  if (error == cudaSuccess) {
    error = Time([&] { return cudaMemcpyAsync(device + kCopyBytes, device, kCopyBytes, cudaMemcpyDeviceToDevice); },
                 &seconds);
  }
  limits->copy_gb_per_s = 1e-9 * 2 * kCopyBytes / seconds;
  if (error == cudaSuccess) {
    error = Time(
        [&] {
          constexpr std::size_t kCount = kHostBytes / sizeof(uint4);
          ReadKernel<<<kCount / kThreads, kThreads>>>(reinterpret_cast<const uint4*>(host),
                                                      reinterpret_cast<uint4*>(device), kCount);
          return cudaGetLastError();
        },
        &seconds);
  }
  limits->host_read_gb_per_s = 1e-9 * kHostBytes / seconds;
  const int num_blocks = 4 * num_processors;
  const double num_products = static_cast<double>(num_blocks) * (kThreads / 32) * kChains * kProducts;
  if (error == cudaSuccess) {
    error = Time(
        [&] {
          ProductsKernel<HalfProduct><<<num_blocks, kThreads>>>(reinterpret_cast<float*>(device), 0x3c003c00u);
          return cudaGetLastError();
        },
        &seconds);
  }
  limits->half_tera_ops_per_s = 1e-12 * num_products * 2 * 16 * 8 * 16 / seconds;
  if (error == cudaSuccess) {
    error = Time(
        [&] {
          ProductsKernel<ByteProduct><<<num_blocks, kThreads>>>(reinterpret_cast<int*>(device), 0x01010101u);
          return cudaGetLastError();
        },
        &seconds);
  }
  limits->byte_tera_ops_per_s = 1e-12 * num_products * 2 * 16 * 8 * 32 / seconds;
  return error;
}

}  // namespace

cudaError_t MeasureDeviceLimits(DeviceLimits* limits) {
  std::uint8_t* device = nullptr;
  void* host = nullptr;
  cudaError_t error = cudaMalloc(reinterpret_cast<void**>(&device), 2 * kCopyBytes);
  if (error == cudaSuccess) error = cudaHostAlloc(&host, kHostBytes, cudaHostAllocMapped);
  if (error == cudaSuccess) error = cudaMemset(device, 0, 2 * kCopyBytes);
  if (error == cudaSuccess) error = Measure(device, static_cast<std::uint8_t*>(host), limits);
  if (device != nullptr) (void)cudaFree(device);
  if (host != nullptr) (void)cudaFreeHost(host);
  return error;
}

}  // namespace haustra::kernels::cuda
