#include "kernels/cuda/cuda_depth_solver.h"

#include <cuda_runtime_api.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "kernels/cuda/block_dealer.h"
#include "kernels/cuda/cuda_memory.h"
#include "kernels/cuda/cuda_status.h"
#include "kernels/cuda/depth_kernels.h"

namespace haustra {
namespace kernels::cuda {
namespace {

// A size or a span that does not go with the others.
Status CheckDepthPlan(const DepthSolverPlan& plan) {
  HAUSTRA_TRY(plan.options.Validate());
  if (plan.width_px < 2 || plan.height_px < 2 || plan.width < 1 || plan.height < 1) {
    return InvalidArgument("depth solver: no size");
  }
  if (plan.cells.size() != static_cast<std::size_t>(plan.width) * plan.height ||
      plan.is_scene.size() != static_cast<std::size_t>(plan.width_px) * plan.height_px) {
    return InvalidArgument("depth solver: cells or mask of another size");
  }
  return Status::Ok();
}

class CudaDepthSolver final : public DepthSolver {
 public:
  CudaDepthSolver(const DepthSolverPlan& plan, int device)
      : device_(device),
        num_pixels_(static_cast<std::size_t>(plan.width_px) * plan.height_px),
        num_cells_(static_cast<std::size_t>(plan.width) * plan.height),
        num_iterations_(plan.options.num_iterations),
        max_sources_(plan.options.max_sources) {}

  ~CudaDepthSolver() override {
    if (stream_ == nullptr) return;
    (void)cudaSetDevice(device_);
    (void)cudaStreamSynchronize(stream_);
    (void)cudaStreamDestroy(stream_);
  }

  // What Construct takes. The addresses that it leaves behind mean nothing.
  MemoryPlan Count(const DepthSolverPlan& plan) {
    BlockDealer device, pinned;
    Deal(plan, &device, &pinned);
    MemoryPlan memory;
    memory.Add(MemoryPlace::kDevice, "depth search", num_cells_, device.used_bytes(), "image size, depth.max_sources");
    memory.Add(MemoryPlace::kHostPinned, "depth transfers", num_cells_, pinned.used_bytes(),
               "image size, depth.max_sources");
    return memory;
  }

  Status Construct(const DepthSolverPlan& plan) {
    int num_devices = 0;
    if (const cudaError_t error = cudaGetDeviceCount(&num_devices); error != cudaSuccess || num_devices == 0) {
      return Unavailable(std::string("no CUDA device: ") +
                         cudaGetErrorString(error != cudaSuccess ? error : cudaErrorNoDevice));
    }
    HAUSTRA_TRY(ToStatus(cudaSetDevice(device_), "device of the depth"));
    int least_priority = 0, greatest_priority = 0;
    HAUSTRA_TRY(ToStatus(cudaDeviceGetStreamPriorityRange(&least_priority, &greatest_priority), "priorities"));
    HAUSTRA_TRY(ToStatus(cudaStreamCreateWithPriority(&stream_, cudaStreamNonBlocking, least_priority), "stream"));
    const MemoryPlan memory = Count(plan);
    const std::size_t num_device_bytes = memory.bytes(MemoryPlace::kDevice);
    const std::size_t num_pinned_bytes = memory.bytes(MemoryPlace::kHostPinned);
    HAUSTRA_TRY(device_block_.Allocate(num_device_bytes));
    HAUSTRA_TRY(pinned_block_.Allocate(num_pinned_bytes));
    BlockDealer device(device_block_.data(), num_device_bytes);
    BlockDealer pinned(pinned_block_.data(), num_pinned_bytes);
    Deal(plan, &device, &pinned);
    return Upload(plan);
  }

  Status Solve(const DepthProblem& problem, std::span<float> inverse_range,
               std::span<std::uint8_t> confidence) override {
    const auto fits = [&](const ImageView& view) {
      return view.data != nullptr && view.format == PixelFormat::kGrey8 && view.width == task_.image_width &&
             view.height == task_.image_height;
    };
    const bool has_sources =
        !problem.sources.empty() && static_cast<int>(problem.sources.size()) <= max_sources_ &&
        std::all_of(problem.sources.begin(), problem.sources.end(), [&](const DepthSource& s) { return fits(s.grey); });
    if (!fits(problem.reference) || !has_sources || problem.first_planes.size() != 3 * num_cells_ ||
        inverse_range.size() != num_cells_ || confidence.size() != num_cells_) {
      return InvalidArgument("depth solver: an input of another size than planned");
    }
    HAUSTRA_TRY(ToStatus(cudaSetDevice(device_), "device of the depth"));
    HAUSTRA_TRY(ToStatus(Enqueue(problem), "depth of a keyframe"));
    HAUSTRA_TRY(ToStatus(cudaStreamSynchronize(stream_), "depth of a keyframe"));
    std::memcpy(inverse_range.data(), host_inverse_range_, num_cells_ * sizeof(float));
    std::memcpy(confidence.data(), host_confidence_, num_cells_);
    return Status::Ok();
  }

