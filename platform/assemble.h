// The composition root: makes a vision device by its name and checks that camera and configuration fit together.
#pragma once

#include <memory>
#include <string_view>

#include "engine/engine.h"
#include "hal/depth_solver.h"
#include "hal/vision_device.h"

namespace haustra {

// First in main, while the process has one thread: what a device is to do from its start. (A CUDA device loads all its
// kernels when it is made.)
void PrepareVisionDevices();

// "auto" as "cuda" where this build and this machine have it, else as "cpu"; other names as they are.
std::string_view ResolveVisionDevice(std::string_view name);

// Threads of the CPU device: as many as were asked for; 0: one for each processor that this process may use. Those that
// help tracking have its priority: in real time with rt.enabled one processor is left to mapping and all others, which
// would wait for ever where frames take all the time there is. At least one, and no more than the device takes.
int NumVisionThreads(int asked, const EngineConfig& config, Engine::Mode mode);
// The same on a machine of so many processors.
int NumVisionThreads(int asked, const EngineConfig& config, Engine::Mode mode, int num_processors);
// The most that the CPU device takes.
int MaxVisionThreads();

// "cpu" or "cuda". kUnavailable when this build or this machine does not have it. num_threads: of the CPU device,
// 0 means one for each core.
Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const EngineConfig& config,
                                                         const CameraCalibration& calibration, int num_threads);

// The same for a plan of the caller's own.
Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const VisionPlan& plan,
                                                         const ExtractOptions& options, int num_threads);

// Where the depth of keyframes is searched: on "cuda" a solver, on "cpu" none, since the engine does it itself. Errors
// as above, and those of the plan.
Result<std::unique_ptr<DepthSolver>> CreateDepthSolver(std::string_view name, const DepthSolverPlan& plan);

// Where an engine searches the depth of its keyframes. The matcher works on the solver, where there is one.
struct DepthSearch {
  std::unique_ptr<DepthSolver> solver;
  std::unique_ptr<DepthMatcher> matcher;  // null: none is asked for
};

// For an engine of this configuration; takes nothing unless config.depth.enabled. mask: empty, or of the camera's size.
// Errors of CreateDepthSolver.
Result<DepthSearch> CreateDepthSearch(std::string_view name, const EngineConfig& config, const CameraModel& camera,
                                      ImageView mask);

}  // namespace haustra
