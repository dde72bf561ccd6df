#include "tools/bench_command/bench_command.h"

#include <memory>

#include "kernels/cpu/cpu_vision_device.h"
#include "tools/bench_command/vision_bench.h"
#include "tools/command/configuration_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/exit_codes.h"

namespace haustra {

void AddBenchCommand(CLI::App& app, std::function<int()>& action) {
  CLI::App* bench = app.add_subcommand("bench", "Measure parts of the system on this machine");
  bench->require_subcommand(1);
  CLI::App* vision = bench->add_subcommand("vision", "Extraction and matching of the vision device on one picture");
  const auto options = std::make_shared<VisionBenchOptions>();
  vision->add_option("IMAGE", options->image_path, "PNG or JPEG file")->required();
  options->device = "auto";
  AddDeviceOption(*vision, options->device);
  vision->add_option("--threads", options->num_threads, "Threads of the CPU device")
      ->transform(WholeNumberBetween(1, kMaxCpuVisionThreads))
      ->capture_default_str();
  vision->add_option("--features", options->num_features, "Features to extract")
      ->transform(WholeNumberBetween(1, 100'000))
      ->capture_default_str();
  vision->add_option("--repeats", options->repeats, "Repeats of each measurement")
      ->transform(WholeNumberBetween(1, 1'000'000))
      ->capture_default_str();
  vision
      ->add_option("--database", options->num_database,
                   "Match 512 queries against so many descriptors as well (CUDA device)")
      ->transform(WholeNumberBetween(0, 10'000'000))
      ->capture_default_str();
  vision->add_flag("--dp4a", options->use_dp4a, "Products by dp4a instead of tensor cores (CUDA device)");
  vision->callback([options, &action] {
    action = [options] {
      const Status status = RunVisionBench(*options);
      if (status.ok()) return static_cast<int>(kExitOk);
      return console::Fail("bench vision", status);
    };
  });
}

}  // namespace haustra
