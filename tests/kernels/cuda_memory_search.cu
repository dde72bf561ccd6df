#include "tests/kernels/cuda_memory_search.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <vector>

namespace haustra::testing {
namespace {

constexpr int kThreads = 256;
constexpr int kBlocks = 2048;
constexpr std::size_t kLargestPiece = std::size_t{1} << 30;
constexpr std::size_t kSmallestPiece = std::size_t{1} << 20;

struct Words {
  std::uint64_t values[kMaxSearchedWords];
  int num;
};

__global__ void CountKernel(const std::uint32_t* memory, std::size_t num_halves, const Words words,
                            unsigned long long* num_found) {
  const std::size_t step = static_cast<std::size_t>(gridDim.x) * blockDim.x;
  for (std::size_t i = static_cast<std::size_t>(blockIdx.x) * blockDim.x + threadIdx.x; i + 1 < num_halves; i += step) {
    const std::uint64_t here = static_cast<std::uint64_t>(memory[i + 1]) << 32 | memory[i];
    for (int k = 0; k < words.num; ++k) {
      if (here == words.values[k]) atomicAdd(num_found, 1ull);
    }
  }
}

Status Checked(cudaError_t error) {
  return error == cudaSuccess ? Status::Ok() : Unavailable(std::string("memory search: ") + cudaGetErrorString(error));
}

}  // namespace

Result<FreeMemorySearch> SearchFreeDeviceMemory(std::span<const std::uint64_t> words) {
  Words searched{};
  searched.num = static_cast<int>(std::min(words.size(), kMaxSearchedWords));
  std::copy_n(words.begin(), searched.num, searched.values);
  unsigned long long* num_found = nullptr;
  HAUSTRA_TRY(Checked(cudaMalloc(&num_found, sizeof *num_found)));
  cudaError_t error = cudaMemset(num_found, 0, sizeof *num_found);
  std::vector<void*> pieces;
  FreeMemorySearch search;
  for (std::size_t size = kLargestPiece; size >= kSmallestPiece && error == cudaSuccess;) {
    void* piece = nullptr;
    if (cudaMalloc(&piece, size) != cudaSuccess) {
      (void)cudaGetLastError();  // there is no more of that size
      size /= 2;
      continue;
    }
    pieces.push_back(piece);
    CountKernel<<<kBlocks, kThreads>>>(static_cast<const std::uint32_t*>(piece), size / 4, searched, num_found);
    error = cudaGetLastError();
    search.num_searched_bytes += size;
  }
  unsigned long long found = 0;
  if (error == cudaSuccess) error = cudaMemcpy(&found, num_found, sizeof found, cudaMemcpyDeviceToHost);
  search.num_found = found;
  for (void* piece : pieces) (void)cudaFree(piece);
  (void)cudaFree(num_found);
  HAUSTRA_TRY(Checked(error));
  return search;
}

Status LeaveInDeviceMemory(std::span<const std::uint64_t> words) {
  constexpr std::size_t kRepeats = 4096;
  std::vector<std::uint64_t> bytes;
  for (std::size_t i = 0; i < kRepeats; ++i) bytes.insert(bytes.end(), words.begin(), words.end());
  void* block = nullptr;
  HAUSTRA_TRY(Checked(cudaMalloc(&block, bytes.size() * sizeof bytes[0])));
  const cudaError_t error = cudaMemcpy(block, bytes.data(), bytes.size() * sizeof bytes[0], cudaMemcpyHostToDevice);
  (void)cudaFree(block);
  return Checked(error);
}

}  // namespace haustra::testing