 private:
  void Deal(const DepthSolverPlan& plan, BlockDealer* device, BlockDealer* pinned) {
    const int side = 2 * plan.options.window_radius + 1;
    const std::size_t num_samples = num_cells_ * static_cast<std::size_t>(side * side);
    pictures_ = device->Deal<std::uint8_t>(num_pixels_ * (1 + max_sources_));
    quads_ = device->Deal<std::uint32_t>(num_pixels_ * max_sources_);
    is_scene_ = device->Deal<std::uint8_t>(num_pixels_);
    bearing_ = device->Deal<float4>(num_cells_);
    bearing_dx_ = device->Deal<float4>(num_cells_);
    bearing_dy_ = device->Deal<float4>(num_cells_);
    first_ = device->Deal<float4>(num_cells_);
    task_.estimates = device->Deal<float4>(num_cells_);
    task_.weight = device->Deal<float>(num_samples);
    task_.pattern = device->Deal<float>(num_samples);
    task_.variance = device->Deal<float>(num_cells_);
    task_.inverse_range = device->Deal<float>(num_cells_);
    task_.confidence = device->Deal<std::uint8_t>(num_cells_);
    table_ = device->Deal<float>(static_cast<std::size_t>(std::max(0, plan.camera.num_table_intervals)) + 1);
    host_pictures_ = pinned->Deal<std::uint8_t>(num_pixels_ * (1 + max_sources_));
    host_first_ = pinned->Deal<float4>(num_cells_);
    host_inverse_range_ = pinned->Deal<float>(num_cells_);
    host_confidence_ = pinned->Deal<std::uint8_t>(num_cells_);
  }

  Status Upload(const DepthSolverPlan& plan) {
    const ProjectionConstants& from = plan.camera;
    DepthCamera& camera = task_.camera;
    camera.kind = static_cast<int>(from.kind);
    std::copy_n(from.coefficients, std::size(camera.coefficients), camera.coefficients);
    std::copy_n(from.pixel_from_distorted, std::size(camera.pixel_from_distorted), camera.pixel_from_distorted);
    camera.cx = static_cast<float>(from.cx);
    camera.cy = static_cast<float>(from.cy);
    camera.max_half_angle_rad = static_cast<float>(from.max_half_angle_rad);
    camera.max_tangent = static_cast<float>(from.max_tangent);
    if (from.inverse_table != nullptr) {
      const std::vector<float> table(from.inverse_table, from.inverse_table + from.num_table_intervals + 1);
      HAUSTRA_TRY(ToStatus(cudaMemcpy(table_, table.data(), table.size() * sizeof(float), cudaMemcpyHostToDevice),
                           "camera of the depth"));
      camera.inverse_table = table_;
      camera.table_intervals_per_unit = static_cast<float>(from.table_intervals_per_unit);
      camera.num_table_intervals = from.num_table_intervals;
    }
    task_.image_width = plan.width_px;
    task_.image_height = plan.height_px;
    task_.width = plan.width;
    task_.height = plan.height;
    task_.window_radius = plan.options.window_radius;
    task_.window_step_px = plan.options.window_step_px;
    task_.best_sources = plan.options.best_sources;
    task_.noise_variance = static_cast<float>(plan.options.noise_grey * plan.options.noise_grey);
    task_.smoothness = static_cast<float>(plan.options.smoothness);
    task_.smooth_step = static_cast<float>(plan.options.smooth_step);
    task_.max_cosine = static_cast<float>(std::cos(plan.options.min_parallax_deg * std::numbers::pi / 180.0));
    task_.is_scene = is_scene_;
    task_.reference = pictures_;
    task_.bearing = bearing_;
    task_.bearing_dx = bearing_dx_;
    task_.bearing_dy = bearing_dy_;
    task_.first = first_;
    for (int s = 0; s < max_sources_; ++s) task_.sources[s].quads = quads_ + s * num_pixels_;
    std::vector<float4> rows(3 * num_cells_);
    for (std::size_t i = 0; i < num_cells_; ++i) {
      const DepthCell& cell = plan.cells[i];
      rows[i] = {cell.bearing[0], cell.bearing[1], cell.bearing[2], cell.is_usable ? 1.0f : 0.0f};
      rows[num_cells_ + i] = {cell.bearing_dx[0], cell.bearing_dx[1], cell.bearing_dx[2], cell.centre_x_px};
      rows[2 * num_cells_ + i] = {cell.bearing_dy[0], cell.bearing_dy[1], cell.bearing_dy[2], cell.centre_y_px};
    }
    const auto upload = [&](float4* to, std::size_t part) {
      return ToStatus(cudaMemcpy(to, &rows[part * num_cells_], num_cells_ * sizeof(float4), cudaMemcpyHostToDevice),
                      "cells of the depth");
    };
    HAUSTRA_TRY(upload(bearing_, 0));
    HAUSTRA_TRY(upload(bearing_dx_, 1));
    HAUSTRA_TRY(upload(bearing_dy_, 2));
    return ToStatus(cudaMemcpy(is_scene_, plan.is_scene.data(), num_pixels_, cudaMemcpyHostToDevice),
                    "mask of the depth");
  }

  cudaError_t Enqueue(const DepthProblem& problem) {
#define HAUSTRA_CUDA_TRY(expression) \
  if (const cudaError_t error = (expression); error != cudaSuccess) return error
    const auto num_sources = static_cast<int>(problem.sources.size());
    for (int i = 0; i <= num_sources; ++i) {
      const ImageView& view = i == 0 ? problem.reference : problem.sources[i - 1].grey;
      std::uint8_t* picture = host_pictures_ + i * num_pixels_;
      for (int y = 0; y < view.height; ++y) {
        std::memcpy(picture + static_cast<std::ptrdiff_t>(y) * view.width, view.row(y), view.width);
      }
    }
    for (std::size_t i = 0; i < num_cells_; ++i) {
      const float* plane = &problem.first_planes[3 * i];
      host_first_[i] = {plane[0], plane[1], plane[2], 0.0f};
    }
    HAUSTRA_CUDA_TRY(
        cudaMemcpyAsync(pictures_, host_pictures_, num_pixels_ * (1 + num_sources), cudaMemcpyHostToDevice, stream_));
    HAUSTRA_CUDA_TRY(
        cudaMemcpyAsync(first_, host_first_, num_cells_ * sizeof(float4), cudaMemcpyHostToDevice, stream_));
    task_.num_sources = num_sources;
    task_.min_inverse_range = problem.min_inverse_range;
    task_.max_inverse_range = problem.max_inverse_range;
    for (int s = 0; s < num_sources; ++s) {
      DepthSourceView& source = task_.sources[s];
      std::copy(problem.sources[s].rotation.begin(), problem.sources[s].rotation.end(), source.rotation);
      std::copy(problem.sources[s].translation.begin(), problem.sources[s].translation.end(), source.translation);
      HAUSTRA_CUDA_TRY(LaunchPackQuads(pictures_ + (1 + s) * num_pixels_, task_.image_width, task_.image_height,
                                       quads_ + s * num_pixels_, stream_));
    }
    HAUSTRA_CUDA_TRY(LaunchDepthWindows(task_, stream_));
    HAUSTRA_CUDA_TRY(LaunchDepthBegin(task_, stream_));
    for (int iteration = 0; iteration < num_iterations_; ++iteration) {
      HAUSTRA_CUDA_TRY(LaunchDepthImprove(task_, iteration, 0, stream_));
      HAUSTRA_CUDA_TRY(LaunchDepthImprove(task_, iteration, 1, stream_));
    }
    HAUSTRA_CUDA_TRY(LaunchDepthAnswer(task_, stream_));
    HAUSTRA_CUDA_TRY(cudaMemcpyAsync(host_inverse_range_, task_.inverse_range, num_cells_ * sizeof(float),
                                     cudaMemcpyDeviceToHost, stream_));
    return cudaMemcpyAsync(host_confidence_, task_.confidence, num_cells_, cudaMemcpyDeviceToHost, stream_);
#undef HAUSTRA_CUDA_TRY
  }

  const int device_;
  const std::size_t num_pixels_, num_cells_;
  const int num_iterations_, max_sources_;
  DeviceBlock device_block_;
  PinnedBlock pinned_block_;
  cudaStream_t stream_ = nullptr;
  DepthTask task_;
  std::uint8_t* pictures_ = nullptr;  // the reference, then the sources
  std::uint32_t* quads_ = nullptr;    // of the sources
  std::uint8_t* is_scene_ = nullptr;
  float4 *bearing_ = nullptr, *bearing_dx_ = nullptr, *bearing_dy_ = nullptr, *first_ = nullptr;
  float* table_ = nullptr;
  std::uint8_t* host_pictures_ = nullptr;
  float4* host_first_ = nullptr;
  float* host_inverse_range_ = nullptr;
  std::uint8_t* host_confidence_ = nullptr;
};

}  // namespace
}  // namespace kernels::cuda

MemoryPlan PlanCudaDepthSolver(const DepthSolverPlan& plan) {
  return kernels::cuda::CudaDepthSolver(plan, 0).Count(plan);
}

Result<std::unique_ptr<DepthSolver>> CreateCudaDepthSolver(const DepthSolverPlan& plan, int device) {
  HAUSTRA_TRY(kernels::cuda::CheckDepthPlan(plan));
  auto solver = std::make_unique<kernels::cuda::CudaDepthSolver>(plan, device);
  HAUSTRA_TRY(solver->Construct(plan));
  return std::unique_ptr<DepthSolver>(std::move(solver));
}

}  // namespace haustra
